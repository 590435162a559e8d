#include "mpi_ranks.h"

namespace raydix::cli {
namespace {

constexpr std::uint64_t most_bytes = std::uint64_t{1} << 30;

template <class Piece>
void each_piece(std::uint64_t bytes, const Piece& piece) {
    for (std::uint64_t at = 0; at < bytes; at += most_bytes)
        piece(at, static_cast<int>(std::min(most_bytes, bytes - at)));
}

}  // namespace

int mpi_rank() {
    int rank = 0;
    MPI_Comm_rank(MPI_COMM_WORLD, &rank);
    return rank;
}

int mpi_ranks() {
    int ranks = 1;
    MPI_Comm_size(MPI_COMM_WORLD, &ranks);
    return ranks;
}

void send_bytes(const void* data, std::uint64_t bytes, int to) {
    each_piece(bytes, [&](std::uint64_t at, int size) {
        MPI_Send(static_cast<const std::byte*>(data) + at, size, MPI_BYTE, to, 0, MPI_COMM_WORLD);
    });
}

void receive_bytes(void* data, std::uint64_t bytes, int from) {
    each_piece(bytes, [&](std::uint64_t at, int size) {
        MPI_Recv(static_cast<std::byte*>(data) + at, size, MPI_BYTE, from, 0, MPI_COMM_WORLD,
                 MPI_STATUS_IGNORE);
    });
}

std::vector<std::uint64_t> gather_offsets(std::span<const std::uint64_t> part) {
    std::vector<std::uint64_t> lengths;
    for (std::size_t i = 0; i + 1 < part.size(); ++i) lengths.push_back(part[i + 1] - part[i]);
    std::vector<std::uint64_t> offsets{0};
    for (const std::uint64_t length : gather(std::span<const std::uint64_t>(lengths)))
        offsets.push_back(offsets.back() + length);
    return offsets;
}

void throw_on_all(const std::string& error, bool is_usage) {
    int failed = error.empty() ? mpi_ranks() : mpi_rank();
    MPI_Allreduce(MPI_IN_PLACE, &failed, 1, MPI_INT, MPI_MIN, MPI_COMM_WORLD);
    if (failed == mpi_ranks()) return;
    std::uint64_t told[2] = {error.size(), is_usage ? 1u : 0u};
    MPI_Bcast(told, 2, MPI_UINT64_T, failed, MPI_COMM_WORLD);
    std::string text = error;
    text.resize(told[0]);
    MPI_Bcast(text.data(), static_cast<int>(told[0]), MPI_CHAR, failed, MPI_COMM_WORLD);
    if (failed != 0) text.insert(0, "rank " + std::to_string(failed) + ": ");
    if (told[1] != 0) throw CLI::ValidationError(text);
    throw InputError(text);
}

}  // namespace raydix::cli
