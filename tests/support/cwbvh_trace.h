// Rays through a compressed wide tree on the host, one after another: the walk that GPUs take, with
// the signatures of a Bvh's trace() and trace_any().
#pragma once

#include <raydix/cwbvh.h>
#include <raydix/trace.h>

#include <cstdint>
#include <span>
#include <vector>

#include "base/float_env.h"
#include "layout/cwbvh.h"
#include "trace/cwbvh_walk.h"

namespace raydix {

template <bool any, class Store>
TraceCounts walk_all_cwbvh(const Cwbvh& tree, std::span<const Ray> rays, const Store& store) {
    struct Steps {
        TraceCounts& counts;
        void visit() { ++counts.node_visits; }
        void test() { ++counts.triangle_tests; }
    };
    const FloatEnvironment plain;
    const Cwbvh::Arrays& arrays = tree.arrays();
    const CwbvhView view{arrays.nodes.data(), arrays.triangles.data(), arrays.bounds};
    std::vector<CwbvhGroup> stack(tree.stats().max_depth);
    TraceCounts counts;
    counts.rays = rays.size();
    Steps steps{counts};
    for (std::size_t i = 0; i < rays.size(); ++i) {
        TreeHit hit;
        if (!is_valid(rays[i])) {
            ++counts.invalid_rays;
        } else if (!tree.empty()) {
            const CwbvhRay ray = make_cwbvh_ray(make_frame(rays[i]), view.bounds);
            hit = public_hit(walk_cwbvh<any>(view, ray, stack.data(), steps), ray.frame);
        }
        counts.hits += hit.hit();
        store(i, hit);
    }
    return counts;
}

/// The options have no effect; all is counted.
inline TraceCounts trace(const Cwbvh& tree, std::span<const Ray> rays, std::span<Hit> hits,
                         const TraceOptions& = {}) {
    return walk_all_cwbvh<false>(
        tree, rays, [&](std::size_t i, const TreeHit& hit) { hits[i] = hit_of_tree(hit); });
}
inline std::vector<Hit> trace(const Cwbvh& tree, std::span<const Ray> rays) {
    std::vector<Hit> hits(rays.size());
    trace(tree, rays, hits);
    return hits;
}
inline TraceCounts trace_any(const Cwbvh& tree, std::span<const Ray> rays,
                             std::span<std::uint8_t> occluded, const TraceOptions& = {}) {
    return walk_all_cwbvh<true>(
        tree, rays, [&](std::size_t i, const TreeHit& hit) { occluded[i] = hit.hit() ? 1 : 0; });
}

}  // namespace raydix
