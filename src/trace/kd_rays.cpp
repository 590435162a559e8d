// Batches of rays over threads, each through the k-d tree by walk_kd_tree. The triangle test is the
// one of every kernel, so hits equal those of a BVH bit for bit.
#include <raydix/error.h>
#include <raydix/kdtree.h>

#include <string>

#include "exec/parallel.h"
#include "trace/batch.h"
#include "trace/kd_walk.h"
#include "trace/triangle_test.h"

namespace raydix {
namespace {

constexpr std::size_t rays_per_block = 1024;

template <class Steps>
void count_test(Steps& steps) {
    if constexpr (!std::is_same_v<Steps, NoSteps>) ++steps.triangle_tests;
}

/// Writes the closest hit, in the caller's units of t.
template <class Steps>
bool find_closest(const KdTreeView& tree, const LeafTriangle* triangles, const RayFrame& ray,
                  KdStack<KdRayPart>& stack, Steps& steps, Hit& result) {
    TreeHit best{ray.tmax, no_primitive, 0.0f, 0.0f};
    const auto leaf = [&](const KdNode& node) {
        for (std::uint32_t i = node.first; i < node.first + node.count(); ++i) {
            TriangleHit hit;
            count_test(steps);
            if (!intersect_triangle<EdgeRule::closed>(ray, triangles[i], best.t, hit)) continue;
            // At equal t the lower primitive id wins, whatever order the leaves come in.
            if (hit.t < best.t || tree.order[i] < best.prim)
                best = {hit.t, tree.order[i], hit.u, hit.v};
        }
        return false;
    };
    walk_kd_tree(tree, ray, stack, steps, leaf, [&] { return best.t; });
    best.t *= ray.t_scale;
    result = best.hit() ? hit_of_tree(best) : Hit{};
    return best.hit();
}

template <class Steps>
bool find_any(const KdTreeView& tree, const LeafTriangle* triangles, const RayFrame& ray,
              KdStack<KdRayPart>& stack, Steps& steps) {
    bool found = false;
    const auto leaf = [&](const KdNode& node) {
        for (std::uint32_t i = node.first; i < node.first + node.count() && !found; ++i) {
            TriangleHit hit;
            count_test(steps);
            found = intersect_triangle<EdgeRule::closed>(ray, triangles[i], ray.tmax, hit);
        }
        return found;
    };
    walk_kd_tree(tree, ray, stack, steps, leaf, [&] { return ray.tmax; });
    return found;
}

/// Calls one(i, frame, stack, steps) -> whether ray i hits, for each valid ray of a tree that is
/// not empty, and miss(i) for the others.
template <class Steps, class One, class Miss>
TraceCounts for_each_ray(const KdTreeView& tree, std::span<const Ray> rays, const One& one,
                         const Miss& miss) {
    std::vector<TraceCounts> parts((rays.size() + rays_per_block - 1) / rays_per_block);
    for_each_block(rays.size(), rays_per_block,
                   [&](std::size_t block, std::size_t begin, std::size_t end) {
                       KdStack<KdRayPart> stack(tree.max_depth);
                       TraceCounts part;
                       for (std::size_t i = begin; i < end; ++i) {
                           Steps steps;
                           const bool valid = is_valid(rays[i]);
                           if (!valid) ++part.invalid_rays;
                           if (valid && !tree.empty)
                               part.hits += one(i, make_frame(rays[i]), stack, steps);
                           else
                               miss(i);
                           if constexpr (std::is_same_v<Steps, RaySteps>) {
                               part.node_visits += steps.node_visits;
                               part.triangle_tests += steps.triangle_tests;
                           }
                       }
                       parts[block] = part;
                   });
    TraceCounts sum;
    sum.rays = rays.size();
    for (const TraceCounts& part : parts) {
        sum.hits += part.hits;
        sum.invalid_rays += part.invalid_rays;
        sum.node_visits += part.node_visits;
        sum.triangle_tests += part.triangle_tests;
    }
    return sum;
}

template <class Steps>
TraceCounts closest_batch(const KdTree& tree, std::span<const Ray> rays, std::span<Hit> hits) {
    const KdTreeView view(tree);
    const LeafTriangle* triangles = tree.triangles().data();
    return for_each_ray<Steps>(
        view, rays,
        [&](std::size_t i, const RayFrame& ray, KdStack<KdRayPart>& stack, Steps& steps) {
            return find_closest(view, triangles, ray, stack, steps, hits[i]);
        },
        [&](std::size_t i) { hits[i] = Hit{}; });
}

template <class Steps>
TraceCounts any_batch(const KdTree& tree, std::span<const Ray> rays,
                      std::span<std::uint8_t> occluded) {
    const KdTreeView view(tree);
    const LeafTriangle* triangles = tree.triangles().data();
    return for_each_ray<Steps>(
        view, rays,
        [&](std::size_t i, const RayFrame& ray, KdStack<KdRayPart>& stack, Steps& steps) {
            occluded[i] = find_any(view, triangles, ray, stack, steps) ? 1 : 0;
            return occluded[i] != 0;
        },
        [&](std::size_t i) { occluded[i] = 0; });
}

void check_call(const KdTree& tree, std::size_t rays, std::size_t results,
                const TraceOptions& options) {
    check_options(options);
    if (rays != results)
        throw InputError("kd_trace: " + std::to_string(rays) + " rays, but room for " +
                         std::to_string(results) + " results");
    if (tree.kind() != PrimitiveKind::triangles && !tree.empty())
        throw InputError("rays need triangles; this tree holds points");
}

}  // namespace

TraceCounts kd_trace(const KdTree& tree, std::span<const Ray> rays, std::span<Hit> hits,
                     const TraceOptions& options) {
    check_call(tree, rays.size(), hits.size(), options);
    TraceCounts counts;
    with_threads(options.threads, [&] {
        counts = options.counters ? closest_batch<RaySteps>(tree, rays, hits)
                                  : closest_batch<NoSteps>(tree, rays, hits);
    });
    return counts;
}

std::vector<Hit> kd_trace(const KdTree& tree, std::span<const Ray> rays,
                          const TraceOptions& options) {
    std::vector<Hit> hits(rays.size());
    kd_trace(tree, rays, hits, options);
    return hits;
}

TraceCounts kd_trace_any(const KdTree& tree, std::span<const Ray> rays,
                         std::span<std::uint8_t> occluded, const TraceOptions& options) {
    check_call(tree, rays.size(), occluded.size(), options);
    TraceCounts counts;
    with_threads(options.threads, [&] {
        counts = options.counters ? any_batch<RaySteps>(tree, rays, occluded)
                                  : any_batch<NoSteps>(tree, rays, occluded);
    });
    return counts;
}

}  // namespace raydix
