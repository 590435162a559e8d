// Boxes of a wide node about the middle of the tree's bounds, rounded outward.
#pragma once

#include <bit>
#include <cstdint>

#include "base/math.h"
#include "layout/quantise.h"

namespace raydix {

/// The largest float that is at most a - b, for floats of at most 1e12. Without branches.
[[gnu::always_inline]] inline float difference_below(float a, float b) {
    // What rounding took, exactly (Knuth's two-sum).
    const float rounded = a - b, of_b = rounded - a;
    const float error = (a - (rounded - of_b)) - (b + of_b);
    // The next float down has the next smaller magnitude, or of a negative one the next larger; a
    // difference of 0 is exact.
    const auto bits = std::bit_cast<std::int32_t>(rounded);
    const std::int32_t down = bits < 0 ? bits + 1 : bits - 1;
    return std::bit_cast<float>(error < 0 ? down : bits);
}

/// Slots of no child get lo = infinity and hi = -infinity.
template <class Node>
[[gnu::always_inline]] inline void set_boxes_about(Vec3 middle, const SlotBoxes& boxes,
                                                   Node& node) {
    for (int axis = 0; axis < 3; ++axis) {
        const float from = coordinate(middle, axis);
        for (int s = 0; s < quantised_width; ++s) {
            const bool used = (boxes.used >> s & 1) != 0;
            const float lo = difference_below(boxes.lo[axis][s], from);
            const float hi = -difference_below(from, boxes.hi[axis][s]);
            node.lo[axis][s] = used ? lo : infinity;
            node.hi[axis][s] = used ? hi : -infinity;
        }
    }
}

}  // namespace raydix
