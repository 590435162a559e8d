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

std::string text_of_first(std::string text) {
    std::uint64_t size = text.size();
    MPI_Bcast(&size, 1, MPI_UINT64_T, 0, MPI_COMM_WORLD);
    text.resize(size);
    MPI_Bcast(text.data(), static_cast<int>(size), MPI_CHAR, 0, MPI_COMM_WORLD);
    return text;
}

}  // namespace raydix::cli
