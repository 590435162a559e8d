// Rays in double through the float nodes of a BvhD.
#include <raydix/double.h>
#include <raydix/error.h>

#include "trace/double_tree.h"
#include "trace/scalar_batch.h"

namespace raydix {

TraceCounts trace(const BvhD& bvh, std::span<const RayD> rays, std::span<HitD> hits,
                  const TraceOptions& options) {
    check_sizes(rays.size(), hits.size());
    return on_threads(options, [&](auto steps) {
        return closest_batch<decltype(steps)>(TriangleTreeD(bvh), rays, hits);
    });
}

std::vector<HitD> trace(const BvhD& bvh, std::span<const RayD> rays, const TraceOptions& options) {
    std::vector<HitD> hits(rays.size());
    trace(bvh, rays, hits, options);
    return hits;
}

TraceCounts trace_any(const BvhD& bvh, std::span<const RayD> rays, std::span<std::uint8_t> occluded,
                      const TraceOptions& options) {
    check_sizes(rays.size(), occluded.size());
    return on_threads(options, [&](auto steps) {
        return any_batch<decltype(steps)>(TriangleTreeD(bvh), rays, occluded);
    });
}

AllHitsD trace_all(const BvhD& bvh, std::span<const RayD> rays, const TraceOptions& options) {
    return on_threads(options, [&](auto steps) {
        return all_batch<AllHitsD, decltype(steps)>(TriangleTreeD(bvh), rays,
                                                    options.max_result_bytes);
    });
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
