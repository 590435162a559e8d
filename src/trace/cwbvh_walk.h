// One ray through a compressed wide tree (Ylitie, Karras, Laine 2017, section 3.3), for host and
// device. What a ray still has to visit are groups: children of one node that it met, as bits in
// the order of its octant, and triangles of one node.
#pragma once

#include <cstdint>
#include <cstring>

#include "base/bits.h"
#include "base/hd.h"
#include "base/math.h"
#include "layout/cwbvh.h"
#include "trace/slab.h"
#include "trace/triangle_test.h"

namespace raydix {

struct CwbvhView {
    const CwbvhNode* nodes;
    const CwbvhTriangle* triangles;
    Aabb bounds;  // of the root
};

/// Bits 24 to 31 of `hits`: children still to visit, the highest first; bits 0 to 7: inner_mask of
/// their parent, whose child_base is `base`.
struct CwbvhGroup {
    std::uint32_t base, hits;

    [[nodiscard]] RAYDIX_HD bool has_nodes() const { return hits >> cwbvh_first_child_bit != 0; }
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
    bool negative_x, negative_y, negative_z;
    /// Slot s comes at place s ^ octant, high places first.
    std::uint32_t octant;
};

inline constexpr float cwbvh_longest_inverse = 0x1p80f;
/// Planes round three times more than those of slab.h.
inline constexpr float cwbvh_pad_factor = 1.5f;

RAYDIX_HD inline CwbvhRay make_cwbvh_ray(const RayFrame& frame, const Aabb& bounds) {
    const SlabFrame slabs = make_slab_frame(frame, bounds);
    const auto limited = [](float inverse) {
        return max_of(min_of(inverse, cwbvh_longest_inverse), -cwbvh_longest_inverse);
    };
    CwbvhRay ray;
    ray.frame = frame;
    ray.inverse = {limited(slabs.inverse.x), limited(slabs.inverse.y), limited(slabs.inverse.z)};
    ray.pad = cwbvh_pad_factor * slabs.near_pad;
    ray.negative_x = slabs.near_x != 0;
    ray.negative_y = slabs.near_y != 0;
    ray.negative_z = slabs.near_z != 0;
    ray.octant =
        (ray.negative_x ? 0u : 1u) | (ray.negative_y ? 0u : 2u) | (ray.negative_z ? 0u : 4u);
    return ray;
}

/// A node as 32-bit words: 0-2 origin, 3 exponents and inner_mask, 4 and 5 bases, 6 and 7 meta,
/// then pairs of lo x, y, z and hi x, y, z.
struct CwbvhWords {
    std::uint32_t word[20];
};

RAYDIX_HD inline CwbvhWords load_node(const CwbvhNode* node) {
    CwbvhWords words;
#if defined(__CUDA_ARCH__)
    const uint4* from = reinterpret_cast<const uint4*>(node);
#pragma unroll
    for (int k = 0; k < 5; ++k) {
        const uint4 four = __ldg(from + k);
        words.word[4 * k] = four.x;
        words.word[4 * k + 1] = four.y;
        words.word[4 * k + 2] = four.z;
        words.word[4 * k + 3] = four.w;
    }
#else
    std::memcpy(&words, node, sizeof(words));
#endif
    return words;
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

RAYDIX_HD inline float float_of_bits(std::uint32_t bits) {
    float value;
    std::memcpy(&value, &bits, sizeof(value));
    return value;
}

RAYDIX_HD inline std::uint32_t byte_of(std::uint32_t word, int k) { return word >> (8 * k) & 255u; }

RAYDIX_HD inline int highest_bit(std::uint32_t bits) { return 31 - leading_zeros(bits); }

/// steps * rate + start. A device rounds once, the host twice: the pad covers both.
RAYDIX_HD inline float plane_at(float steps, float rate, float start) {
#if defined(__CUDA_ARCH__)
    return __fmaf_rn(steps, rate, start);
#else
    return steps * rate + start;
#endif
}

/// One axis of a node for one ray: t of the plane q is q * rate + near or far.
struct CwbvhAxis {
    float rate, near, far;
};

RAYDIX_HD inline CwbvhAxis make_axis(float node_origin, std::uint32_t exponent, float origin,
                                     float pad, float inverse) {
    const float from_ray = node_origin - origin;
    return {float_of_bits(exponent << 23) * inverse, (from_ray + pad) * inverse,
            (from_ray - pad) * inverse};
}

/// Bits of four children whose meta is one word: a leaf's triangles, or the place of a node's turn.
RAYDIX_HD inline std::uint32_t places_in_order(std::uint32_t meta, std::uint32_t octant) {
    // Where bits 3 and 4 of a byte are set there is a node; its slot is the lowest three bits.
    const std::uint32_t nodes = (meta & meta << 1) >> 4 & 0x01010101u;
    return meta ^ (nodes * octant);
}

/// The children of a node that the ray meets no later than tmax: nodes as bits 24 to 31, triangles
/// as bits 0 to 23.
RAYDIX_HD inline std::uint32_t meet_children(const CwbvhRay& ray, const CwbvhWords& node,
                                             float tmax) {
    const std::uint32_t* w = node.word;
    const CwbvhAxis x = make_axis(float_of_bits(w[0]), byte_of(w[3], 0), ray.frame.origin.x,
                                  ray.pad.x, ray.inverse.x);
    const CwbvhAxis y = make_axis(float_of_bits(w[1]), byte_of(w[3], 1), ray.frame.origin.y,
                                  ray.pad.y, ray.inverse.y);
    const CwbvhAxis z = make_axis(float_of_bits(w[2]), byte_of(w[3], 2), ray.frame.origin.z,
                                  ray.pad.z, ray.inverse.z);
    std::uint32_t hits = 0;
#if defined(__CUDA_ARCH__)
#pragma unroll
#endif
    for (int half = 0; half < 2; ++half) {
        const std::uint32_t lo_x = w[8 + half], lo_y = w[10 + half], lo_z = w[12 + half];
        const std::uint32_t hi_x = w[14 + half], hi_y = w[16 + half], hi_z = w[18 + half];
        const std::uint32_t near_x = ray.negative_x ? hi_x : lo_x,
                            far_x = ray.negative_x ? lo_x : hi_x;
        const std::uint32_t near_y = ray.negative_y ? hi_y : lo_y,
                            far_y = ray.negative_y ? lo_y : hi_y;
        const std::uint32_t near_z = ray.negative_z ? hi_z : lo_z,
                            far_z = ray.negative_z ? lo_z : hi_z;
        const std::uint32_t meta = places_in_order(w[6 + half], ray.octant);
#if defined(__CUDA_ARCH__)
#pragma unroll
#endif
        for (int k = 0; k < 4; ++k) {
            const auto steps = [&](std::uint32_t word) {
                return static_cast<float>(byte_of(word, k));
            };
            const float ex = plane_at(steps(near_x), x.rate, x.near),
                        ey = plane_at(steps(near_y), y.rate, y.near),
                        ez = plane_at(steps(near_z), z.rate, z.near);
            const float lx = plane_at(steps(far_x), x.rate, x.far),
                        ly = plane_at(steps(far_y), y.rate, y.far),
                        lz = plane_at(steps(far_z), z.rate, z.far);
            const float entry = max_of(max_of(ex, ey), max_of(ez, ray.frame.tmin));
            const float leave = min_of(min_of(lx, ly), lz) * slab_exit_factor;
            const std::uint32_t child = byte_of(meta, k);
            if (entry <= min_of(leave, tmax)) hits |= (child >> 5) << (child & 31u);
        }
    }
    return hits;
}

/// Goes on to the first child of `group`: takes it out, and returns its node.
RAYDIX_HD inline std::uint32_t take_first_child(const CwbvhRay& ray, CwbvhGroup& group) {
    const int bit = highest_bit(group.hits);
    group.hits ^= 1u << bit;
    const std::uint32_t slot =
        (static_cast<std::uint32_t>(bit) - cwbvh_first_child_bit) ^ ray.octant;
    const std::uint32_t before = group.hits & ((1u << slot) - 1u);
    return group.base + static_cast<std::uint32_t>(count_ones(std::uint64_t{before}));
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
    const std::uint32_t index = take_first_child(ray, nodes);
    if (nodes.has_nodes()) *top++ = nodes;
    const CwbvhWords words = load_node(tree.nodes + index);
    steps.visit();
    const std::uint32_t hits = meet_children(ray, words, tmax);
    nodes = {words.word[4], (hits & 0xFF000000u) | words.word[3] >> 24};
    triangles = {words.word[5], hits & 0x00FFFFFFu};
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
