// Generalized winding numbers (Jacobson, Kavan, Sorkine-Hornung 2013): the solid angles of all
// triangles, those of far subtrees from two terms of their expansion (Barill, Dickson, Schmidt,
// Levin, Jacobson 2018, section 3).
#pragma once

#include <raydix/bvh.h>

#include <span>
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

/// Corners and queries where the nodes are.
struct LocalCorners {
    Double3 a, b, c;
};
inline LocalCorners local_corners(const TriangleTree& tree, std::uint32_t k) {
    const LeafTriangle& t = tree.triangles[k];
    return {Double3(t.v0), Double3(t.v1), Double3(t.v2)};
}
inline LocalCorners local_corners(const TriangleTreeD& tree, std::uint32_t k) {
    const LeafTriangleD& t = tree.triangles[k];
    const auto local = [&](Vec3d p) { return Double3(tree.space.local(p)); };
    return {local(t.v0), local(t.v1), local(t.v2)};
}
inline Double3 local_place(const TriangleTree&, Vec3 p) { return Double3(p); }
inline Double3 local_place(const TriangleTreeD& tree, Vec3d p) {
    return Double3(tree.space.local(p));
}

class WindingTree {
public:
    /// Each triangle must be in one leaf only. Tree: TriangleTree or TriangleTreeD, of `nodes`.
    template <class Tree>
    WindingTree(const Tree& tree, std::span<const BvhNode> nodes);
    /// `query` finite, the tree not empty.
    template <class Tree, class Vec>
    [[nodiscard]] double at(const Tree& tree, Vec query,
                            BasicWalkStack<typename Tree::Scalar>& stack) const;

private:
    std::vector<FarTriangles> far_;  // a slot each
};

/// Solid angle of one triangle as part of the sphere (Van Oosterom, Strackee 1983); positive if the
/// query is behind it. 0 in its plane.
[[nodiscard]] double triangle_winding(const LocalCorners& t, Double3 query);
[[nodiscard]] double triangle_winding(const LeafTriangle& t, Vec3 query);

}  // namespace raydix
