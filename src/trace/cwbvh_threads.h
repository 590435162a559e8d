// Rays through compressed wide trees as threads of a device take them: walk_cwbvh (cwbvh_walk.h)
// with one thread a ray, and with warps that live as long as there are rays and replace those that
// have ended. Kernels of all backends are made of these.
#pragma once

#include "base/atomic.h"
#include "base/device_words.h"
#include "trace/cwbvh_walk.h"

namespace raydix::kernels {

inline constexpr std::uint32_t all_lanes = 0xFFFFFFFFu;
/// New rays are taken when fewer lanes than this are at work (Aila, Laine, Karras 2012: 20 of 32).
inline constexpr std::uint32_t least_active_lanes = 20;

struct StoreHit {
    TreeHit* hits;
    RAYDIX_HD void operator()(std::uint32_t i, const TreeHit& hit) const { hits[i] = hit; }
};
struct StoreOccluded {
    std::uint8_t* occluded;
    RAYDIX_HD void operator()(std::uint32_t i, const TreeHit& hit) const {
        occluded[i] = hit.hit();
    }
};

/// Through the read-only cache, where there is one.
RAYDIX_HD inline Ray fetch_ray(const Ray* ray) {
#if defined(__CUDA_ARCH__)
    const float4* from = reinterpret_cast<const float4*>(ray);
    const float4 a = __ldg(from), b = __ldg(from + 1);
    return {{a.x, a.y, a.z}, a.w, {b.x, b.y, b.z}, b.w};
#else
    return *ray;
#endif
}

/// The rays of a launch, and what becomes of a hit.
template <class Store>
struct CwbvhRays {
    CwbvhView tree;
    const Ray* rays;
    std::uint32_t count;
    Store store;
};

/// Ray i.
template <bool any, int stack_entries, class Store>
RAYDIX_HD void trace_cwbvh_ray(const CwbvhRays<Store>& given, std::uint32_t i) {
    TreeHit hit;
    const Ray ray_given = fetch_ray(given.rays + i);
    if (is_valid(ray_given)) {
        CwbvhGroup stack[stack_entries];
        NoCwbvhSteps steps;
        const CwbvhRay ray = make_cwbvh_ray(make_frame(ray_given), given.tree.bounds);
        hit = public_hit(walk_cwbvh<any>(given.tree, ray, stack, steps), ray.frame);
    }
    given.store(i, hit);
}

/// Hands the lanes without a ray the next ones of the pool, in the order of lanes. All lanes of the
/// warp must call it. Returns the lane's ray, or `count` and more when the pool is empty.
RAYDIX_HD inline std::uint32_t replace_ended(bool ended, std::uint32_t current,
                                             std::uint32_t* next) {
    const std::uint32_t wanting = words::ballot(all_lanes, ended);
    const std::uint32_t lane = words::lane_id();
    std::uint32_t first = 0;
    if (lane == 0) first = claim(*next, words::count_ones(wanting));
    first = words::shuffle(all_lanes, first, 0);
    const std::uint32_t rank = words::count_ones(wanting & ((1u << lane) - 1u));
    return ended ? first + rank : current;
}

/// *next counts the rays handed out; 0 at the start. It ends at most 32 a warp past `count`, which
/// is less than 2^31: it cannot wrap.
template <bool any, int stack_entries, class Store>
RAYDIX_HD void trace_cwbvh_pool(const CwbvhRays<Store>& pool, std::uint32_t* next) {
    const CwbvhView tree = pool.tree;
    const std::uint32_t count = pool.count;
    CwbvhGroup stack[stack_entries];
    CwbvhGroup* top = stack;
    CwbvhGroup nodes{0, 0};
    CwbvhRay ray;
    CwbvhBest best{0.0f};
    NoCwbvhSteps steps;
    std::uint32_t index = 0;
    bool at_work = false, more = true;
    while (true) {
        if (more) {
            index = replace_ended(!at_work, index, next);
            if (!at_work && index < count) {
                const Ray given = fetch_ray(pool.rays + index);
                if (is_valid(given)) {
                    ray = make_cwbvh_ray(make_frame(given), tree.bounds);
                    best = {ray.frame.tmax};
                    nodes = root_group();
                    top = stack;
                    at_work = true;
                } else {
                    pool.store(index, TreeHit{});
                }
            }
            more = words::ballot(all_lanes, at_work || index < count) == all_lanes;
        }
        if (!more && words::ballot(all_lanes, at_work) == 0) return;
        const std::uint32_t enough = more ? least_active_lanes : 1;
        while (words::count_ones(words::ballot(all_lanes, at_work)) >= enough) {
            if (!at_work) continue;
            CwbvhTriangles triangles;
            visit_first_child(tree, ray, best.t, nodes, triangles, top, steps);
            bool ended = false;
            while (triangles.hits != 0 && !ended) {
                test_first_triangle(tree, ray, triangles, best);
                ended = any && best.prim != no_primitive;
            }
            if (!ended && !nodes.has_nodes()) {
                ended = top == stack;
                if (!ended) nodes = *--top;
            }
            if (ended) {
                pool.store(index, public_hit(best, ray.frame));
                at_work = false;
            }
        }
    }
}

}  // namespace raydix::kernels
