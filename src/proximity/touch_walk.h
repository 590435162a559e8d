// The triangles of a tree that a segment or a ball touches, one after the other.
#pragma once

#include <raydix/bvh.h>
#include <raydix/double.h>
#include <raydix/overlap.h>

#include <algorithm>

#include "primitives/exact_overlap.h"
#include "proximity/closest_walk.h"
#include "tree/around_center.h"

namespace raydix {

inline bool is_valid(const Segment& s) { return is_finite(s.a) && is_finite(s.b); }
inline bool is_valid(const Sphere& s) {
    return is_finite(s.center) && s.radius >= 0.0f && s.radius < infinity;
}

inline bool is_valid(const SegmentD& s) { return in_range(s.a) && in_range(s.b); }
inline bool is_valid(const SphereD& s) {
    return is_finite(s.center) && s.radius >= 0.0 && s.radius < infinity;
}

/// Where a query is, for the order in which queries are taken.
inline Vec3 place_of(const Segment& s) { return 0.5f * s.a + 0.5f * s.b; }
inline Vec3 place_of(const Sphere& s) { return s.center; }
inline Vec3d place_of(const SegmentD& s) { return 0.5 * s.a + 0.5 * s.b; }
inline Vec3d place_of(const SphereD& s) { return s.center; }

/// A query as the signs of exact_sign_double.h want it.
inline const Segment& prepared(const Segment& s) { return s; }
inline const Sphere& prepared(const Sphere& s) { return s; }
inline SegmentD prepared(const SegmentD& s) { return {without_tiny(s.a), without_tiny(s.b)}; }
inline const SphereD& prepared(const SphereD& s) { return s; }

/// Which boxes a segment may touch: its own box decides first, then the planes of the slabs it
/// runs between, with room for rounding. `padded`: the ends are off by rounding, the slabs grow.
template <bool padded>
class BasicSegmentBoxes {
public:
    /// `box` holds the segment, exactly.
    BasicSegmentBoxes(const Aabb& box, Double3 from, Double3 to, double pad)
        : box_(box),
          from_(from),
          inverse_(1.0 / (to.x - from.x), 1.0 / (to.y - from.y), 1.0 / (to.z - from.z)),
          pad_(pad) {}

    [[nodiscard]] bool meet(const BvhNode& node) const {
        if (!boxes_touch(box_, Aabb{node.lo, node.hi})) return false;
        double enter = 0.0, leave = 1.0;
        cut(node.lo.x, node.hi.x, from_.x, inverse_.x, enter, leave);
        cut(node.lo.y, node.hi.y, from_.y, inverse_.y, enter, leave);
        cut(node.lo.z, node.hi.z, from_.z, inverse_.z, enter, leave);
        return enter <= leave + 1e-12;
    }

private:
    void cut(double lo, double hi, double from, double inverse, double& enter,
             double& leave) const {
        if (std::isinf(inverse)) return;  // the box has decided
        if constexpr (padded) {
            lo -= pad_;
            hi += pad_;
        }
        const double a = (lo - from) * inverse, b = (hi - from) * inverse;
        enter = std::max(enter, std::min(a, b));
        leave = std::min(leave, std::max(a, b));
    }
    Aabb box_;
    Double3 from_, inverse_;
    double pad_;
};

inline BasicSegmentBoxes<false> segment_boxes(const PaddedTree&, const Segment& s) {
    return {segment_box(s.a, s.b), Double3(s.a), Double3(s.b), 0.0};
}
inline BasicSegmentBoxes<true> segment_boxes(const TreeSpace& space, const SegmentD& s) {
    const Vec3d from = space.local(s.a), to = space.local(s.b);
    const Vec3d far = max_of(max_of(from, -1.0 * from), max_of(to, -1.0 * to));
    return {box_around_center(segment_box(s.a, s.b), space.center, space.scale), Double3(from),
            Double3(to), 0x1p-50 * max_of(max_of(far.x, far.y), far.z)};
}
inline BasicSegmentBoxes<true> segment_boxes(const PaddedTreeD& tree, const SegmentD& s) {
    return segment_boxes(tree.space, s);
}

/// visit(position in leaf order) -> whether to stop, for all in leaves that a segment's boxes meet.
template <class Boxes, class Stack, class Visit>
void for_each_met(const BvhNode* nodes, const Boxes& boxes, Stack& stack, const Visit& visit) {
    auto* const bottom = stack.begin();
    auto* top = bottom;
    std::uint32_t slot = 0;
    for (;;) {
        const BvhNode& node = nodes[slot];
        if (node.is_leaf()) {
            for (std::uint32_t k = node.first; k < node.first + node.count; ++k)
                if (visit(k)) return;
        } else {
            const bool left = boxes.meet(nodes[node.first]),
                       right = boxes.meet(nodes[node.first + 1]);
            if (left && right) {
                RAYDIX_CHECK(static_cast<std::uint32_t>(top - bottom), <, stack.capacity());
                *top++ = {node.first + 1, 0};
            }
            if (left || right) {
                slot = node.first + (left ? 0u : 1u);
                continue;
            }
        }
        if (top == bottom) return;
        slot = (--top)->slot;
    }
}

/// visit(position in leaf order) -> whether to stop. The query must be valid, the tree not empty.
template <class Tree, class AnySegment, class Visit>
requires requires(AnySegment s) { s.b; }
void for_each_touched(const Tree& tree, const AnySegment& s,
                      BasicWalkStack<typename Tree::Scalar>& stack, const Visit& visit) {
    for_each_met(tree.nodes, segment_boxes(tree, s), stack, [&](std::uint32_t k) {
        return segment_touches_triangle(s.a, s.b, tree.triangles[k]) && visit(k);
    });
}
template <class Tree, class AnySphere, class Visit>
requires requires(AnySphere s) { s.radius; }
void for_each_touched(const Tree& tree, const AnySphere& s,
                      BasicWalkStack<typename Tree::Scalar>& stack, const Visit& visit) {
    const auto limit = s.radius * s.radius;
    const auto leaf = [&](const BvhNode& node) {
        for (std::uint32_t k = node.first; k < node.first + node.count; ++k) {
            const auto& t = tree.triangles[k];
            if (squared_distance_to_box(box_of(t.v0, t.v1, t.v2), s.center) <= limit &&
                closest_on_triangle(t, s.center).d2 <= limit && visit(k))
                return true;
        }
        return false;
    };
    walk_outward(tree.nodes, tree.distances(s.center), stack, leaf,
                 [&] { return tree.local_square(limit); });
}

}  // namespace raydix
