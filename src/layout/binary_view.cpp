#include "layout/binary_view.h"

#include <raydix/error.h>

#include <algorithm>

#include "layout/leaf_copies.h"
#include "layout/weld.h"

namespace raydix {
namespace {

/// Box of some primitives in leaf order, within that of the leaf which held them: a builder that
/// splits primitives made the leaf's box smaller than theirs.
Aabb part_box(const Bvh& bvh, const BvhNode& leaf, std::uint32_t first, std::uint32_t count) {
    Aabb box;
    switch (bvh.kind()) {
        case PrimitiveKind::triangles:
            box = BoxOfLeaf<LeafTriangle>{bvh.triangles().data()}(first, count);
            break;
        case PrimitiveKind::boxes:
            box = BoxOfLeaf<Aabb>{bvh.boxes().data()}(first, count);
            break;
        case PrimitiveKind::points:
            box = BoxOfLeaf<Vec3>{bvh.points().data()}(first, count);
            break;
    }
    return {max_of(box.lo, leaf.lo), min_of(box.hi, leaf.hi)};
}

}  // namespace

BinaryView::BinaryView(const Bvh& bvh, std::uint32_t max_leaf) : bvh_(bvh), nodes_(bvh.nodes()) {
    const auto too_large = [&](const BvhNode& n) { return n.count > max_leaf; };
    if (std::ranges::none_of(nodes_, too_large)) return;
    own_.assign(nodes_.begin(), nodes_.end());
    for (std::size_t slot = 0; slot < own_.size(); ++slot)  // new ones are met later on
        if (too_large(own_[slot])) divide(slot);
    nodes_ = own_;
}

void BinaryView::weld() {
    const std::size_t count = 3 * bvh_.triangles().size();
    if (count > ~std::uint32_t{0})
        throw InputError("a compact tree holds 1431655765 triangle references at most");
    corners_ = raydix::weld(count, [&](std::size_t k) { return corner(k); });
}

std::uint32_t BinaryView::size(Ref ref) const {
    Ref first = ref, last = ref;
    while (!is_leaf(first)) first = children(first)[0];
    while (!is_leaf(last)) last = children(last)[1];
    const auto [a, b] = std::minmax({nodes_[first].first, nodes_[last].first});
    return b - a + nodes_[b == nodes_[last].first ? last : first].count;
}

void BinaryView::divide(std::size_t slot) {
    const BvhNode leaf = own_[slot];
    const std::uint32_t half = leaf.count - leaf.count / 2;
    const auto add = [&](std::uint32_t first, std::uint32_t count) {
        const Aabb box = part_box(bvh_, leaf, first, count);
        own_.push_back({box.lo, first, box.hi, count});
    };
    own_[slot].first = static_cast<std::uint32_t>(own_.size());
    own_[slot].count = 0;
    add(leaf.first, half);
    add(leaf.first + half, leaf.count - half);
}

}  // namespace raydix
