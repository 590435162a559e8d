// What tests over several ranks share. All ranks make the same input from the same seed, so each
// can also ask one process that holds everything.
#pragma once

#include <gtest/gtest.h>
#include <raydix/mpi.h>

#include <cstring>
#include <optional>
#include <random>
#include <span>
#include <string>
#include <vector>

namespace raydix::mpi::test {

inline int rank() {
    int rank = 0;
    MPI_Comm_rank(MPI_COMM_WORLD, &rank);
    return rank;
}
inline int ranks() {
    int size = 0;
    MPI_Comm_size(MPI_COMM_WORLD, &size);
    return size;
}

/// How a whole is divided among ranks.
enum class Division { even, one_holds_all, some_empty, random };
inline constexpr Division divisions[] = {Division::even, Division::one_holds_all,
                                         Division::some_empty, Division::random};

/// Where the part of each rank begins, [ranks + 1].
inline std::vector<std::size_t> division_of(std::size_t n, Division division, unsigned seed) {
    const auto size = static_cast<std::size_t>(ranks());
    std::mt19937 random(seed);
    std::vector<std::size_t> weights(size, 1), begins{0};
    std::size_t sum = 0;
    for (std::size_t r = 0; r < size; ++r) {
        if (division == Division::one_holds_all) weights[r] = r == size - 1;
        if (division == Division::some_empty) weights[r] = size == 1 || r % 2 == 1;
        if (division == Division::random) weights[r] = 1 + random() % 10;
        sum += weights[r];
    }
    std::size_t so_far = 0;
    for (std::size_t r = 0; r < size; ++r) {
        so_far += weights[r];
        begins.push_back(n * so_far / sum);
    }
    return begins;
}

inline int last_rank() { return ranks() - 1; }

/// This rank's part of a whole.
template <class T>
std::span<const T> mine(const std::vector<T>& whole, const std::vector<std::size_t>& begins) {
    const auto r = static_cast<std::size_t>(rank());
    return std::span<const T>(whole).subspan(begins[r], begins[r + 1] - begins[r]);
}

/// Whether the values have the same bits.
template <class A, class B>
bool same_bits(const A& a, const B& b) {
    return a.size() == b.size() &&
           (a.size() == 0 || std::memcmp(a.data(), b.data(), a.size() * sizeof(*a.data())) == 0);
}

}  // namespace raydix::mpi::test
