// What walks read of a tree in double (BvhD): float nodes around a center, corners in double.
#pragma once

#include <raydix/double.h>

#include <cstdint>

#include "primitives/double_sources.h"
#include "trace/tree_hits.h"

namespace raydix {

/// Where the nodes are: p of the scene is at local(p), rounded.
struct TreeSpace {
    Vec3d center;
    double scale;

    [[nodiscard]] Vec3d local(Vec3d p) const { return scale * (p - center); }
    /// The ray where the nodes are, with the same t. For boxes only: its origin is rounded.
    [[nodiscard]] RayFrameD local(const RayFrameD& ray) const {
        RayFrameD moved = ray;
        moved.origin = local(ray.origin);
        moved.inverse = ray.inverse * (1.0 / scale);
        return moved;
    }
};

struct TriangleTreeD {
    using Scalar = double;
    using Corners = LeafTriangleD;

    const BvhNode* nodes;
    const LeafTriangleD* triangles;
    const std::uint32_t* order;
    std::uint32_t max_depth;
    bool empty;
    TreeSpace space;

    explicit TriangleTreeD(const BvhD& bvh)
        : nodes(bvh.tree().nodes().data()),
          triangles(bvh.triangles().data()),
          order(bvh.order().data()),
          max_depth(bvh.max_depth()),
          empty(bvh.empty()),
          space{bvh.center(), bvh.scale()} {}

    [[nodiscard]] RayFrameD local(const RayFrameD& ray) const { return space.local(ray); }
};

}  // namespace raydix
