// Generalized winding numbers (Jacobson, Kavan, Sorkine-Hornung 2013): the solid angles of all
// triangles, those of far subtrees from two terms of their expansion (Barill, Dickson, Schmidt,
// Levin, Jacobson 2018, section 3).
#pragma once

#include <raydix/bvh.h>

#include <vector>

#include "base/double3.h"
#include "proximity/closest_walk.h"

namespace raydix {

/// What a subtree looks like from afar.
struct FarTriangles {
    Double3 center;                        // of its area
    double radius = 0;                     // around `center`, of the subtree's box
    Double3 normal;                        // sum of normals times areas
    Double3 moment_x, moment_y, moment_z;  // sum of (x - center) times the same, a row each
};

class WindingTree {
public:
    /// Each triangle must be in one leaf only.
    explicit WindingTree(const Bvh& bvh);
    /// `query` finite, the tree not empty.
    [[nodiscard]] double at(const TriangleTree& tree, Vec3 query, WalkStack& stack) const;

private:
    std::vector<FarTriangles> far_;  // a slot each
};

/// Solid angle of one triangle as part of the sphere (Van Oosterom, Strackee 1983); positive if the
/// query is behind it. 0 in its plane.
[[nodiscard]] double triangle_winding(const LeafTriangle& t, Vec3 query);

}  // namespace raydix
