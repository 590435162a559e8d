#include "tree/sbvh_divide.h"

#include <algorithm>
#include <bit>

#include "tree/sah_reference.h"

namespace raydix {
namespace {

/// The children's places in `other`: the lower one's, then the upper one's. What a node may still
/// add is theirs in proportion to what they hold.
struct Places {
    std::uint32_t lower, upper, spare_lower, spare_upper;

    Places(const SbvhList& list, std::uint32_t lower_count, std::uint32_t upper_count)
        : lower(lower_count), upper(upper_count) {
        const std::uint32_t both = lower + upper, spare = list.spare - (both - list.count);
        spare_lower = static_cast<std::uint32_t>(std::uint64_t{spare} * lower / both);
        spare_upper = spare - spare_lower;
    }
    [[nodiscard]] std::uint32_t upper_begin() const { return lower + spare_lower; }
};

/// Of lists that are already in `other`.
SbvhChildren children_of(const SbvhList& list, const Places& p) {
    const SbvhList a{list.other, list.at, p.lower, p.spare_lower, list.depth + 1};
    const SbvhList b{list.other + p.upper_begin(), list.at + p.upper_begin(), p.upper,
                     p.spare_upper, list.depth + 1};
    if (b.at[0].first < a.at[0].first) return {b, a};
    return {a, b};
}

Aabb box_of_lanes(const SmallBoxes& boxes, LaneSet set) {
    std::array<float, 6> least;
    least.fill(infinity);
    for (LaneSet rest = set; rest != 0; rest &= rest - 1) {
        const auto lane = static_cast<std::size_t>(std::countr_zero(rest));
        for (std::size_t c = 0; c < 6; ++c) least[c] = min_of(least[c], boxes.at[c][lane]);
    }
    return {{least[0], least[1], least[2]}, {-least[3], -least[4], -least[5]}};
}

}  // namespace

bool SbvhDivider::is_object_only(const SbvhList& list) const {
    if (list.spare == 0 || list.depth >= deepest_sbvh_split) return true;
    Aabb box = list.at[0].box();
    for (std::uint32_t k = 1; k < list.count; ++k) box = unite(box, list.at[k].box());
    return !(sah_area(box) > least_overlap_);
}

SbvhChildren SbvhDivider::divide_in_middle(const SbvhList& list) const {
    const Places places(list, list.count / 2, list.count - list.count / 2);
    std::copy_n(list.at, places.lower, list.other);
    std::copy_n(list.at + places.lower, places.upper, list.other + places.upper_begin());
    return children_of(list, places);
}

SbvhChildren SbvhDivider::divide(const SbvhList& list) {
    if (list.depth >= deepest_sbvh_split) return divide_in_middle(list);
    if (list.count > 2 && list.count <= small_boxes) return divide_few(list);
    const bool wide = width_ >= 8;
    const BinGrid grid(list.references(), options_.object_bins);
    SplitSides object;
    const auto split = find_split(list.references(), grid, wide, &object);
    if (!split) return divide_in_middle(list);
    if (choose_spatial(list, object)) return divide_by_plane(list);
    const Places places(list, split->left_boxes, list.count - split->left_boxes);
    divide_boxes(list.references(), grid, *split, list.other, places.upper_begin(), wide);
    return children_of(list, places);
}

SbvhChildren SbvhDivider::divide_few(const SbvhList& list) {
    SmallBoxes boxes{};
    for (std::uint32_t k = 0; k < list.count; ++k) boxes.set(k, list.at[k]);
    const LaneSet all = (1u << list.count) - 1, lower = split_small(boxes, all, width_);
    const auto count = static_cast<std::uint32_t>(std::popcount(lower));
    SplitSides object{0, box_of_lanes(boxes, lower), box_of_lanes(boxes, all & ~lower)};
    object.cost = sah_area(object.left) * static_cast<float>(count) +
                  sah_area(object.right) * static_cast<float>(list.count - count);
    if (choose_spatial(list, object)) return divide_by_plane(list);
    const Places places(list, count, list.count - count);
    std::array<SplitBox*, 2> to{list.other + places.upper_begin(), list.other};
    for (std::uint32_t k = 0; k < list.count; ++k) *to[lower >> k & 1]++ = list.at[k];
    return children_of(list, places);
}

bool SbvhDivider::choose_spatial(const SbvhList& list, const SplitSides& object) {
    if (list.spare == 0) return false;
    const Aabb &a = object.left, &b = object.right;
    const Aabb shared{max_of(a.lo, b.lo), min_of(a.hi, b.hi)};
    if (is_empty(shared)) return false;
    const Aabb box = unite(a, b);
    const float overlap = sah_area(shared);
    if (!(overlap > least_overlap_) || !(overlap > options_.least_own_overlap * sah_area(box)))
        return false;
    const SpatialSplit split = find_spatial_split(
        cutter_, list.references(), box, spatial_bin_count(list.count, options_.spatial_bins));
    if (!(split.cost < object.cost)) return false;
    sides_.choose(cutter_, list.references(), split);
    return sides_.left() != 0 && sides_.right() != 0 && sides_.cuts() <= list.spare;
}

SbvhChildren SbvhDivider::divide_by_plane(const SbvhList& list) const {
    const Places places(list, sides_.left(), sides_.right());
    sides_.divide(list.references(), list.other, list.other + places.upper_begin());
    return children_of(list, places);
}

}  // namespace raydix
