// Morton code and prefix length -> the plane that parts a k-d node: axis p mod 3, at the prefix
// bits followed by a 1 (Karras 2012, section 5), as the float that parts centres exactly as codes
// do.
#pragma once

#include <bit>
#include <cstdint>

#include "base/hd.h"
#include "base/math.h"
#include "keys/morton.h"

namespace raydix {

/// Finite floats as consecutive integers in the same order; 0 and -0 are one.
RAYDIX_HD inline std::int64_t ordinal_of(float x) {
    const auto bits = std::bit_cast<std::uint32_t>(x);
    const auto magnitude = static_cast<std::int64_t>(bits & 0x7FFFFFFFu);
    return bits >> 31 != 0 ? -magnitude : magnitude;
}
RAYDIX_HD inline float float_at(std::int64_t ordinal) {
    return ordinal < 0 ? std::bit_cast<float>(0x80000000u | static_cast<std::uint32_t>(-ordinal))
                       : std::bit_cast<float>(static_cast<std::uint32_t>(ordinal));
}

/// One axis of the grid.
struct GridAxis {
    float lo, cells_per_unit;

    /// Whether a centre at `x` lies in `cell` or beyond. Subtraction and product are monotone under
    /// rounding, so this changes from false to true once along the axis.
    [[nodiscard]] RAYDIX_HD bool reaches(float x, float cell) const {
        return (x - lo) * cells_per_unit >= cell;
    }
};

/// The least float whose cell along the axis is at least `cell` (>= 1). Hence for every centre c of
/// the scene: cell(c) < cell exactly if c < plane. The quotient lands a few floats away at most,
/// except near 0 in a grid that starts far from it; so: gallop from there, then bisect. At least
/// one centre must reach the cell.
RAYDIX_HD inline float split_plane(const GridAxis& grid, std::uint32_t cell) {
    const auto wanted = static_cast<float>(cell);
    const std::int64_t least = ordinal_of(grid.lo), most = ordinal_of(infinity);
    std::int64_t below = ordinal_of(grid.lo + wanted / grid.cells_per_unit), above = below;
    std::int64_t step = 1;
    if (grid.reaches(float_at(below), wanted)) {
        do {  // `above` reaches
            above = below;
            below = above - step > least ? above - step : least;
            step *= 2;
        } while (below > least && grid.reaches(float_at(below), wanted));
    } else {
        do {  // `below` does not
            below = above;
            above = below + step < most ? below + step : most;
            step *= 2;
        } while (above < most && !grid.reaches(float_at(above), wanted));
    }
    while (above - below > 1) {
        const std::int64_t middle = below + (above - below) / 2;
        if (grid.reaches(float_at(middle), wanted))
            above = middle;
        else
            below = middle;
    }
    return float_at(above);
}

struct KdSplit {
    std::uint32_t axis;
    float plane;
};

/// The split of codes that share their first `prefix` bits; `right` is any code of the right side.
/// Codes that are all equal (prefix >= code bits) go on through the axes in turn, at no plane.
template <class Key>
RAYDIX_HD KdSplit split_of_prefix(const Grid& grid, Key right, int prefix) {
    const auto axis = static_cast<std::uint32_t>(prefix % 3);
    if (prefix >= CodeFormat<Key>::bits) return {axis, infinity};
    const auto cell =
        static_cast<std::uint32_t>(gather_bits(static_cast<Key>(right >> (2 - axis))));
    const int bits_below = CodeFormat<Key>::axis_bits - 1 - prefix / 3;
    const float lo = axis == 0 ? grid.lo.x : axis == 1 ? grid.lo.y : grid.lo.z;
    return {axis, split_plane({lo, grid.cells_per_unit}, cell >> bits_below << bits_below)};
}

}  // namespace raydix
