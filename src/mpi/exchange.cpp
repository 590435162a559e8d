#include "mpi/exchange.h"

#include <algorithm>

#include "mpi/agree.h"

namespace raydix::mpi {
namespace {

/// Messages between two ranks keep their order, so all pieces may have one tag.
constexpr int piece_tag = 1;

template <class Piece>
void each_piece(std::uint64_t size, std::uint64_t most_bytes, const Piece& piece) {
    for (std::uint64_t at = 0; at < size; at += most_bytes)
        piece(at, static_cast<int>(std::min(most_bytes, size - at)));
}

}  // namespace

Arrived exchange(const Communicator& comm, const std::vector<Bytes>& out, std::uint64_t most_bytes,
                 std::exception_ptr error) {
    const auto ranks = static_cast<std::size_t>(comm.size());
    const auto me = static_cast<std::size_t>(comm.rank());
    std::vector<std::uint64_t> sizes(ranks);
    for (std::size_t r = 0; r < ranks; ++r) sizes[r] = out[r].size();
    sizes = comm.transpose(sizes);
    std::vector<std::uint64_t> starts(ranks + 1, 0);
    for (std::size_t r = 0; r < ranks; ++r) starts[r + 1] = starts[r] + sizes[r];
    Bytes in;
    std::vector<MPI_Request> requests;
    // All memory before the first message: a rank that gave up later would leave others waiting.
    keep_error(error, [&] {
        in.resize(starts.back());
        std::size_t pieces = 0;
        const auto count = [&](std::uint64_t, int) { ++pieces; };
        for (std::size_t r = 0; r < ranks; ++r) {
            if (r == me) continue;
            each_piece(sizes[r], most_bytes, count);
            each_piece(out[r].size(), most_bytes, count);
        }
        requests.reserve(pieces);
    });
    agree(comm, error);
    for (std::size_t r = 0; r < ranks; ++r) {
        if (r == me) continue;
        each_piece(sizes[r], most_bytes, [&](std::uint64_t at, int size) {
            check_mpi(MPI_Irecv(in.data() + starts[r] + at, size, MPI_BYTE, static_cast<int>(r),
                                piece_tag, comm.handle(), &requests.emplace_back()),
                      "MPI_Irecv");
        });
    }
    for (std::size_t k = 1; k < ranks; ++k) {  // each rank begins with another one
        const std::size_t r = (me + k) % ranks;
        each_piece(out[r].size(), most_bytes, [&](std::uint64_t at, int size) {
            check_mpi(MPI_Isend(out[r].data() + at, size, MPI_BYTE, static_cast<int>(r), piece_tag,
                                comm.handle(), &requests.emplace_back()),
                      "MPI_Isend");
            comm.count_message(std::uint64_t(size));
        });
    }
    std::copy(out[me].begin(), out[me].end(), in.begin() + static_cast<std::ptrdiff_t>(starts[me]));
    check_mpi(MPI_Waitall(static_cast<int>(requests.size()), requests.data(), MPI_STATUSES_IGNORE),
              "MPI_Waitall");
    return {std::move(in), std::move(starts)};
}

}  // namespace raydix::mpi
