// Meshes that share a tree: the triangles that it counts through -> meshes and triangles of theirs.
#pragma once

#include <algorithm>
#include <boost/container/small_vector.hpp>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace raydix {

/// A number a mesh. Most groups are one mesh, and there may be many of them: its number takes no
/// memory of its own.
using NumberAMesh = boost::container::small_vector<std::uint32_t, 1>;

/// One mesh or several, which follow each other by id.
struct GroupedMeshes {
    NumberAMesh ids;    // [meshes] ascending
    NumberAMesh first;  // [meshes]: the first triangle of each in the tree's counting
    // bucket[i]: the mesh of triangle i << shift; one more, the last mesh, behind them. Of several
    // meshes.
    std::vector<std::uint32_t> bucket;
    std::uint32_t shift = 0;
    std::uint32_t mask = 0;  // of all of them
    std::uint64_t triangles = 0;
    std::uint64_t left_out = 0;  // of them: not finite, or out of range
    double sah_at_build = 0;     // of the tree that this one was refitted from, or of itself

    /// When `first` and `triangles` are known: about two buckets a mesh.
    void make_buckets() {
        if (first.size() == 1) return;
        while ((triangles >> shift) > 2 * first.size()) ++shift;
        bucket.clear();
        for (std::uint64_t prim = 0; prim < triangles; prim += std::uint64_t{1} << shift)
            bucket.push_back(static_cast<std::uint32_t>(
                std::upper_bound(first.begin(), first.end(), prim) - first.begin() - 1));
        bucket.push_back(static_cast<std::uint32_t>(first.size() - 1));
    }

    /// Triangle `prim` of the tree: the mesh that it belongs to, by its place.
    [[nodiscard]] std::size_t mesh_of(std::uint32_t prim) const {
        if (first.size() == 1) return 0;
        const std::uint32_t b = prim >> shift;
        std::size_t m = bucket[b];
        const std::size_t last = bucket[b + 1];
        if (last - m <= 2) {
            while (m < last && first[m + 1] <= prim) ++m;
            return m;
        }
        const auto begin = first.begin() + static_cast<std::ptrdiff_t>(m) + 1,
                   end = first.begin() + static_cast<std::ptrdiff_t>(last) + 1;
        return static_cast<std::size_t>(std::upper_bound(begin, end, prim) - first.begin()) - 1;
    }
    /// Gives a hit of the tree its mesh.
    template <class AnyHit>
    void name(AnyHit& hit) const {
        const std::size_t m = mesh_of(hit.prim);
        hit.geometry = ids[m];
        hit.prim -= first[m];
    }
};

}  // namespace raydix
