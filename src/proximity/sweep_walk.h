// The first contact of a moving ball with the triangles of a tree.
#pragma once

#include <raydix/overlap.h>

#include "proximity/closest_walk.h"
#include "proximity/round_shapes.h"
#include "trace/ray_frame.h"

namespace raydix {

inline bool is_valid(const SphereSweep& s) {
    return is_valid(s.path) && s.radius >= 0.0f && s.radius < infinity;
}

/// `ray` must be valid.
inline Path path_of(const Ray& ray) {
    return {Double3(ray.origin), Double3(ray.direction), std::max(0.0, double(ray.tmin)),
            double(ray.tmax)};
}

/// One pure function of path, radius and triangle: t, not before the path enters the triangle's own
/// box, or infinity.
inline float first_contact(const Path& path, const GrownBoxes& boxes, double radius,
                           const LeafTriangle& t) {
    const Aabb box = box_of(t.v0, t.v1, t.v2);
    const double own = boxes.enter(box.lo, box.hi);
    if (own == never) return infinity;
    const double at = enter_rounded_triangle(path, t, radius);
    return at == never ? infinity : static_cast<float>(std::max(at, own));
}

struct Contact {
    float t = infinity;
    std::uint32_t prim = no_primitive, position = no_primitive;
};

/// The least (t, prim). The sweep must be valid, the tree not empty.
inline Contact find_first_contact(const TriangleTree& tree, const SphereSweep& sweep,
                                  WalkStack& stack) {
    const Path path = path_of(sweep.path);
    const GrownBoxes boxes(path, sweep.radius);
    // A part of a triangle may be entered later than the whole by rounding in double.
    const auto enter = [&](const BvhNode& node) {
        const double t = boxes.enter(node.lo, node.hi);
        return t == never ? infinity : static_cast<float>(t * (1.0 - 1e-12));
    };
    Contact best;
    PendingNode* const bottom = stack.begin();
    PendingNode* top = bottom;
    std::uint32_t slot = 0;
    for (;;) {
        const BvhNode& node = tree.nodes[slot];
        if (node.is_leaf()) {
            for (std::uint32_t k = node.first; k < node.first + node.count; ++k) {
                const float t = first_contact(path, boxes, sweep.radius, tree.triangles[k]);
                if (t < best.t || (t == best.t && t < infinity && tree.order[k] < best.prim))
                    best = {t, tree.order[k], k};
            }
        } else {
            const float a = enter(tree.nodes[node.first]), b = enter(tree.nodes[node.first + 1]);
            const bool b_first = b < a;
            const float nearer = b_first ? b : a, farther = b_first ? a : b;
            if (nearer <= best.t && nearer < infinity) {
                if (farther <= best.t && farther < infinity) {
                    RAYDIX_CHECK(static_cast<std::uint32_t>(top - bottom), <, stack.capacity());
                    *top++ = {node.first + (b_first ? 0u : 1u), farther};
                }
                slot = node.first + (b_first ? 1u : 0u);
                continue;
            }
        }
        do {
            if (top == bottom) return best;
            slot = (--top)->slot;
        } while (top->entry > best.t);
    }
}

}  // namespace raydix
