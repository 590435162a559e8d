// Boxes of what stands in a scene in double -> float boxes around a center -> a float tree, as for
// triangles in double; and when rays enter its nodes.
#pragma once

#include <raydix/bvh.h>

#include <vector>

#include "instances/affine_double.h"
#include "trace/double_tree.h"
#include "trace/grown_boxes.h"

namespace raydix {

inline constexpr AabbD nothing_d{{infinity, infinity, infinity}, {-infinity, -infinity, -infinity}};

[[nodiscard]] inline bool is_empty(const ExtentD& extent) {
    return extent.box.lo.x > extent.box.hi.x;
}
[[nodiscard]] bool in_range(const ExtentD& extent);
/// Of triangles in `box`: at t the ray is as near to the triangle as slab.h says, twice over.
[[nodiscard]] inline ExtentD extent_of_triangles(const AabbD& box) { return {box, 0x1p-46}; }

/// The nodes are as those of BvhD; a leaf's primitives are places in `extents`.
struct InstanceTreeD {
    std::vector<ExtentD> extents;
    std::vector<Aabb> boxes;
    Bvh bvh;
    TreeSpace space{{0.0, 0.0, 0.0}, 1.0};
    ExtentD around{nothing_d, 0.0};

    /// From the extents; those that are empty are left out, the others must be in range.
    void build(BvhBuilder& builder, const BuildOptions& options);
};

/// When a ray enters the nodes of a tree: not later than it hits anything in them, in units of
/// `frame`.
class InstanceNodesD {
public:
    /// The tree must not be empty.
    InstanceNodesD(const InstanceTreeD& tree, const RayD& ray, const RayFrameD& frame)
        : boxes_(path_of(tree.space, ray, frame), room(tree, tree.space.local(frame.origin))) {}

    [[nodiscard]] double enter(const BvhNode& node) const {
        return boxes_.enter(node.lo, node.hi) * (1.0 - 1e-12);
    }

private:
    static Path path_of(const TreeSpace& space, const RayD& ray, const RayFrameD& frame) {
        return {Double3(space.local(frame.origin)),
                Double3((frame.t_scale * space.scale) * ray.direction), frame.tmin, frame.tmax};
    }
    /// What ExtentD has it, and the roundings of the origin and of differences from it.
    static double room(const InstanceTreeD& tree, Vec3d origin);

    GrownBoxes boxes_;
};

}  // namespace raydix
