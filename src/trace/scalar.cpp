// Rays in float through the binary tree: what is public, and what tests ask besides.
#include "trace/scalar.h"

#include <raydix/error.h>
#include <raydix/trace.h>

#include <string>

#include "exec/parallel.h"
#include "trace/scalar_batch.h"

namespace raydix {
namespace {

TriangleTree view_of(const Bvh& bvh) {
    if (bvh.kind() != PrimitiveKind::triangles && !bvh.empty())
        throw InputError(std::string("rays need triangles; this tree holds ") +
                         (bvh.kind() == PrimitiveKind::points ? "points" : "boxes"));
    return TriangleTree(bvh);
}

}  // namespace

TraceCounts trace(const Bvh& bvh, std::span<const Ray> rays, std::span<Hit> hits,
                  const TraceOptions& options) {
    check_sizes(rays.size(), hits.size());
    check_options(options);
    TraceCounts counts;
    with_threads(options.threads, [&] {
        const TriangleTree tree = view_of(bvh);
        counts = options.counters ? closest_batch<RaySteps>(tree, rays, hits)
                                  : closest_batch<NoSteps>(tree, rays, hits);
    });
    return counts;
}

std::vector<Hit> trace(const Bvh& bvh, std::span<const Ray> rays, const TraceOptions& options) {
    std::vector<Hit> hits(rays.size());
    trace(bvh, rays, hits, options);
    return hits;
}

TraceCounts trace_any(const Bvh& bvh, std::span<const Ray> rays, std::span<std::uint8_t> occluded,
                      const TraceOptions& options) {
    check_sizes(rays.size(), occluded.size());
    check_options(options);
    TraceCounts counts;
    with_threads(options.threads, [&] {
        const TriangleTree tree = view_of(bvh);
        counts = options.counters ? any_batch<RaySteps>(tree, rays, occluded)
                                  : any_batch<NoSteps>(tree, rays, occluded);
    });
    return counts;
}

AllHits trace_all(const Bvh& bvh, std::span<const Ray> rays, const TraceOptions& options) {
    check_options(options);
    AllHits all;
    with_threads(options.threads, [&] {
        const TriangleTree tree = view_of(bvh);
        all = options.counters ? all_batch<AllHits, RaySteps>(tree, rays, options.max_result_bytes)
                               : all_batch<AllHits, NoSteps>(tree, rays, options.max_result_bytes);
    });
    return all;
}

Hit closest_hit(const Bvh& bvh, const Ray& ray) {
    Hit hit;
    trace(bvh, std::span(&ray, 1), std::span(&hit, 1), {.threads = 1});
    return hit;
}

bool any_hit(const Bvh& bvh, const Ray& ray) {
    std::uint8_t occluded = 0;
    trace_any(bvh, std::span(&ray, 1), std::span(&occluded, 1), {.threads = 1});
    return occluded != 0;
}

TraceCounts trace_steps(const Bvh& bvh, std::span<const Ray> rays, std::span<Hit> hits,
                        std::span<RaySteps> steps, int threads) {
    check_sizes(rays.size(), hits.size());
    check_sizes(rays.size(), steps.size());
    const TriangleTree tree = view_of(bvh);
    TraceCounts counts;
    with_threads(threads, [&] {
        counts = for_each_ray<RaySteps>(
            tree, rays,
            [&](std::size_t i, const RayFrame& ray, WalkStack& stack, RaySteps& own) {
                hits[i] = public_hit<Hit>(find_closest(tree, ray, stack, own), ray);
                steps[i] = own;
                return std::uint64_t{hits[i].hit()};
            },
            [&](std::size_t i) {
                hits[i] = Hit{};
                steps[i] = RaySteps{};
            });
    });
    return counts;
}

TraceCounts trace_leaf_positions(const Bvh& bvh, std::span<const Ray> rays, std::span<Hit> hits,
                                 int threads) {
    check_sizes(rays.size(), hits.size());
    const TriangleTree tree = view_of(bvh);
    TraceCounts counts;
    with_threads(threads, [&] {
        counts = for_each_ray<NoSteps>(
            tree, rays,
            [&](std::size_t i, const RayFrame& ray, WalkStack& stack, NoSteps& steps) {
                const ClosestHit best = find_closest(tree, ray, stack, steps);
                hits[i] = public_hit<Hit>(best, ray);
                hits[i].prim = best.position;
                return std::uint64_t{hits[i].hit()};
            },
            [&](std::size_t i) { hits[i] = Hit{}; });
    });
    return counts;
}

}  // namespace raydix
