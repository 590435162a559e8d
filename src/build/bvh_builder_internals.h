// The way into a BvhBuilder for those who want its clusters instead of a finished tree, and for
// boxes around triangles that it may cut.
#pragma once

#include <raydix/bvh.h>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>

#include "layout/sorted_part.h"
#include "primitives/sources.h"
#include "tree/place_clusters.h"
#include "tree/triangle_corners.h"

namespace raydix {

/// Whether its trees are cluster trees at first.
[[nodiscard]] constexpr bool grows_clusters(Builder builder) {
    return builder == Builder::ploc || builder == Builder::hploc || builder == Builder::binned;
}

/// `flat` [n] in Morton order: 1 for triangles without area.
using TakeClusters = std::function<void(const ClusterTree& clusters, const TriangleSource& source,
                                        const std::uint8_t* flat)>;

/// Who wants triangles in the order of their codes instead of a tree.
struct SortedTaker {
    /// Memory for the sort, of so many triangles and at least so many bytes; it is not used any
    /// more when `take` is called.
    std::function<std::span<std::byte>(std::size_t triangles, std::size_t bytes)> memory;
    std::function<void(const SortedTriangles& triangles)> take;
};

struct BvhBuilderInternals {
    /// As build() by apetrei, but the triangles that have an area go to `take`, sorted; `tree` is
    /// as from build_clusters. Without one `take` is not called. mesh has triangles.
    static void sort(BvhBuilder& builder, const MeshView& mesh, const BuildOptions& options,
                     Bvh& tree, const SortedTaker& take);
    /// As build(), but the clusters of a builder that grows some go to `take`, inside of which
    /// loops have the threads of `options`; `tree` then has no nodes, only figures: input_count,
    /// left_out, build_ms (fit is the time of `take`, layout 0) and peak_bytes. Without a valid
    /// triangle `take` is not called. mesh has triangles.
    static void build_clusters(BvhBuilder& builder, const MeshView& mesh,
                               const BuildOptions& options, Bvh& tree, const TakeClusters& take);
    /// As build() over boxes, each around the triangle of the same number: builders that cut cut
    /// those.
    static void build_around(BvhBuilder& builder, std::span<const Aabb> boxes,
                             const TriangleCorners& corners, const BuildOptions& options,
                             Bvh& tree);
};

}  // namespace raydix
