// The steps of Aila and Laine 2009: what one lane does between two branches. Each touches its lane
// and the outputs only, and is straight code: where lanes may part, kernels go through the policy.
// The arithmetic has its fused multiply-adds written out, so that host and device agree to the bit.
#pragma once

#include <raydix/types.h>

#include <cmath>
#include <cstdint>
#include <cstring>

#include "base/device_words.h"
#include "base/hd.h"
#include "base/math.h"
#include "trace/warp/lane.h"
#include "trace/warp/pair_visit.h"

namespace raydix {

/// 1 / d, where components closer to 0 than 2^-80 become that (Aila and Laine's release).
RAYDIX_HD static inline float inverse_of(float d) {
    constexpr float least = 0x1p-80f;
    const bool tiny = (d < 0 ? -d : d) < least;
    return 1.0f / (tiny ? (std::signbit(d) ? -least : least) : d);
}

// Loads and stores of 16 bytes at once, which a compiler makes out of the structs only if it knows
// their alignment.

struct FourFloats {
    float x, y, z, w;
};
RAYDIX_HD static inline FourFloats load_four(const float* at) {
#if defined(__CUDA_ARCH__)
    const float4 four = *reinterpret_cast<const float4*>(at);
    return {four.x, four.y, four.z, four.w};
#else
    return {at[0], at[1], at[2], at[3]};
#endif
}
RAYDIX_HD static inline Ray load_ray(const Ray* ray) {
#if defined(__CUDA_ARCH__)
    const FourFloats from = load_four(&ray->origin.x), to = load_four(&ray->direction.x);
    return {{from.x, from.y, from.z}, from.w, {to.x, to.y, to.z}, to.w};
#else
    return *ray;
#endif
}
RAYDIX_HD static inline void write_hit(TreeHit* to, const TreeHit& hit) {
#if defined(__CUDA_ARCH__)
    *reinterpret_cast<float4*>(to) = make_float4(hit.t, __uint_as_float(hit.prim), hit.u, hit.v);
#else
    *to = hit;
#endif
}

/// Lane and ray `index` of the launch; past its end, and for invalid rays, the lane is finished.
RAYDIX_HD static inline void start_ray(Lane& l, const RayLaunch& launch, std::uint32_t index) {
    const bool there = index < launch.count;
    l.ray = there ? index : no_ray;
    l.node = finished_node;
    l.aside = finished_node;
    l.leaf = 0;
    l.top = 0;
    l.prim = no_primitive;
    l.u = l.v = 0.0f;
    if (!there) return;
    const Ray ray = load_ray(launch.rays + index);
    l.origin = ray.origin;
    l.direction = ray.direction;
    l.inverse = {inverse_of(ray.direction.x), inverse_of(ray.direction.y),
                 inverse_of(ray.direction.z)};
    l.scaled = {ray.origin.x * l.inverse.x, ray.origin.y * l.inverse.y, ray.origin.z * l.inverse.z};
    l.tmin = ray.tmin;
    l.t = ray.tmax;
    l.node = ray.tmin <= ray.tmax ? 0 : finished_node;
}

RAYDIX_HD static inline void store_hit(Lane& l, const RayLaunch& launch) {
    if (l.ray != no_ray)
        launch.hits[l.ray] = TreeHit{l.prim == no_primitive ? infinity : l.t, l.prim, l.u, l.v};
    l.ray = no_ray;
}

/// Both children are tested; the lane goes to the closer, and the other is set aside.
RAYDIX_HD static inline void visit_node(Lane& l, const WarpScene& scene) {
    const NodePair n = scene.pairs[l.node];
    const PairVisit visit = meet_pair(l, n);
#if defined(RAYDIX_DEVICE_PASS)
    const bool both = visit.first & visit.second;
    const bool to_second = both ? visit.second_is_closer : visit.second;
    const std::int32_t closer = to_second ? n.child1 : n.child0;
    const std::int32_t other = to_second ? n.child0 : n.child1;
    l.aside = both ? other : finished_node;
    l.node = (visit.first | visit.second) ? closer : popped_node;
#else
    // The same by masks: compilers for the host make jumps of the choices, which nobody foresees.
    const auto mask = [](bool is) { return -static_cast<std::int32_t>(is); };
    const std::int32_t first = mask(visit.first), second = mask(visit.second),
                       both = first & second,
                       to_second = second & (mask(visit.second_is_closer) | ~first);
    const std::int32_t differ = n.child0 ^ n.child1, closer = n.child0 ^ (differ & to_second);
    l.aside = finished_node ^ ((finished_node ^ closer ^ differ) & both);
    l.node = popped_node ^ ((popped_node ^ closer) & (first | second));
#endif
}

RAYDIX_HD static inline void push(Lane& l) {
    l.stack[l.top++] = l.aside;
    l.aside = finished_node;
}

RAYDIX_HD static inline void pop(Lane& l) {
    const bool empty = l.top == 0;
    l.top -= empty ? 0 : 1;
    l.node = empty ? finished_node : l.stack[l.top];
}

/// The plane of triangle `position`: t along the ray.
RAYDIX_HD static inline void test_plane(Lane& l, const WarpScene& scene, std::uint32_t position) {
    const FourFloats z = load_four(scene.triangles[position].z);
    const float height = multiply_add(
        -z.x, l.origin.x, multiply_add(-z.y, l.origin.y, multiply_add(-z.z, l.origin.z, z.w)));
    const float slope =
        multiply_add(z.x, l.direction.x, multiply_add(z.y, l.direction.y, z.z * l.direction.z));
    l.test_t = height / slope;
}
/// False for NaN, which is what triangles without area give.
RAYDIX_HD static inline bool plane_in_range(const Lane& l) {
    return l.test_t >= l.tmin && l.test_t <= l.t;
}

/// Where the ray pierces the plane, in the triangle's own axes.
RAYDIX_HD static inline void test_edges(Lane& l, const WarpScene& scene, std::uint32_t position) {
    const WoopTriangle& triangle = scene.triangles[position];
    const auto along = [&](const FourFloats& row) {
        const float start =
            multiply_add(row.x, l.origin.x,
                         multiply_add(row.y, l.origin.y, multiply_add(row.z, l.origin.z, row.w)));
        const float slope = multiply_add(row.x, l.direction.x,
                                         multiply_add(row.y, l.direction.y, row.z * l.direction.z));
        return multiply_add(l.test_t, slope, start);
    };
    l.test_u = along(load_four(triangle.x));
    l.test_v = along(load_four(triangle.y));
}
RAYDIX_HD static inline bool inside_edges(const Lane& l) {
    return l.test_u >= 0.0f && l.test_v >= 0.0f && l.test_u + l.test_v <= 1.0f;
}

/// At equal t the lower primitive wins, whatever order leaves come in.
RAYDIX_HD static inline void accept_hit(Lane& l, const WarpScene& scene, std::uint32_t position) {
    const std::uint32_t id = scene.ids[position] & ~last_in_leaf;
    const bool better = l.test_t < l.t || id < l.prim;
    l.t = better ? l.test_t : l.t;
    l.u = better ? l.test_u : l.u;
    l.v = better ? l.test_v : l.v;
    l.prim = better ? id : l.prim;
}

/// A leaf link one triangle further; `done` if that was the last of its leaf.
RAYDIX_HD static inline std::int32_t after_triangle(std::int32_t link, const WarpScene& scene,
                                                    std::int32_t done) {
    return (scene.ids[~link] & last_in_leaf) != 0 ? done : link - 1;
}

}  // namespace raydix
