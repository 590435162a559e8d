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
    const std::uint32_t count = range.end - range.begin;
    if (count == 1) return leaf(range, node);
    const std::uint32_t middle = divide(range);
    Range left{range.begin, middle, range.depth + 1}, right{middle, range.end, range.depth + 1};
    if (upper_is_left(range, middle)) std::swap(left, right);

    const std::uint32_t pair = pairs_++, first = listed_;
    BvhNode* children = out_.nodes + 2 * std::size_t{pair};
    const Below a = build(left, children[0]), b = build(right, children[1]);
    const Aabb box = unite({children[0].lo, children[0].hi}, {children[1].lo, children[1].hi});
    const float area = sah_area(box);
    node = {box.lo, 2 * pair, box.hi, 0};
    Below below{area + (a.cost + b.cost), 1 + std::max(a.height, b.height)};
    if (count > max_leaf_) return below;
    const std::uint32_t held = distinct_ids(first);
    const float as_leaf = static_cast<float>(held) * area;
    if (as_leaf <= below.cost) {
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

std::uint32_t SubtreeBuild::divide(const Range& range) {
    const std::uint32_t count = range.end - range.begin;
    if (count == 2) {
        // Either way there is one on each side; the orders of the others no longer matter.
        return range.begin + 1;
    }
    SweepSplit split;
    if (range.depth < deepest_sah_split) {
        SweepLists lists{references_.data(), {}, count};
        for (std::size_t axis = 0; axis < 3; ++axis)
            lists.orders[axis] = orders_[axis].data() + range.begin;
        split = find_sweep_split(lists, areas_.data());
    } else {
        split.left = count / 2;
    }
    partition(range, split.axis, range.begin + split.left);
    return range.begin + split.left;
}

void SubtreeBuild::partition(const Range& range, std::uint32_t axis, std::uint32_t middle) {
    const std::uint32_t* chosen = orders_[axis].data();
    for (std::uint32_t k = range.begin; k < middle; ++k) sides_[chosen[k]] = 0;
    for (std::uint32_t k = middle; k < range.end; ++k) sides_[chosen[k]] = 1;
    std::uint32_t* spare = spare_.data();
    for (std::uint32_t other = 0; other < 3; ++other) {
        if (other == axis) continue;
        std::uint32_t* order = orders_[other].data();
        std::uint32_t lower = range.begin, upper = 0;
        for (std::uint32_t k = range.begin; k < range.end; ++k) {
            const std::uint32_t place = order[k], side = sides_[place];
            order[lower] = place;
            spare[upper] = place;
            lower += 1 - side;
            upper += side;
        }
        std::copy(spare, spare + upper, order + lower);
    }
}

bool SubtreeBuild::upper_is_left(const Range& range, std::uint32_t middle) const {
    const auto least = [&](std::uint32_t begin, std::uint32_t end) {
        std::uint32_t id = references_[orders_[0][begin]].primitive_id;
        for (std::uint32_t k = begin + 1; k < end; ++k)
            id = std::min(id, references_[orders_[0][k]].primitive_id);
        return id;
    };
    return least(middle, range.end) < least(range.begin, middle);
}

std::uint32_t SubtreeBuild::distinct_ids(std::uint32_t begin) {
    std::uint32_t *first = out_.order + begin, *last = out_.order + listed_;
    std::sort(first, last);
    return static_cast<std::uint32_t>(std::unique(first, last) - first);
}

}  // namespace raydix
