// Batches of rays through a compressed wide tree, on threads of the CPU: the kernel `cwbvh`.
#include <raydix/cwbvh.h>
#include <raydix/error.h>

#include <string>

#include "base/check.h"
#include "exec/parallel.h"
#include "trace/batch.h"
#include "trace/cwbvh_walk.h"

namespace raydix {
namespace {

constexpr std::size_t rays_per_block = 1024;

struct CountedSteps {
    std::uint64_t visits = 0, tests = 0;
    void visit() { ++visits; }
    void test() { ++tests; }
};

void count_steps(TraceCounts&, const NoCwbvhSteps&) {}
void count_steps(TraceCounts& counts, const CountedSteps& steps) {
    counts.node_visits += steps.visits;
    counts.triangle_tests += steps.tests;
}

/// store(i, hit) for each ray; a miss for invalid ones.
template <bool any, class Steps, class Store>
TraceCounts trace_block(const CwbvhView& view, const Cwbvh& tree, std::span<const Ray> rays,
                        std::size_t begin, const Store& store) {
    std::vector<CwbvhGroup> stack(tree.stats().max_depth);
    TraceCounts counts;
    counts.rays = rays.size();
    Steps steps;
    for (std::size_t i = 0; i < rays.size(); ++i) {
        TreeHit hit;
        if (!is_valid(rays[i])) {
            ++counts.invalid_rays;
        } else if (!tree.empty()) {
            const CwbvhRay ray = make_cwbvh_ray(make_frame(rays[i]), view.bounds);
            hit = public_hit(walk_cwbvh<any>(view, ray, stack.data(), steps), ray.frame);
        }
        counts.hits += hit.hit();
        store(begin + i, hit);
    }
    count_steps(counts, steps);
    return counts;
}

/// Blocks are fixed, so that counts do not depend on the number of threads.
template <bool any, class Store>
TraceCounts trace_batch(const Cwbvh& tree, std::span<const Ray> rays, const TraceOptions& options,
                        const Store& store) {
    check_options(options);
    const Cwbvh::Arrays& arrays = tree.arrays();
    const CwbvhView view{arrays.nodes.data(), arrays.triangles.data(), arrays.bounds};
    std::vector<TraceCounts> parts((rays.size() + rays_per_block - 1) / rays_per_block);
    with_threads(options.threads, [&] {
        for_each_block(rays.size(), rays_per_block,
                       [&](std::size_t block, std::size_t begin, std::size_t end) {
                           const auto some = rays.subspan(begin, end - begin);
                           parts[block] =
                               options.counters
                                   ? trace_block<any, CountedSteps>(view, tree, some, begin, store)
                                   : trace_block<any, NoCwbvhSteps>(view, tree, some, begin, store);
                       });
    });
    TraceCounts sum;
    for (const TraceCounts& part : parts) add(sum, part);
    return sum;
}

}  // namespace

TraceCounts trace(const Cwbvh& tree, std::span<const Ray> rays, std::span<Hit> hits,
                  const TraceOptions& options) {
    check_sizes(rays.size(), hits.size());
    return trace_batch<false>(tree, rays, options, [&](std::size_t i, const TreeHit& hit) {
        hits[i] = hit_of_tree(hit);
    });
}

std::vector<Hit> trace(const Cwbvh& tree, std::span<const Ray> rays, const TraceOptions& options) {
    std::vector<Hit> hits(rays.size());
    trace(tree, rays, hits, options);
    return hits;
}

TraceCounts trace_any(const Cwbvh& tree, std::span<const Ray> rays,
                      std::span<std::uint8_t> occluded, const TraceOptions& options) {
    check_sizes(rays.size(), occluded.size());
    return trace_batch<true>(tree, rays, options, [&](std::size_t i, const TreeHit& hit) {
        occluded[i] = hit.hit() ? 1 : 0;
    });
}

}  // namespace raydix
