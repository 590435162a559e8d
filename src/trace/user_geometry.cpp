// Rays through boxes with a function of the caller's.
#include <raydix/user_geometry.h>

#include <vector>

#include "base/float_env.h"
#include "exec/parallel.h"
#include "trace/batch.h"
#include "trace/walk.h"

namespace raydix {
namespace {

constexpr std::size_t rays_per_block = 256;
/// Nodes are entered up to here beyond the best hit, since the function's arithmetic is not that of
/// the boxes.
constexpr float reach_factor = 1.0f + 0x1p-16f;

/// One ray through the tree.
class UserWalk {
public:
    UserWalk(const Bvh& bvh, const IntersectPrimitive& intersect, bool any)
        : bvh_(bvh), intersect_(intersect), any_(any), stack_(bvh.max_depth()) {}

    /// `ray` must be valid, the tree not empty.
    Hit run(Ray ray, TraceCounts& counts) {
        const RayFrame frame = make_frame(ray);
        ray.tmin = max_of(ray.tmin, 0.0f);
        Hit best{ray.tmax};
        NoSteps steps;
        const auto leaf = [&](const BvhNode& node) {
            for (std::uint32_t k = node.first; k < node.first + node.count; ++k) {
                const std::uint32_t prim = bvh_.order()[k];
                Hit hit;
                ++counts.triangle_tests;
                if (!intersect_(prim, ray, hit) || !(hit.t >= ray.tmin && hit.t <= best.t))
                    continue;
                if (hit.t == best.t && prim > best.prim) continue;
                best = {hit.t, prim, hit.u, hit.v};
                ray.tmax = hit.t;
                if (any_) return true;
            }
            return false;
        };
        walk_tree(bvh_.nodes().data(), frame, stack_, steps, leaf, [&] {
            return min_of(best.t / frame.t_scale * reach_factor, std::numeric_limits<float>::max());
        });
        return best.hit() ? best : Hit{};
    }

private:
    const Bvh& bvh_;
    const IntersectPrimitive& intersect_;
    bool any_;
    WalkStack stack_;
};

template <class One>
TraceCounts for_each_ray(const Bvh& bvh, const IntersectPrimitive& intersect,
                         std::span<const Ray> rays, bool any, const TraceOptions& options,
                         const One& one) {
    std::vector<TraceCounts> parts((rays.size() + rays_per_block - 1) / rays_per_block);
    with_threads(options.threads, [&] {
        for_each_block(rays.size(), rays_per_block,
                       [&](std::size_t block, std::size_t begin, std::size_t end) {
                           UserWalk walk(bvh, intersect, any);
                           TraceCounts part;
                           part.rays = end - begin;
                           for (std::size_t i = begin; i < end; ++i) {
                               Hit hit;
                               if (!is_valid(rays[i]))
                                   ++part.invalid_rays;
                               else if (!bvh.empty())
                                   hit = walk.run(rays[i], part);
                               part.hits += hit.hit();
                               one(i, hit);
                           }
                           if (!options.counters) part.triangle_tests = 0;
                           parts[block] = part;
                       });
    });
    TraceCounts sum;
    for (const TraceCounts& part : parts) add(sum, part);
    return sum;
}

Hit one_hit(const Bvh& bvh, const IntersectPrimitive& intersect, const Ray& ray, bool any) {
    if (bvh.empty() || !is_valid(ray)) return {};
    const FloatEnvironment plain;
    TraceCounts counts;
    return UserWalk(bvh, intersect, any).run(ray, counts);
}

}  // namespace

TraceCounts trace(const Bvh& boxes, const IntersectPrimitive& intersect, std::span<const Ray> rays,
                  std::span<Hit> hits, const TraceOptions& options) {
    check_sizes(rays.size(), hits.size());
    return for_each_ray(boxes, intersect, rays, false, options,
                        [&](std::size_t i, const Hit& hit) { hits[i] = hit; });
}

TraceCounts trace_any(const Bvh& boxes, const IntersectPrimitive& intersect,
                      std::span<const Ray> rays, std::span<std::uint8_t> occluded,
                      const TraceOptions& options) {
    check_sizes(rays.size(), occluded.size());
    return for_each_ray(boxes, intersect, rays, true, options,
                        [&](std::size_t i, const Hit& hit) { occluded[i] = hit.hit(); });
}

Hit closest_hit(const Bvh& boxes, const IntersectPrimitive& intersect, const Ray& ray) {
    return one_hit(boxes, intersect, ray, false);
}

bool any_hit(const Bvh& boxes, const IntersectPrimitive& intersect, const Ray& ray) {
    return one_hit(boxes, intersect, ray, true).hit();
}

}  // namespace raydix
