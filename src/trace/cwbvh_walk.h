// One ray through a compressed wide tree (Ylitie, Karras, Laine 2017, section 3.3), for host and
// device. What a ray still has to visit are groups: children of one node that it met, as bits in
// the order of its octant, and triangles of one node.
#pragma once

#include <cstdint>

#include "base/hd.h"
#include "base/math.h"
#include "layout/cwbvh.h"
#include "trace/cwbvh_node.h"
#include "trace/slab.h"
#include "trace/triangle_test.h"

namespace raydix {

struct CwbvhView {
    const CwbvhNode* nodes;
    const CwbvhTriangle* triangles;
    Aabb bounds;  // of the root
};

/// Bits 0 to 23 of `hits`: triangles still to test, by their position behind `base`.
struct CwbvhTriangles {
    std::uint32_t base, hits;
};

/// A ray's constants. Boxes are widened by twice the pad of slab.h, which leaves room for the
/// roundings of plane_at: it stays within 8 u * (distance to the farthest plane) of the exact
/// plane, u = 2^-24, the pad adds as much on every side (docs/algorithms/cwbvh.md). A component of
/// the direction below 2^-80 counts as that: nothing then is infinite or NaN, a plane before the
/// origin stays before it, and the one behind stays farther away than any hit.
struct CwbvhRay {
    RayFrame frame;
    Vec3 inverse, pad;  // pad: with the sign that moves near planes toward the ray's start
    std::uint32_t octant;
};

inline constexpr float cwbvh_longest_inverse = 0x1p80f;

RAYDIX_HD inline CwbvhRay make_cwbvh_ray(const RayFrame& frame, const Aabb& bounds) {
    const SlabFrame slabs = make_slab_frame(frame, bounds);
    const auto limited = [](float inverse) {
        return max_of(min_of(inverse, cwbvh_longest_inverse), -cwbvh_longest_inverse);
    };
    CwbvhRay ray;
    ray.frame = frame;
    ray.inverse = {limited(slabs.inverse.x), limited(slabs.inverse.y), limited(slabs.inverse.z)};
    ray.pad = cwbvh_pad_factor * slabs.near_pad;
    ray.octant = octant_of(slabs.near_x != 0, slabs.near_y != 0, slabs.near_z != 0);
    return ray;
}

RAYDIX_HD inline CwbvhTriangle load_triangle(const CwbvhTriangle* triangle) {
#if defined(__CUDA_ARCH__)
    const float4* from = reinterpret_cast<const float4*>(triangle);
    const float4 a = __ldg(from), b = __ldg(from + 1), c = __ldg(from + 2);
    return {{a.x, a.y, a.z}, __float_as_uint(a.w), {b.x, b.y, b.z}, 0, {c.x, c.y, c.z}, 0};
#else
    return *triangle;
#endif
}

/// steps * rate + start. A device rounds once, the host twice: the pad covers both.
RAYDIX_HD inline float plane_at(float steps, float rate, float start) {
#if defined(__CUDA_ARCH__)
    return __fmaf_rn(steps, rate, start);
#else
    return steps * rate + start;
#endif
}

RAYDIX_HD inline CwbvhAxis make_axis(float node_origin, std::uint32_t exponent, float origin,
                                     float pad, float inverse) {
    const float from_ray = node_origin - origin;
    return {float_of_bits(exponent << 23) * inverse, (from_ray + pad) * inverse,
            (from_ray - pad) * inverse};
}

/// The children of a node that the ray meets no later than tmax.
RAYDIX_HD inline std::uint32_t meet_children(const CwbvhRay& ray, const CwbvhWords& node,
                                             float tmax) {
    const std::uint32_t* w = node.word;
    const CwbvhAxis axes[3] = {make_axis(float_of_bits(w[0]), byte_of(w[3], 0), ray.frame.origin.x,
                                         ray.pad.x, ray.inverse.x),
                               make_axis(float_of_bits(w[1]), byte_of(w[3], 1), ray.frame.origin.y,
                                         ray.pad.y, ray.inverse.y),
                               make_axis(float_of_bits(w[2]), byte_of(w[3], 2), ray.frame.origin.z,
                                         ray.pad.z, ray.inverse.z)};
    return meet_children(
        ray.octant, node, axes, ray.frame.tmin, tmax,
        [](float steps, float rate, float start) { return plane_at(steps, rate, start); });
}

struct CwbvhBest {
    float t;
    std::uint32_t prim = no_primitive;
    float u = 0.0f, v = 0.0f;
};

/// Tests the first triangle of `group` and takes it out. At equal t the lower id wins.
RAYDIX_HD inline void test_first_triangle(const CwbvhView& tree, const CwbvhRay& ray,
                                          CwbvhTriangles& group, CwbvhBest& best) {
    const int bit = highest_bit(group.hits);
    group.hits ^= 1u << bit;
    const CwbvhTriangle triangle =
        load_triangle(tree.triangles + group.base + static_cast<std::uint32_t>(bit));
    TriangleHit hit;
    const LeafTriangle corners{triangle.v0, triangle.v1, triangle.v2};
    if (!intersect_triangle<EdgeRule::closed>(ray.frame, corners, best.t, hit)) return;
    if (hit.t < best.t || triangle.prim < best.prim) best = {hit.t, triangle.prim, hit.u, hit.v};
}

/// Counts nothing.
struct NoCwbvhSteps {
    RAYDIX_HD void visit() {}
    RAYDIX_HD void test() {}
};

/// What a ray has before it: the root, as the only child of nothing.
RAYDIX_HD inline CwbvhGroup root_group() { return {0, 1u << 31}; }

/// Enters the first child of `nodes`, whose siblings go to the stack. One entry a level at most:
/// the stack needs room for `max_depth` of them.
template <class Steps>
RAYDIX_HD void visit_first_child(const CwbvhView& tree, const CwbvhRay& ray, float tmax,
                                 CwbvhGroup& nodes, CwbvhTriangles& triangles, CwbvhGroup*& top,
                                 Steps& steps) {
    const std::uint32_t index = take_first_child(ray.octant, nodes);
    if (nodes.has_nodes()) *top++ = nodes;
    const CwbvhWords words = load_node(tree.nodes + index);
    steps.visit();
    const std::uint32_t hits = meet_children(ray, words, tmax);
    nodes = met_nodes(words, hits);
    triangles = {words.word[5], met_triangles(hits)};
}

/// The whole walk; stack [max_depth]. With `any`, the first hit found ends it.
template <bool any, class Steps>
RAYDIX_HD CwbvhBest walk_cwbvh(const CwbvhView& tree, const CwbvhRay& ray, CwbvhGroup* stack,
                               Steps& steps) {
    CwbvhBest best{ray.frame.tmax};
    CwbvhGroup nodes = root_group();
    CwbvhGroup* top = stack;
    for (;;) {
        CwbvhTriangles triangles;
        visit_first_child(tree, ray, best.t, nodes, triangles, top, steps);
        while (triangles.hits != 0) {
            steps.test();
            test_first_triangle(tree, ray, triangles, best);
            if (any && best.prim != no_primitive) return best;
        }
        if (!nodes.has_nodes()) {
            if (top == stack) return best;
            nodes = *--top;
        }
    }
}

RAYDIX_HD inline TreeHit public_hit(const CwbvhBest& best, const RayFrame& ray) {
    return best.prim == no_primitive ? TreeHit{}
                                     : TreeHit{best.t * ray.t_scale, best.prim, best.u, best.v};
}

}  // namespace raydix
