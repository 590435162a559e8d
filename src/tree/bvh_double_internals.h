// The one door to the private members of a BvhD, for those who make one.
#pragma once

#include <raydix/double.h>

#include "tree/around_center.h"
#include "tree/median_center.h"

namespace raydix {

struct BvhDInternals {
    BvhD& bvh;

    [[nodiscard]] Bvh& tree() const { return bvh.tree_; }
    [[nodiscard]] Buffer<LeafTriangleD>& triangles() const { return bvh.triangles_; }
    [[nodiscard]] Vec3d& center() const { return bvh.center_; }
    [[nodiscard]] double& scale() const { return bvh.scale_; }
    [[nodiscard]] AabbD& bounds() const { return bvh.bounds_; }
    [[nodiscard]] BuildMs& build_ms() const { return bvh.build_ms_; }

    void place(const AabbD& box, Vec3d at) const {
        bounds() = box;
        center() = at;
        scale() = scale_around(at, box);
    }
    /// The float box where the nodes are.
    [[nodiscard]] Aabb local(const AabbD& box) const {
        return box_around_center(box, center(), scale());
    }
};

}  // namespace raydix
