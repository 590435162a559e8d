// A cluster tree of triangles as the collapse to wide nodes sees it: what place_clusters() would
// make a leaf of the binary tree is one here, with its primitives in the same order.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "base/prefetch.h"
#include "layout/binary_view.h"
#include "layout/leaf_order.h"
#include "layout/weld.h"
#include "layout/wide_bvh.h"
#include "tree/place_clusters.h"

namespace raydix {

class ClusterView {
public:
    using Ref = ClusterRef;

    /// `flat` [n] in Morton order: 1 for triangles without area.
    ClusterView(const ClusterTree& tree, const TriangleSource& source, const std::uint8_t* flat)
        : tree_(tree), source_(source), flat_(flat) {}

    /// Gives equal corners one number, for corners() and vertex().
    void weld() {
        same_ = raydix::weld(source_.vertex_count,
                             [&](std::size_t v) { return vertex(static_cast<std::uint32_t>(v)); });
    }

    [[nodiscard]] Ref root() const { return tree_.root; }
    [[nodiscard]] bool is_leaf(Ref ref) const {
        return is_primitive(ref) || tree_.nodes[ref].sum.inner == 0;
    }
    [[nodiscard]] Aabb box(Ref ref) const {
        if (is_primitive(ref)) return tree_.primitives.get(ref & ~primitive_cluster);
        return {tree_.nodes[ref].lo, tree_.nodes[ref].hi};
    }
    [[nodiscard]] Vec3 middle() const { return center_of(box(root())); }
    [[nodiscard]] std::array<Ref, 2> children(Ref inner) const {
        return {tree_.nodes[inner].left, tree_.nodes[inner].right};
    }
    /// What lies below `ref` will be asked for.
    RAYDIX_PREFETCHING void prefetch(Ref ref) const {
        if (is_primitive(ref)) return;
        for (const Ref child : children(ref))
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

    /// Calls take(place) for a leaf's primitives, places in Morton order, ascending by id.
    template <class Take>
    void for_each_primitive(Ref leaf, const Take& take) const {
        if (is_primitive(leaf)) return take(leaf & ~primitive_cluster);
        // A few that are nearly in order.
        std::array<std::uint32_t, most_in_leaf> places;
        const std::size_t count = list(leaf, places, 0);
        for (std::size_t at = 1; at < count; ++at)
            for (std::size_t k = at; k > 0 && id(places[k - 1]) > id(places[k]); --k)
                std::swap(places[k - 1], places[k]);
        std::for_each_n(places.begin(), count, take);
    }
    [[nodiscard]] bool is_flat(std::uint32_t place) const { return flat_[place] != 0; }
    [[nodiscard]] std::uint32_t id(std::uint32_t place) const { return tree_.ids[place]; }
    [[nodiscard]] LeafTriangle triangle(std::uint32_t place) const {
        return copy_primitive(source_, tree_.ids[place]);
    }
    [[nodiscard]] std::array<std::uint32_t, 3> corners(std::uint32_t place) const {
        const Triangle& t = source_.triangles[tree_.ids[place]];
        return {same_[t[0]], same_[t[1]], same_[t[2]]};
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
    /// Of the builders' options, for trees that become wide.
    static constexpr std::size_t most_in_leaf = wide_max_leaf;

    std::size_t list(Ref ref, std::array<std::uint32_t, most_in_leaf>& places,
                     std::size_t count) const {
        if (is_primitive(ref)) {
            places[count] = ref & ~primitive_cluster;
            return count + 1;
        }
        return list(tree_.nodes[ref].right, places, list(tree_.nodes[ref].left, places, count));
    }

    ClusterTree tree_;
    TriangleSource source_;
    const std::uint8_t* flat_;
    std::vector<std::uint32_t> same_;  // [vertices], once welded
};

}  // namespace raydix
