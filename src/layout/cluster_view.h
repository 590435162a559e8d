// A cluster tree of triangles as the collapse to wide nodes sees it: what place_clusters() would
// make a leaf of the binary tree is one here, with its primitives in the same order.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/prefetch.h"
#include "layout/binary_view.h"
#include "layout/leaf_order.h"
#include "tree/place_clusters.h"

namespace raydix {

class ClusterView {
public:
    using Ref = ClusterRef;

    /// `flat` [n] in Morton order: 1 for triangles without area.
    ClusterView(const ClusterTree& tree, const TriangleSource& source, const std::uint8_t* flat)
        : tree_(tree), source_(source), flat_(flat) {}

    [[nodiscard]] Ref root() const { return tree_.root; }
    [[nodiscard]] bool is_leaf(Ref ref) const {
        return is_primitive(ref) || tree_.nodes[ref].sum.inner == 0;
    }
    [[nodiscard]] Aabb box(Ref ref) const {
        if (is_primitive(ref)) return tree_.primitives.get(ref & ~primitive_cluster);
        return {tree_.nodes[ref].lo, tree_.nodes[ref].hi};
    }
    [[nodiscard]] std::array<Ref, 2> children(Ref inner) const {
        return {tree_.nodes[inner].left, tree_.nodes[inner].right};
    }
    RAYDIX_PREFETCHING void prefetch(Ref inner) const {
        for (const Ref child : children(inner))
            if (!is_primitive(child)) __builtin_prefetch(&tree_.nodes[child]);
    }
    [[nodiscard]] std::uint32_t size(Ref ref) const { return run(ref).count; }
    [[nodiscard]] PrimitiveRun run(Ref ref) const {
        return {0, is_primitive(ref) ? 1 : tree_.nodes[ref].sum.count};
    }
    /// A subtree's primitives can always be listed: where they lie does not matter.
    [[nodiscard]] static PrimitiveRun join(PrimitiveRun a, PrimitiveRun b) {
        return {0, a.count + b.count};
    }

    /// Appends the places of a leaf's primitives in Morton order, ascending by id.
    void list_primitives(Ref leaf, std::vector<std::uint32_t>& places) const {
        if (is_primitive(leaf)) return places.push_back(leaf & ~primitive_cluster);
        const auto begin = static_cast<std::ptrdiff_t>(places.size());
        list(leaf, places);
        // A few that are nearly in order.
        for (auto at = places.begin() + begin; at != places.end(); ++at)
            for (auto k = at; k != places.begin() + begin && id(*(k - 1)) > id(*k); --k)
                std::iter_swap(k - 1, k);
    }
    [[nodiscard]] bool is_flat(std::uint32_t place) const { return flat_[place] != 0; }
    [[nodiscard]] std::uint32_t id(std::uint32_t place) const { return tree_.ids[place]; }
    [[nodiscard]] LeafTriangle triangle(std::uint32_t place) const {
        return copy_primitive(source_, tree_.ids[place]);
    }
    [[nodiscard]] std::array<std::uint32_t, 3> corners(std::uint32_t place) const {
        return source_.triangles[tree_.ids[place]];
    }
    [[nodiscard]] std::size_t vertex_count() const { return source_.vertex_count; }
    [[nodiscard]] Vec3 vertex(std::uint32_t number) const {
        return without_negative_zero(source_.vertices[number]);
    }
    RAYDIX_PREFETCHING void prefetch_indices(std::uint32_t place) const {
        raydix::prefetch_indices(source_, tree_.ids[place]);
    }
    RAYDIX_PREFETCHING void prefetch_corners(std::uint32_t place) const {
        raydix::prefetch_corners(source_, tree_.ids[place]);
    }

private:
    void list(Ref ref, std::vector<std::uint32_t>& places) const {
        if (is_primitive(ref)) return places.push_back(ref & ~primitive_cluster);
        list(tree_.nodes[ref].left, places);
        list(tree_.nodes[ref].right, places);
    }

    ClusterTree tree_;
    TriangleSource source_;
    const std::uint8_t* flat_;
};

}  // namespace raydix
