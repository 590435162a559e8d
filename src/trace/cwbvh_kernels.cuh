// The kernels of compressed wide trees: walk_cwbvh (cwbvh_walk.h) with one thread a ray, and with
// warps that live as long as there are rays and replace those that have ended.
#pragma once

#include <cuda_runtime.h>

#include "base/atomic.h"
#include "trace/cwbvh_walk.h"

namespace raydix::kernels {

inline constexpr unsigned all_lanes = 0xFFFFFFFFu;
/// New rays are taken when fewer lanes than this are at work (Aila, Laine, Karras 2012: 20 of 32).
inline constexpr int least_active_lanes = 20;

struct StoreHit {
    TreeHit* hits;
    __device__ void operator()(std::uint32_t i, const TreeHit& hit) const { hits[i] = hit; }
};
struct StoreOccluded {
    std::uint8_t* occluded;
    __device__ void operator()(std::uint32_t i, const TreeHit& hit) const {
        occluded[i] = hit.hit();
    }
};

__device__ inline Ray load_ray(const Ray* ray) {
    const float4* from = reinterpret_cast<const float4*>(ray);
    const float4 a = __ldg(from), b = __ldg(from + 1);
    return {{a.x, a.y, a.z}, a.w, {b.x, b.y, b.z}, b.w};
}

template <bool any, int stack_entries, class Store>
__global__ void __launch_bounds__(128)
    cwbvh_rays(CwbvhView tree, const Ray* rays, std::uint32_t count, Store store) {
    const std::uint32_t i = blockIdx.x * blockDim.x + threadIdx.x;
    if (i >= count) return;
    TreeHit hit;
    const Ray given = load_ray(rays + i);
    if (is_valid(given)) {
        CwbvhGroup stack[stack_entries];
        NoCwbvhSteps steps;
        const CwbvhRay ray = make_cwbvh_ray(make_frame(given), tree.bounds);
        hit = public_hit(walk_cwbvh<any>(tree, ray, stack, steps), ray.frame);
    }
    store(i, hit);
}

/// Hands the lanes without a ray the next ones of the pool, in the order of lanes. All lanes of the
/// warp must call it. Returns the lane's ray, or `count` and more when the pool is empty.
__device__ inline std::uint32_t replace_ended(bool ended, std::uint32_t current,
                                              std::uint32_t* next) {
    const unsigned wanting = __ballot_sync(all_lanes, ended);
    const unsigned lane = threadIdx.x % 32;
    std::uint32_t first = 0;
    if (lane == 0) first = claim(*next, static_cast<std::uint32_t>(__popc(wanting)));
    first = __shfl_sync(all_lanes, first, 0);
    const auto rank = static_cast<std::uint32_t>(__popc(wanting & ((1u << lane) - 1u)));
    return ended ? first + rank : current;
}

/// *next counts the rays handed out; 0 at the start. It ends at most 32 a warp past `count`, which
/// is less than 2^31: it cannot wrap.
template <bool any, int stack_entries, class Store>
__global__ void __launch_bounds__(128)
    persistent_cwbvh_rays(CwbvhView tree, const Ray* rays, std::uint32_t count, Store store,
                          std::uint32_t* next) {
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
                const Ray given = load_ray(rays + index);
                if (is_valid(given)) {
                    ray = make_cwbvh_ray(make_frame(given), tree.bounds);
                    best = {ray.frame.tmax};
                    nodes = root_group();
                    top = stack;
                    at_work = true;
                } else {
                    store(index, TreeHit{});
                }
            }
            more = __all_sync(all_lanes, at_work || index < count) != 0;
        }
        if (!more && __any_sync(all_lanes, at_work) == 0) return;
        const int enough = more ? least_active_lanes : 1;
        while (__popc(__ballot_sync(all_lanes, at_work)) >= enough) {
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
                store(index, public_hit(best, ray.frame));
                at_work = false;
            }
        }
    }
}

}  // namespace raydix::kernels
