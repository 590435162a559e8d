#include "tree/sah_subtree.h"

#include <algorithm>

namespace raydix {

SubtreeSum SubtreeBuild::run(const SweepLists& lists, std::uint32_t depth, std::uint32_t* local,
                             const SubtreeOut& out, BvhNode& root) {
    copy_in(lists, local);
    out_ = out;
    pairs_ = listed_ = 0;
    const Below below = build({0, lists.n, depth}, root);
    return {pairs_, listed_, below.height, below.cost};
}

void SubtreeBuild::copy_in(const SweepLists& lists, std::uint32_t* local) {
    const std::uint32_t n = lists.n;
    references_.resize(n);
    spare_.resize(n);
    areas_.resize(n);
    sides_.resize(n);
    for (auto& order : orders_) order.resize(n);
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
    }
    return divide_by_order(range, split);
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
    const std::uint32_t middle = range.end - left, depth = range.depth + 1;
    return {{middle, range.end, depth}, {range.begin, middle, depth}};
}

std::uint32_t SubtreeBuild::distinct_ids(std::uint32_t begin, std::uint32_t* ids) const {
    std::uint32_t* end = std::copy(out_.order + begin, out_.order + listed_, ids);
    std::sort(ids, end);
    return static_cast<std::uint32_t>(std::unique(ids, end) - ids);
}

}  // namespace raydix
