// Rays in double through the float nodes of a BvhD.
#include <raydix/double.h>
#include <raydix/error.h>

#include "trace/double_tree.h"
#include "trace/scalar_batch.h"

namespace raydix {

TraceCounts trace(const BvhD& bvh, std::span<const RayD> rays, std::span<HitD> hits,
                  const TraceOptions& options) {
    check_sizes(rays.size(), hits.size());
    check_options(options);
    TraceCounts counts;
    with_threads(options.threads, [&] {
        const TriangleTreeD tree(bvh);
        counts = options.counters ? closest_batch<RaySteps>(tree, rays, hits)
                                  : closest_batch<NoSteps>(tree, rays, hits);
    });
    return counts;
}

std::vector<HitD> trace(const BvhD& bvh, std::span<const RayD> rays, const TraceOptions& options) {
    std::vector<HitD> hits(rays.size());
    trace(bvh, rays, hits, options);
    return hits;
}

TraceCounts trace_any(const BvhD& bvh, std::span<const RayD> rays, std::span<std::uint8_t> occluded,
                      const TraceOptions& options) {
    check_sizes(rays.size(), occluded.size());
    check_options(options);
    TraceCounts counts;
    with_threads(options.threads, [&] {
        const TriangleTreeD tree(bvh);
        counts = options.counters ? any_batch<RaySteps>(tree, rays, occluded)
                                  : any_batch<NoSteps>(tree, rays, occluded);
    });
    return counts;
}

AllHitsD trace_all(const BvhD& bvh, std::span<const RayD> rays, const TraceOptions& options) {
    check_options(options);
    AllHitsD all;
    with_threads(options.threads, [&] {
        const TriangleTreeD tree(bvh);
        all = options.counters ? all_batch<AllHitsD, RaySteps>(tree, rays, options.max_result_bytes)
                               : all_batch<AllHitsD, NoSteps>(tree, rays, options.max_result_bytes);
    });
    return all;
}

HitD closest_hit(const BvhD& bvh, const RayD& ray) {
    HitD hit;
    trace(bvh, std::span(&ray, 1), std::span(&hit, 1), {.threads = 1});
    return hit;
}

bool any_hit(const BvhD& bvh, const RayD& ray) {
    std::uint8_t occluded = 0;
    trace_any(bvh, std::span(&ray, 1), std::span(&occluded, 1), {.threads = 1});
    return occluded != 0;
}

}  // namespace raydix
