// How often a mesh is crossed on the way from a point to infinity along +x, without any rounding:
// for a closed mesh its winding number around the point.
//
// The line is moved by an infinitesimal step along z and a smaller one along y, so that it meets no
// edge and no vertex: an edge counts where it starts at or below the point in z and ends above it,
// and a point on an edge counts as right of it. Both triangles of an edge see the same edge from
// its lower end to its upper, so their answers fit. Whether the crossing is before or behind the
// point is the side of the triangle's plane on which the point lies.
//
// Vec: Vec3 or Vec3d; Corners: LeafTriangle or LeafTriangleD.
#pragma once

#include <raydix/bvh.h>
#include <raydix/types.h>

#include "primitives/exact_overlap.h"
#include "proximity/closest_walk.h"
#include "trace/walk.h"
#include "tree/around_center.h"

#if defined(__SSE4_1__)
#include <smmintrin.h>
#endif

namespace raydix {

struct Crossings {
    std::int64_t winding = 0;  // crossings from inside to outside less the others
    std::uint64_t count = 0;
    bool on_surface = false;  // the point is on a triangle; the numbers mean nothing then
};

/// What an edge adds to the winding number of a triangle's projection around the moved point.
template <class Vec>
RAYDIX_HD inline int edge_cover(Vec from, Vec to, Vec p) {
    const bool upward = to.z > p.z;
    if ((from.z > p.z) == upward) return 0;
    const Vec low = upward ? from : to, high = upward ? to : from;
    const bool left = turn_sign(drop_axis(low, 0), drop_axis(high, 0), drop_axis(p, 0)) > 0;
    return left ? (upward ? 1 : -1) : 0;
}

/// 1 or -1 if the moved line goes through the triangle, out of its front or into it; else 0.
template <class Corners, class Vec>
RAYDIX_HD inline int line_cover(const Corners& t, Vec p) {
    return edge_cover(t.v0, t.v1, p) + edge_cover(t.v1, t.v2, p) + edge_cover(t.v2, t.v0, p);
}

template <class Corners, class Vec>
RAYDIX_HD inline void add_crossing(const Corners& t, Vec p, Crossings& sum) {
    const auto box = box_of(t.v0, t.v1, t.v2);
    if (box.hi.x < p.x || p.y < box.lo.y || p.y > box.hi.y || p.z < box.lo.z || p.z > box.hi.z)
        return;
    const int cover = line_cover(t, p);
    const bool in_box = box.lo.x <= p.x;
    if (cover == 0) {
        if (in_box && point_on_triangle(p, t)) sum.on_surface = true;
        return;
    }
    const int side = in_box ? side_of_plane(t.v0, t.v1, t.v2, p) : -cover;
    if (side == 0) {
        sum.on_surface = true;
    } else if (side == -cover) {
        sum.winding += cover;
        ++sum.count;
    }
}

/// Which of two nodes in a row the half line from a point along +x meets: bits 0 and 1. Of the
/// point, a box that holds it will do.
class LineBoxes {
public:
#if defined(__SSE4_1__)
    explicit LineBoxes(const Aabb& p)
        : above_(_mm_set_ps(infinity, p.hi.z, p.hi.y, infinity)),
          below_(_mm_set_ps(0, p.lo.z, p.lo.y, p.lo.x)) {}
    [[nodiscard]] int operator()(const BvhNode* pair) const {
        const float* p = &pair->lo.x;
        return met(p) | met(p + 8) << 1;
    }

private:
    [[nodiscard]] int met(const float* box) const {
        const __m128 in = _mm_and_ps(_mm_cmple_ps(_mm_load_ps(box), above_),
                                     _mm_cmpge_ps(_mm_load_ps(box + 4), below_));
        return (_mm_movemask_ps(in) & 7) == 7;
    }
    __m128 above_, below_;
#else
    explicit LineBoxes(const Aabb& p) : p_(p) {}
    [[nodiscard]] int operator()(const BvhNode* pair) const {
        return met(pair[0]) | met(pair[1]) << 1;
    }

private:
    [[nodiscard]] int met(const BvhNode& n) const {
        return n.hi.x >= p_.lo.x && n.lo.y <= p_.hi.y && n.hi.y >= p_.lo.y && n.lo.z <= p_.hi.z &&
               n.hi.z >= p_.lo.z;
    }
    Aabb p_;
#endif
};

inline LineBoxes line_boxes(const TriangleTree&, Vec3 p) { return LineBoxes({p, p}); }
inline LineBoxes line_boxes(const TriangleTreeD& tree, Vec3d p) {
    return LineBoxes(box_around_center({p, p}, tree.space.center, tree.space.scale));
}

/// Each triangle must be in one leaf only. The point must be finite, the tree not empty.
template <class Tree, class Vec, class Scalar>
inline Crossings count_crossings(const Tree& tree, Vec p, BasicWalkStack<Scalar>& stack) {
    Crossings sum;
    const LineBoxes boxes = line_boxes(tree, p);
    BasicPendingNode<Scalar>* const bottom = stack.begin();
    BasicPendingNode<Scalar>* top = bottom;
    std::uint32_t slot = 0;
    for (;;) {
        const BvhNode& node = tree.nodes[slot];
        if (node.is_leaf()) {
            for (std::uint32_t k = node.first; k < node.first + node.count; ++k)
                add_crossing(tree.triangles[k], p, sum);
            if (sum.on_surface) return sum;
        } else if (const int met = boxes(&tree.nodes[node.first]); met != 0) {
            if (met == 3) {
                RAYDIX_CHECK(static_cast<std::uint32_t>(top - bottom), <, stack.capacity());
                *top++ = {node.first + 1, 0};
            }
            slot = node.first + (met == 2 ? 1u : 0u);
            continue;
        }
        if (top == bottom) return sum;
        slot = (--top)->slot;
    }
}

}  // namespace raydix
