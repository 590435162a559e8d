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
    return on_threads(options, [&](auto steps) {
        return closest_batch<decltype(steps)>(view_of(bvh), rays, hits);
    });
}

std::vector<Hit> trace(const Bvh& bvh, std::span<const Ray> rays, const TraceOptions& options) {
    std::vector<Hit> hits(rays.size());
    trace(bvh, rays, hits, options);
    return hits;
}

TraceCounts trace_any(const Bvh& bvh, std::span<const Ray> rays, std::span<std::uint8_t> occluded,
                      const TraceOptions& options) {
    check_sizes(rays.size(), occluded.size());
    return on_threads(options, [&](auto steps) {
        return any_batch<decltype(steps)>(view_of(bvh), rays, occluded);
    });
}

AllHits trace_all(const Bvh& bvh, std::span<const Ray> rays, const TraceOptions& options) {
    return on_threads(options, [&](auto steps) {
        return all_batch<AllHits, decltype(steps)>(view_of(bvh), rays, options.max_result_bytes);
    });
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
