#include "mpi/agree.h"

#include <raydix/error.h>

#include <limits>
#include <new>

namespace raydix::mpi {
namespace {

constexpr std::uint64_t none = std::numeric_limits<std::uint64_t>::max();

/// Says which rank ran out of memory.
class RankOutOfMemory : public std::bad_alloc {
public:
    explicit RankOutOfMemory(std::string text) : text_(std::move(text)) {}
    [[nodiscard]] const char* what() const noexcept override { return text_.c_str(); }

private:
    std::string text_;
};

/// An error as text that another rank can throw: a letter for its type, then its message.
std::string packed(const std::exception_ptr& error) {
    try {
        std::rethrow_exception(error);
    } catch (const ResultTooLarge& e) {
        return "L" + std::to_string(e.bytes()) + (e.is_exact() ? "=" : ">") + e.what();
    } catch (const InputError& e) {
        return std::string("I") + e.what();
    } catch (const BackendUnavailable& e) {
        return std::string("B") + e.what();
    } catch (const std::bad_alloc&) {
        return "Mnot enough memory";
    } catch (const std::exception& e) {
        return std::string("R") + e.what();
    } catch (...) {
        return "Ran exception that is no std::exception";
    }
}

/// The limit stands at the end of the message.
[[noreturn]] void throw_too_large(const std::string& text, const std::string& whose) {
    const std::size_t mark = text.find_first_of("=>"), reason = text.find(": the result needs");
    const std::string what = text.substr(mark + 1, reason - mark - 1);
    const std::uint64_t bytes = std::stoull(text.substr(0, mark)),
                        limit = std::stoull(text.substr(text.rfind(' ') + 1));
    throw ResultTooLarge(whose + what, bytes, text[mark] == '=', limit);
}

[[noreturn]] void throw_packed(const std::string& error, std::uint64_t rank) {
    const std::string whose = "rank " + std::to_string(rank) + ": ", text = error.substr(1);
    switch (error.front()) {
        case 'L':
            throw_too_large(text, whose);
        case 'I':
            throw InputError(whose + text);
        case 'B':
            throw BackendUnavailable(whose + text);
        case 'M':
            throw RankOutOfMemory(whose + text);
        default:
            throw std::runtime_error(whose + text);
    }
}

[[noreturn]] void throw_error_of(const Communicator& comm, std::uint64_t rank,
                                 const std::exception_ptr& error) {
    const bool is_mine = rank == std::uint64_t(comm.rank());
    throw_packed(comm.broadcast(is_mine ? packed(error) : std::string(), static_cast<int>(rank)),
                 rank);
}

std::uint64_t failed_rank(const Communicator& comm, const std::exception_ptr& error) {
    return error ? std::uint64_t(comm.rank()) : none;
}

std::uint64_t hash_of(const std::string& text) {
    std::uint64_t hash = 0xCBF29CE484222325u;  // FNV-1a
    for (const char c : text) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001B3u;
    return hash;
}

[[noreturn]] void throw_mismatch(const Communicator& comm, const std::string& call) {
    const std::string first = comm.broadcast(comm.rank() == 0 ? call : std::string(), 0);
    std::uint64_t other = call == first ? none : std::uint64_t(comm.rank());
    comm.reduce(&other, 1, MPI_MIN);
    const bool is_mine = other == std::uint64_t(comm.rank());
    const std::string theirs =
        comm.broadcast(is_mine ? call : std::string(), static_cast<int>(other));
    throw InputError("the ranks differ: rank 0 calls " + first + ", rank " + std::to_string(other) +
                     " calls " + theirs);
}

}  // namespace

void agree(const Communicator& comm, const std::exception_ptr& error) {
    std::uint64_t failed = failed_rank(comm, error);
    comm.reduce(&failed, 1, MPI_MIN);
    if (failed != none) throw_error_of(comm, failed, error);
}

void agree_on(const Communicator& comm, const std::string& call, const std::exception_ptr& error) {
    // The least and, by its complement, the greatest hash: equal if all are.
    const std::uint64_t hash = hash_of(call);
    std::uint64_t values[3] = {hash, ~hash, failed_rank(comm, error)};
    comm.reduce(values, 3, MPI_MIN);
    if (values[2] != none) throw_error_of(comm, values[2], error);
    if (values[0] != ~values[1]) throw_mismatch(comm, call);
}

std::uint64_t agree_on_work(const Communicator& comm, std::uint64_t work,
                            const std::exception_ptr& error) {
    std::uint64_t values[2] = {work, error ? 1u : 0u};
    comm.reduce(values, 2, MPI_SUM);
    if (values[1] != 0) agree(comm, error);
    return values[0];
}

}  // namespace raydix::mpi
