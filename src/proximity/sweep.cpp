// Batches of moving balls. Balls without a radius are rays, with the watertight test of rays.
#include <raydix/overlap.h>

#include "base/float_env.h"
#include "proximity/query_batch.h"
#include "proximity/sweep_walk.h"

namespace raydix {
namespace {

SweepHit sweep_as_ray(const TriangleTree& tree, const Ray& ray, WalkStack& stack) {
    const RayFrame frame = make_frame(ray);
    NoSteps steps;
    const ClosestHit hit = find_closest(tree, frame, stack, steps);
    if (hit.prim == no_primitive) return {};
    const LeafTriangle& t = tree.triangles[hit.position];
    const Double3 a(t.v0), b(t.v1), c(t.v2);
    const Double3 at = a + (b - a) * hit.u + (c - a) * hit.v;
    return {hit.t * frame.t_scale, hit.prim, at.rounded(), hit.u, hit.v};
}

SweepHit sweep_one(const TriangleTree& tree, const SphereSweep& sweep, WalkStack& stack) {
    if (sweep.radius == 0.0f) return sweep_as_ray(tree, sweep.path, stack);
    const Contact contact = find_first_contact(tree, sweep, stack);
    if (contact.prim == no_primitive) return {};
    const Vec3 center = path_of(sweep.path).at(contact.t).rounded();
    const TrianglePoint at = closest_on_triangle(tree.triangles[contact.position], center);
    return {contact.t, contact.prim, at.position, at.u, at.v};
}

OverlapCounts sweep_batch(const Bvh& bvh, std::span<const SphereSweep> sweeps,
                          std::span<SweepHit> hits) {
    const TriangleTree tree(bvh);
    std::vector<OverlapCounts> parts(block_count(sweeps.size()));
    for_each_block(sweeps.size(), queries_per_block,
                   [&](std::size_t block, std::size_t begin, std::size_t end) {
                       WalkStack stack(tree.max_depth);
                       for (std::size_t i = begin; i < end; ++i) {
                           hits[i] = {};
                           if (!is_valid(sweeps[i]))
                               ++parts[block].invalid_queries;
                           else if (!tree.empty)
                               hits[i] = sweep_one(tree, sweeps[i], stack);
                           parts[block].found += hits[i].hit();
                       }
                   });
    OverlapCounts sum;
    sum.queries = sweeps.size();
    for (const OverlapCounts& part : parts) {
        sum.found += part.found;
        sum.invalid_queries += part.invalid_queries;
    }
    return sum;
}

}  // namespace

OverlapCounts sweep_spheres(const Bvh& bvh, std::span<const SphereSweep> sweeps,
                            std::span<SweepHit> hits, const OverlapOptions& options) {
    require_triangles(bvh, "sweeps need");
    require_room("sweeps", sweeps.size(), hits.size());
    OverlapCounts counts;
    with_threads(options.threads, [&] { counts = sweep_batch(bvh, sweeps, hits); });
    return counts;
}

std::vector<SweepHit> sweep_spheres(const Bvh& bvh, std::span<const SphereSweep> sweeps,
                                    const OverlapOptions& options) {
    std::vector<SweepHit> hits(sweeps.size());
    sweep_spheres(bvh, sweeps, hits, options);
    return hits;
}

SweepHit sweep_sphere(const Bvh& bvh, const SphereSweep& sweep) {
    require_triangles(bvh, "sweeps need");
    if (bvh.empty() || !is_valid(sweep)) return {};
    const FloatEnvironment plain;
    WalkStack stack(bvh.max_depth());
    return sweep_one(TriangleTree(bvh), sweep, stack);
}

}  // namespace raydix
