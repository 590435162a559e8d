// The way into a BvhBuilder for those who want its clusters instead of a finished tree, and for
// boxes around triangles that it may cut.
#pragma once

#include <raydix/bvh.h>

#include <cstdint>
#include <functional>
#include <span>

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

struct BvhBuilderInternals {
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
