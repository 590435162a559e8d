// The triangles of a tree that a segment or a ball touches, one after the other.
#pragma once

#include <raydix/bvh.h>
#include <raydix/overlap.h>

#include <algorithm>

#include "primitives/exact_overlap.h"
#include "proximity/closest_walk.h"

namespace raydix {

inline bool is_valid(const Segment& s) { return is_finite(s.a) && is_finite(s.b); }
inline bool is_valid(const Sphere& s) {
    return is_finite(s.center) && s.radius >= 0.0f && s.radius < infinity;
}

/// Where a query is, for the order in which queries are taken.
inline Vec3 place_of(const Segment& s) { return 0.5f * s.a + 0.5f * s.b; }
inline Vec3 place_of(const Sphere& s) { return s.center; }

/// Which boxes a segment may touch: its own box decides first, then the planes of the slabs it
/// runs between, with room for rounding.
class SegmentBoxes {
public:
    explicit SegmentBoxes(const Segment& s)
        : box_(segment_box(s.a, s.b)),
          from_(s.a),
          inverse_(1.0 / (double(s.b.x) - s.a.x), 1.0 / (double(s.b.y) - s.a.y),
                   1.0 / (double(s.b.z) - s.a.z)) {}

    [[nodiscard]] bool meet(const BvhNode& node) const {
        if (!boxes_touch(box_, {node.lo, node.hi})) return false;
        double enter = 0.0, leave = 1.0;
        cut(node.lo.x, node.hi.x, from_.x, inverse_.x, enter, leave);
        cut(node.lo.y, node.hi.y, from_.y, inverse_.y, enter, leave);
        cut(node.lo.z, node.hi.z, from_.z, inverse_.z, enter, leave);
        return enter <= leave + 1e-12;
    }

private:
    static void cut(float lo, float hi, double from, double inverse, double& enter, double& leave) {
        if (std::isinf(inverse)) return;  // the box has decided
        const double a = (lo - from) * inverse, b = (hi - from) * inverse;
        enter = std::max(enter, std::min(a, b));
        leave = std::min(leave, std::max(a, b));
    }
    Aabb box_;
    Double3 from_, inverse_;
};

/// visit(position in leaf order) -> whether to stop. The query must be valid, the tree not empty.
template <class Visit>
void for_each_touched(const PaddedTree& tree, const Segment& s, WalkStack& stack,
                      const Visit& visit) {
    const SegmentBoxes boxes(s);
    PendingNode* const bottom = stack.begin();
    PendingNode* top = bottom;
    std::uint32_t slot = 0;
    for (;;) {
        const BvhNode& node = tree.nodes[slot];
        if (node.is_leaf()) {
            for (std::uint32_t k = node.first; k < node.first + node.count; ++k)
                if (segment_touches_triangle(s.a, s.b, tree.triangles[k]) && visit(k)) return;
        } else {
            const bool left = boxes.meet(tree.nodes[node.first]),
                       right = boxes.meet(tree.nodes[node.first + 1]);
            if (left && right) {
                RAYDIX_CHECK(static_cast<std::uint32_t>(top - bottom), <, stack.capacity());
                *top++ = {node.first + 1, 0.0f};
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

template <class Visit>
void for_each_touched(const PaddedTree& tree, const Sphere& s, WalkStack& stack,
                      const Visit& visit) {
    const float limit = s.radius * s.radius;
    const auto leaf = [&](const BvhNode& node) {
        for (std::uint32_t k = node.first; k < node.first + node.count; ++k) {
            const LeafTriangle& t = tree.triangles[k];
            if (squared_distance_to_box(box_of(t.v0, t.v1, t.v2), s.center) <= limit &&
                closest_on_triangle(t, s.center).d2 <= limit && visit(k))
                return true;
        }
        return false;
    };
    walk_outward(tree.nodes, BoxDistances(s.center, tree.pad), stack, leaf, [&] { return limit; });
}

}  // namespace raydix
