// One step of a top-down build by surface area: boxes -> bins over their centroids -> the best
// plane between two bins -> boxes left and right of it. Wald 2007, "On fast Construction of
// SAH-based Bounding Volume Hierarchies".
#pragma once

#include <raydix/types.h>

#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "base/float4.h"
#include "base/math.h"
#include "tree/box_lanes.h"

namespace raydix {

/// A box that is sorted to one side or the other: a primitive, or a run of `count` neighbours in
/// Morton order. One load for each corner.
struct alignas(32) SplitBox {
    Vec3 lo;
    std::uint32_t first;  // place in Morton order
    Vec3 minus_hi;        // the union takes the least of both corners
    std::uint32_t count;

    [[nodiscard]] static SplitBox of(const Aabb& box, std::uint32_t first, std::uint32_t count) {
        return {box.lo, first, {-box.hi.x, -box.hi.y, -box.hi.z}, count};
    }
    [[nodiscard]] Aabb box() const { return {lo, {-minus_hi.x, -minus_hi.y, -minus_hi.z}}; }
    /// Twice the centroid.
    [[nodiscard]] Float4 center2() const {
        return Float4::load(&lo.x).xyz() - Float4::load(&minus_hi.x).xyz();
    }
};
static_assert(sizeof(SplitBox) == 32);

inline constexpr std::uint32_t max_bins = 128, usual_bins = 32;

/// Few boxes need few bins: most nodes of a tree are small, and theirs is most of the time.
[[nodiscard]] constexpr std::uint32_t bin_count(std::size_t boxes, std::uint32_t most) {
    return boxes < 20 * (most - 8) ? 8 + static_cast<std::uint32_t>(boxes / 20) : most;
}

/// Lists from twice this length on are taken by several threads, in blocks of this length.
inline constexpr std::size_t parallel_boxes = 32768;

/// Centroid -> bin, per axis.
struct BinGrid {
    alignas(16) std::array<float, 4> origin, scale;  // scale 0: the axis is not split
    std::uint32_t bins;

    /// `most` bins an axis at most, up to max_bins.
    explicit BinGrid(std::span<const SplitBox> boxes, std::uint32_t most = usual_bins);

    [[nodiscard]] bool flat() const { return scale[0] == 0 && scale[1] == 0 && scale[2] == 0; }
    [[nodiscard]] std::int32_t bin(const SplitBox& box, std::size_t axis) const {
        const float center2 = (&box.lo.x)[axis] - (&box.minus_hi.x)[axis];
        return static_cast<std::int32_t>((center2 - origin[axis]) * scale[axis]);
    }
};

/// Boxes whose bin on `axis` is at most `last_left` go to the left.
struct Split {
    std::size_t axis;
    std::int32_t last_left;
    std::uint32_t left_boxes, left_primitives;
};

/// What a split comes to: half surfaces times counts, and the boxes of both sides.
struct SplitSides {
    float cost = infinity;
    Aabb left{}, right{};
};

/// The plane with the least area(left) * count(left) + area(right) * count(right), counts of
/// primitives; of equals the lowest in (axis, bin). If that is 0, as for boxes on a line, the plane
/// that divides the primitives most evenly. None if all centroids fall into one bin. `sides`, if
/// asked for, is about the split.
[[nodiscard]] std::optional<Split> find_split(std::span<const SplitBox> boxes, const BinGrid& grid,
                                              bool wide, SplitSides* sides = nullptr);

/// from [n] -> the left ones from to[0] on, the others from to[right_begin] on, both in the old
/// order.
void divide_boxes(std::span<const SplitBox> from, const BinGrid& grid, const Split& split,
                  SplitBox* to, std::size_t right_begin, bool wide);

}  // namespace raydix
