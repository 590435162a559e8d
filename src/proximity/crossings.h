// How often a mesh is crossed on the way from a point to infinity along +x, without any rounding:
// for a closed mesh its winding number around the point.
//
// The line is moved by an infinitesimal step along z and a smaller one along y, so that it meets no
// edge and no vertex: an edge counts where it starts at or below the point in z and ends above it,
// and a point on an edge counts as right of it. Both triangles of an edge see the same edge from
// its lower end to its upper, so their answers fit. Whether the crossing is before or behind the
// point is the side of the triangle's plane on which the point lies.
#pragma once

#include <raydix/bvh.h>
#include <raydix/types.h>

#include "primitives/exact_overlap.h"
#include "proximity/closest_walk.h"
#include "trace/walk.h"

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
RAYDIX_HD inline int edge_cover(Vec3 from, Vec3 to, Vec3 p) {
    const bool upward = to.z > p.z;
    if ((from.z > p.z) == upward) return 0;
    const Vec3 low = upward ? from : to, high = upward ? to : from;
    const bool left = turn_sign({low.y, low.z}, {high.y, high.z}, {p.y, p.z}) > 0;
    return left ? (upward ? 1 : -1) : 0;
}

/// 1 or -1 if the moved line goes through the triangle, out of its front or into it; else 0.
RAYDIX_HD inline int line_cover(const LeafTriangle& t, Vec3 p) {
    return edge_cover(t.v0, t.v1, p) + edge_cover(t.v1, t.v2, p) + edge_cover(t.v2, t.v0, p);
}

RAYDIX_HD inline void add_crossing(const LeafTriangle& t, Vec3 p, Crossings& sum) {
    const Aabb box = box_of(t.v0, t.v1, t.v2);
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

/// Which of two nodes in a row the half line from a point along +x meets: bits 0 and 1.
class LineBoxes {
public:
#if defined(__SSE4_1__)
    explicit LineBoxes(Vec3 p)
        : above_(_mm_set_ps(infinity, p.z, p.y, infinity)), below_(_mm_set_ps(0, p.z, p.y, p.x)) {}
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
    explicit LineBoxes(Vec3 p) : p_(p) {}
    [[nodiscard]] int operator()(const BvhNode* pair) const {
        return met(pair[0]) | met(pair[1]) << 1;
    }

private:
    [[nodiscard]] int met(const BvhNode& n) const {
        return n.hi.x >= p_.x && n.lo.y <= p_.y && n.hi.y >= p_.y && n.lo.z <= p_.z &&
               n.hi.z >= p_.z;
    }
    Vec3 p_;
#endif
};

/// Each triangle must be in one leaf only. The point must be finite, the tree not empty.
inline Crossings count_crossings(const TriangleTree& tree, Vec3 p, WalkStack& stack) {
    Crossings sum;
    const LineBoxes boxes(p);
    PendingNode* const bottom = stack.begin();
    PendingNode* top = bottom;
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
                *top++ = {node.first + 1, 0.0f};
            }
            slot = node.first + (met == 2 ? 1u : 0u);
            continue;
        }
        if (top == bottom) return sum;
        slot = (--top)->slot;
    }
}

}  // namespace raydix
