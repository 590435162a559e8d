// Bytes from rank to rank where one of them has no memory for what comes, or an error already.
#include "mpi/exchange.h"

#include <unistd.h>

#include <fstream>
#include <new>

#include "mpi/leaks.h"
#include "mpi/ranks.h"
#include "support/resource_limit.h"

namespace raydix::mpi::test {
namespace {

constexpr std::size_t megabyte = std::size_t{1} << 20;

/// What the process has, and `more`.
std::size_t bytes_and(std::size_t more) {
    std::size_t pages = 0;
    std::ifstream("/proc/self/statm") >> pages;
    return pages * std::size_t(sysconf(_SC_PAGESIZE)) + more;
}

/// What each rank sends to the last one.
std::vector<Bytes> to_last(std::size_t bytes) {
    std::vector<Bytes> out(static_cast<std::size_t>(ranks()));
    out.back().resize(bytes);
    return out;
}

TEST(ExchangeOverRanks, ARankWithoutMemoryForWhatComesIsNamedOnAll) {
#ifdef RAYDIX_FINDS_LEAKS
    GTEST_SKIP() << "the address sanitizer ends a process that has no memory";
#endif
    const Communicator comm(MPI_COMM_WORLD);
    const auto out = to_last(64 * megabyte / std::size_t(ranks()));
    try {
        std::optional<raydix::test::ResourceLimit> little;
        if (rank() == last_rank()) little.emplace(RLIMIT_AS, bytes_and(16 * megabyte));
        (void)exchange(comm, out, megabyte);
        ADD_FAILURE() << "no error";
    } catch (const std::bad_alloc& error) {
        EXPECT_EQ(std::string(error.what()),
                  "rank " + std::to_string(last_rank()) + ": not enough memory");
    }
    const Arrived arrived = exchange(comm, out, megabyte);  // the communicator still works
    EXPECT_EQ(
        arrived.all().size(),
        rank() == last_rank() ? 64 * megabyte / std::size_t(ranks()) * std::size_t(ranks()) : 0);
}

TEST(ExchangeOverRanks, AnErrorOfARankIsThrownOnAll) {
    const Communicator comm(MPI_COMM_WORLD);
    std::exception_ptr error;
    if (rank() == last_rank()) error = std::make_exception_ptr(InputError("no"));
    try {
        (void)exchange(comm, to_last(100), 7, error);
        ADD_FAILURE() << "no error";
    } catch (const InputError& thrown) {
        EXPECT_EQ(std::string(thrown.what()), "rank " + std::to_string(last_rank()) + ": no");
    }
}

}  // namespace
}  // namespace raydix::mpi::test
