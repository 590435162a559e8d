// One step of a top-down build by surface area: references in order of their centroids on three
// axes -> the best of all 3 (n - 1) ways to cut one of the lists in two.
#pragma once

#include <array>
#include <cstdint>

#include "tree/sah_reference.h"

namespace raydix {

/// The first `left` references in the order of `axis` go to one side, the others to the other.
struct SweepSplit {
    float cost = infinity;  // area(left) * left + area(right) * right, half surfaces
    std::uint32_t axis = 0, left = 0;
};

/// Lower cost first; of equals the more even cut, then the lower axis, then the shorter left side.
/// A cut in the middle of equal boxes keeps trees over them flat.
[[nodiscard]] bool is_better(const SweepSplit& a, const SweepSplit& b, std::uint32_t n);

/// The orders of `n` references: places in `references`, ascending by centroid, per axis.
struct SweepLists {
    const SahReference* references;
    std::array<const std::uint32_t*, 3> orders;
    std::uint32_t n;
};

/// By one thread; `areas` [n] is scratch. n >= 2.
[[nodiscard]] SweepSplit find_sweep_split(const SweepLists& lists, float* areas);

/// The same split, by all threads.
[[nodiscard]] SweepSplit find_sweep_split_parallel(const SweepLists& lists);

}  // namespace raydix
