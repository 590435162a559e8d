// A binary tree as the collapse to wide nodes sees it: a finished Bvh, by the slots of its nodes.
// cluster_view.h is the other view, of a tree that is not finished yet.
#pragma once

#include <raydix/bvh.h>

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "base/math.h"
#include "base/prefetch.h"
#include "primitives/zero_area.h"

namespace raydix {

/// Primitives below a node. In one run of the tree's order, as in all trees that builders make, or
/// in several: then there is no first one.
struct PrimitiveRun {
    static constexpr std::uint32_t several = ~std::uint32_t{0};
    std::uint32_t first, count;
};

/// Leaves of more than `max_leaf` primitives are divided in halves of their order until none is
/// left. The tree must not be empty.
class BinaryView {
public:
    using Ref = std::uint32_t;  // slot

    BinaryView(const Bvh& bvh, std::uint32_t max_leaf);

    /// Of triangles: gives equal corners one number, for corners() and vertex().
    void weld();

    [[nodiscard]] Ref root() const { return 0; }
    [[nodiscard]] bool is_leaf(Ref ref) const { return nodes_[ref].is_leaf(); }
    [[nodiscard]] Aabb box(Ref ref) const { return {nodes_[ref].lo, nodes_[ref].hi}; }
    /// What planes of wide nodes are about.
    [[nodiscard]] Vec3 middle() const { return center_of(box(root())); }
    [[nodiscard]] std::array<Ref, 2> children(Ref inner) const {
        const std::uint32_t pair = nodes_[inner].first;
        return {pair, pair + 1};
    }
    void prefetch(Ref) const {}
    /// About how many primitives are below: what lies between its first leaf and its last in the
    /// tree's order.
    [[nodiscard]] std::uint32_t size(Ref ref) const;
    [[nodiscard]] PrimitiveRun run(Ref leaf) const {
        return {nodes_[leaf].first, nodes_[leaf].count};
    }
    [[nodiscard]] static PrimitiveRun join(PrimitiveRun a, PrimitiveRun b) {
        const std::uint32_t count = a.count + b.count;
        if (a.first != PrimitiveRun::several && b.first != PrimitiveRun::several) {
            if (a.first + a.count == b.first) return {a.first, count};
            if (b.first + b.count == a.first) return {b.first, count};
        }
        return {PrimitiveRun::several, count};
    }

    /// Calls take(position) for a leaf's primitives in the tree's order.
    template <class Take>
    void for_each_primitive(Ref leaf, const Take& take) const {
        const auto [first, count] = run(leaf);
        for (std::uint32_t k = first; k < first + count; ++k) take(k);
    }
    [[nodiscard]] bool is_flat(std::uint32_t position) const {
        return has_zero_area(bvh_.triangles()[position]);
    }
    [[nodiscard]] std::uint32_t id(std::uint32_t position) const { return bvh_.order()[position]; }
    [[nodiscard]] LeafTriangle triangle(std::uint32_t position) const {
        return bvh_.triangles()[position];
    }
    [[nodiscard]] std::array<std::uint32_t, 3> corners(std::uint32_t position) const {
        const std::size_t first = 3 * std::size_t{position};
        return {corners_[first], corners_[first + 1], corners_[first + 2]};
    }
    [[nodiscard]] std::size_t vertex_count() const { return corners_.size(); }
    [[nodiscard]] Vec3 vertex(std::uint32_t number) const { return corner(number); }
    void prefetch_indices(std::uint32_t) const {}
    RAYDIX_PREFETCHING void prefetch_corners(std::uint32_t position) const {
        __builtin_prefetch(&bvh_.triangles()[position]);
    }

private:
    void divide(std::size_t slot);
    [[nodiscard]] Vec3 corner(std::size_t k) const {
        const LeafTriangle& t = bvh_.triangles()[k / 3];
        return k % 3 == 0 ? t.v0 : k % 3 == 1 ? t.v1 : t.v2;
    }

    const Bvh& bvh_;
    std::span<const BvhNode> nodes_;
    std::vector<BvhNode> own_;  // new pairs of children stand behind the old nodes
    std::vector<std::uint32_t> corners_;
};

}  // namespace raydix
