// What the commands of raydix_mpi share: arrays from rank 0 to all and back.
#pragma once

#include <mpi.h>
#include <raydix/error.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace raydix::cli {

[[nodiscard]] int mpi_rank();
[[nodiscard]] int mpi_ranks();

/// Bytes to another rank and from it, in pieces that MPI can count.
void send_bytes(const void* data, std::uint64_t bytes, int to);
void receive_bytes(void* data, std::uint64_t bytes, int from);

/// Where the part of rank r of n elements begins.
[[nodiscard]] inline std::size_t part_begin(std::size_t n, int r) {
    return n * std::size_t(r) / std::size_t(mpi_ranks());
}

template <class T>
void send_array(std::span<const T> values, int to) {
    const std::uint64_t n = values.size();
    send_bytes(&n, sizeof(n), to);
    send_bytes(values.data(), values.size_bytes(), to);
}
template <class T>
[[nodiscard]] std::vector<T> receive_array(int from) {
    std::uint64_t n = 0;
    receive_bytes(&n, sizeof(n), from);
    std::vector<T> values(n);
    receive_bytes(values.data(), n * sizeof(T), from);
    return values;
}

/// Collective. Equal parts of what rank 0 has, in rank order.
template <class T>
[[nodiscard]] std::vector<T> scatter(const std::vector<T>& whole) {
    if (mpi_rank() != 0) return receive_array<T>(0);
    const auto part = [&](int r) {
        const std::size_t begin = part_begin(whole.size(), r);
        return std::span<const T>(whole).subspan(begin, part_begin(whole.size(), r + 1) - begin);
    };
    for (int r = 1; r < mpi_ranks(); ++r) send_array(part(r), r);
    return {part(0).begin(), part(0).end()};
}

/// Collective. The parts of all ranks, in rank order, on rank 0; nothing on the others.
template <class T>
[[nodiscard]] std::vector<T> gather(std::span<const T> part) {
    if (mpi_rank() != 0) {
        send_array(part, 0);
        return {};
    }
    std::vector<T> whole(part.begin(), part.end());
    for (int r = 1; r < mpi_ranks(); ++r) {
        const std::vector<T> more = receive_array<T>(r);
        whole.insert(whole.end(), more.begin(), more.end());
    }
    return whole;
}

/// Collective. Offsets of the rows of all ranks, on rank 0, from those of each.
[[nodiscard]] std::vector<std::uint64_t> gather_offsets(std::span<const std::uint64_t> part);

/// Collective. What went wrong on any rank is an error on all: that of the lowest rank, which it
/// names unless it is rank 0. A usage error stays one; others are InputErrors. Empty: nothing.
void throw_on_all(const std::string& error, bool is_usage = false);

/// Collective. All ranks run `body`.
template <class Body>
void on_each(const Body& body) {
    std::string error;
    bool is_usage = false;
    try {
        body();
    } catch (const std::exception& e) {
        error = e.what();
        is_usage = dynamic_cast<const CLI::ParseError*>(&e) != nullptr;
        if (error.empty()) error = "unknown error";
    }
    throw_on_all(error, is_usage);
}

/// Collective. Rank 0 runs `body`; what goes wrong there is an error on all ranks.
template <class Body>
void on_first(const Body& body) {
    on_each([&] {
        if (mpi_rank() == 0) body();
    });
}

}  // namespace raydix::cli
