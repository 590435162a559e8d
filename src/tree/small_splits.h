// The best division of up to 16 boxes, without bins: every plane through a centroid on every axis,
// all of them at once; of five boxes or fewer every division there is. A node is a set of lanes, so
// nothing moves from parent to child. In 4, 8 or 16 lanes at a time, the same choice in all three.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "tree/split_bins.h"

namespace raydix {

inline constexpr std::size_t small_boxes = 16;

/// Boxes coordinate by coordinate, each in a lane: x y z of lo, then of -hi, then of lo + hi.
struct alignas(64) SmallBoxes {
    std::array<std::array<float, small_boxes>, 9> at;

    void set(std::size_t lane, const SplitBox& box) {
        at[0][lane] = box.lo.x;
        at[1][lane] = box.lo.y;
        at[2][lane] = box.lo.z;
        at[3][lane] = box.minus_hi.x;
        at[4][lane] = box.minus_hi.y;
        at[5][lane] = box.minus_hi.z;
        at[6][lane] = box.lo.x - box.minus_hi.x;
        at[7][lane] = box.lo.y - box.minus_hi.y;
        at[8][lane] = box.lo.z - box.minus_hi.z;
    }
};

/// One bit a lane.
using LaneSet = std::uint32_t;

/// Lanes of `set`, 3 at least, that go left: those with the least area(left) * count(left) +
/// area(right) * count(right) in float32. Of equals the lowest: up to 5 lanes by the number that
/// the set on the left is, counted in lanes of `set`, never with its last one; else by (axis, lane
/// that the plane goes through; centroids on it go left). If the least is 0, or no plane divides
/// the set, the lower half of its lanes.
[[nodiscard]] LaneSet split_small(const SmallBoxes& boxes, LaneSet set, int width);

/// 4, 8 or 16: what the processor has.
[[nodiscard]] int split_width();

}  // namespace raydix
