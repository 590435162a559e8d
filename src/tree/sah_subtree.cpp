#include "tree/sah_subtree.h"

#include <algorithm>

namespace raydix {

bool choose_spatial_split(const SpatialRules& rules, const SahReference* references,
                          std::span<const std::uint32_t> order, const SweepSplit& object,
                          std::uint32_t spare, SpatialSides& sides) {
    if (rules.cutter == nullptr || spare == 0) return false;
    GrowingBox lower, upper;
    for (std::size_t k = 0; k < order.size(); ++k)
        (k < object.left ? lower : upper).add(references[order[k]]);
    const Aabb a = lower.box(), b = upper.box();
    const Aabb shared{max_of(a.lo, b.lo), min_of(a.hi, b.hi)};
    if (is_empty(shared) || !(sah_area(shared) > rules.least_overlap)) return false;
    const SpatialSplit split = find_spatial_split(*rules.cutter, references, order, unite(a, b));
    if (!(split.cost < object.cost)) return false;
    choose_sides(*rules.cutter, references, order, split, sides);
    return sides.left_count != 0 && sides.right_count != 0 && sides.cut.size() <= spare;
}

SubtreeSum SubtreeBuild::run(const SweepLists& lists, std::uint32_t spare, std::uint32_t depth,
                             std::uint32_t* local, const SubtreeOut& out, BvhNode& root) {
    copy_in(lists, spare, local);
    out_ = out;
    pairs_ = listed_ = 0;
    const Below below = build({0, lists.n, depth, spare}, root);
    return {pairs_, listed_, below.height, below.cost};
}

void SubtreeBuild::copy_in(const SweepLists& lists, std::uint32_t spare, std::uint32_t* local) {
    const std::uint32_t n = lists.n;
    const std::size_t room = std::size_t{n} + spare;
    places_ = n;
    references_.resize(room);
    spare_.resize(room);
    areas_.resize(room);
    sides_.resize(room);
    for (auto& order : orders_) order.resize(room);
    for (std::uint32_t k = 0; k < n; ++k) {
        const std::uint32_t place = lists.orders[0][k];
        references_[k] = lists.references[place];
        local[place] = k;
        orders_[0][k] = k;
    }
    for (std::size_t axis = 1; axis < 3; ++axis)
        for (std::uint32_t k = 0; k < n; ++k) orders_[axis][k] = local[lists.orders[axis][k]];
}

SubtreeBuild::Below SubtreeBuild::build(const Range& range, BvhNode& node) {
    if (range.count() == 1) return leaf(range, node);
    const auto [left, right] = divide(range);
    const std::uint32_t pair = pairs_++, first = listed_;
    BvhNode* children = out_.nodes + 2 * std::size_t{pair};
    const Below a = build(left, children[0]), b = build(right, children[1]);
    const Aabb box = unite({children[0].lo, children[0].hi}, {children[1].lo, children[1].hi});
    const float area = sah_area(box);
    node = {box.lo, 2 * pair, box.hi, 0};
    Below below{area + (a.cost + b.cost), 1 + std::max(a.height, b.height)};
    if (range.count() > max_leaf_) return below;
    std::array<std::uint32_t, 255> ids;
    const std::uint32_t held = distinct_ids(first, ids.data());
    const float as_leaf = static_cast<float>(held) * area;
    if (as_leaf <= below.cost) {
        std::copy(ids.data(), ids.data() + held, out_.order + first);
        pairs_ = pair;
        listed_ = first + held;
        node.first = first;
        node.count = held;
        below = {as_leaf, 0};
    }
    return below;
}

SubtreeBuild::Below SubtreeBuild::leaf(const Range& range, BvhNode& node) {
    const SahReference& reference = references_[orders_[0][range.begin]];
    node = {reference.lo, listed_, reference.hi, 1};
    out_.order[listed_++] = reference.primitive_id;
    return {sah_area(reference.box()), 0};
}

SubtreeBuild::Children SubtreeBuild::divide(const Range& range) {
    SweepSplit split;
    split.left = range.count() / 2;
    if (range.count() > 2 && range.depth < deepest_sah_split) {
        SweepLists lists{references_.data(), {}, range.count()};
        for (std::uint32_t axis = 0; axis < 3; ++axis)
            lists.orders[axis] = order_of(range, axis).data();
        split = find_sweep_split(lists, areas_.data());
        if (choose_spatial_split(rules_, references_.data(), order_of(range, split.axis), split,
                                 range.spare, spatial_))
            return divide_by_plane(range, split.axis);
    }
    return divide_by_order(range, split);
}

SubtreeBuild::Children SubtreeBuild::children_of(const Range& range, std::uint32_t left,
                                                 std::uint32_t right) {
    const std::uint32_t spare = range.spare - (left + right - range.count());
    const std::uint32_t spare_left = share_of(spare, left, left + right);
    const std::uint32_t middle = range.begin + right, depth = range.depth + 1;
    return {{middle, middle + left, depth, spare_left},
            {range.begin, middle, depth, spare - spare_left}};
}

bool SubtreeBuild::mark_left(const Range& range, const SweepSplit& split) {
    const std::span<const std::uint32_t> order = order_of(range, split.axis);
    std::array<std::uint32_t, 2> least{UINT32_MAX, UINT32_MAX};
    for (std::size_t k = 0; k < order.size(); ++k) {
        std::uint32_t& id = least[k < split.left ? 0 : 1];
        id = std::min(id, references_[order[k]].primitive_id);
    }
    const bool upper_is_left = least[1] < least[0];
    for (std::size_t k = 0; k < order.size(); ++k)
        sides_[order[k]] = (k < split.left) != upper_is_left ? 1 : 0;
    return upper_is_left;
}

SubtreeBuild::Children SubtreeBuild::divide_by_order(const Range& range, const SweepSplit& split) {
    const bool upper_is_left = mark_left(range, split);
    std::uint32_t* spare = spare_.data();
    for (std::uint32_t axis = 0; axis < 3; ++axis) {
        if (axis == split.axis && upper_is_left) continue;
        std::uint32_t* order = orders_[axis].data();
        std::uint32_t right = range.begin, left = 0;
        for (std::uint32_t k = range.begin; k < range.end; ++k) {
            const std::uint32_t place = order[k], is_left = sides_[place];
            order[right] = place;
            spare[left] = place;
            right += 1 - is_left;
            left += is_left;
        }
        std::copy(spare, spare + left, order + right);
    }
    const std::uint32_t left = upper_is_left ? range.count() - split.left : split.left;
    return children_of(range, left, range.count() - left);
}

SubtreeBuild::Children SubtreeBuild::divide_by_plane(const Range& range,
                                                     std::uint32_t axis_of_sides) {
    side_lists_.cut(references_.data(), order_of(range, axis_of_sides), spatial_, places_,
                    sides_.data());
    places_ += static_cast<std::uint32_t>(spatial_.cut.size());
    SpatialSides::Side left = SpatialSides::left, right = SpatialSides::right;
    std::uint32_t left_count = spatial_.left_count, right_count = spatial_.right_count;
    if (side_lists_.right_is_least()) {
        std::swap(left, right);
        std::swap(left_count, right_count);
    }
    for (std::uint32_t axis = 0; axis < 3; ++axis) {
        std::uint32_t* out = spare_.data();
        for (const SpatialSides::Side side : {right, left})
            out = side_lists_.list(references_.data(), order_of(range, axis), sides_.data(), side,
                                   axis, out);
        std::copy(spare_.data(), out, orders_[axis].data() + range.begin);
    }
    return children_of(range, left_count, right_count);
}

std::uint32_t SubtreeBuild::distinct_ids(std::uint32_t begin, std::uint32_t* ids) const {
    std::uint32_t* end = std::copy(out_.order + begin, out_.order + listed_, ids);
    std::sort(ids, end);
    return static_cast<std::uint32_t>(std::unique(ids, end) - ids);
}

}  // namespace raydix
