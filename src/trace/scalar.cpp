// Batches of rays over threads, each ray by walk_tree. Blocks of rays are fixed, so that counts and
// the order of all-hits results do not depend on the number of threads.
#include "trace/scalar.h"

#include <raydix/error.h>
#include <raydix/trace.h>

#include <string>

#include "exec/parallel.h"
#include "trace/all_hits.h"
#include "trace/batch.h"
#include "trace/tree_hits.h"

namespace raydix {
namespace {

constexpr std::size_t rays_per_block = 1024;

TriangleTree view_of(const Bvh& bvh) {
    if (bvh.kind() != PrimitiveKind::triangles && !bvh.empty())
        throw InputError(std::string("rays need triangles; this tree holds ") +
                         (bvh.kind() == PrimitiveKind::points ? "points" : "boxes"));
    return TriangleTree(bvh);
}

template <class Steps>
void find_all(const TriangleTree& tree, const RayFrame& ray, WalkStack& stack, Steps& steps,
              std::vector<Hit>& hits) {
    const std::size_t before = hits.size();
    const auto leaf = [&](const BvhNode& node) {
        for (std::uint32_t k = node.first; k < node.first + node.count; ++k) {
            TriangleHit hit;
            count_test(steps);
            if (intersect_triangle<EdgeRule::half_open>(ray, tree.triangles[k], ray.tmax, hit))
                hits.push_back({hit.t * ray.t_scale, tree.order[k], hit.u, hit.v});
        }
        return false;
    };
    walk_tree(tree.nodes, ray, stack, steps, leaf, [&] { return ray.tmax; });
    finish_ray(hits, before);
}

Hit public_hit(const ClosestHit& best, const RayFrame& ray) {
    return best.prim == no_primitive ? Hit{} : Hit{best.t * ray.t_scale, best.prim, best.u, best.v};
}

/// Calls one(i, frame, stack, steps) -> number of hits for each valid ray and miss(i) for each
/// other one.
template <class Steps, class One, class Miss>
TraceCounts for_each_ray(const TriangleTree& tree, std::span<const Ray> rays, const One& one,
                         const Miss& miss) {
    std::vector<TraceCounts> parts((rays.size() + rays_per_block - 1) / rays_per_block);
    for_each_block(rays.size(), rays_per_block,
                   [&](std::size_t block, std::size_t begin, std::size_t end) {
                       WalkStack stack(tree.max_depth);
                       TraceCounts part;
                       part.rays = end - begin;
                       for (std::size_t i = begin; i < end; ++i) {
                           if (!is_valid(rays[i])) {
                               ++part.invalid_rays;
                               miss(i);
                           } else if (tree.empty) {
                               miss(i);
                           } else {
                               Steps steps;
                               part.hits += one(i, make_frame(rays[i]), stack, steps);
                               if constexpr (std::is_same_v<Steps, RaySteps>) {
                                   part.node_visits += steps.node_visits;
                                   part.triangle_tests += steps.triangle_tests;
                               }
                           }
                       }
                       parts[block] = part;
                   });
    TraceCounts sum;
    for (const TraceCounts& part : parts) add(sum, part);
    return sum;
}

template <class Steps>
TraceCounts closest_batch(const Bvh& bvh, std::span<const Ray> rays, std::span<Hit> hits) {
    const TriangleTree tree = view_of(bvh);
    return for_each_ray<Steps>(
        tree, rays,
        [&](std::size_t i, const RayFrame& ray, WalkStack& stack, Steps& steps) {
            hits[i] = public_hit(find_closest(tree, ray, stack, steps), ray);
            return std::uint64_t{hits[i].hit()};
        },
        [&](std::size_t i) { hits[i] = Hit{}; });
}

template <class Steps>
TraceCounts any_batch(const Bvh& bvh, std::span<const Ray> rays, std::span<std::uint8_t> occluded) {
    const TriangleTree tree = view_of(bvh);
    return for_each_ray<Steps>(
        tree, rays,
        [&](std::size_t i, const RayFrame& ray, WalkStack& stack, Steps& steps) {
            occluded[i] = find_any(tree, ray, stack, steps);
            return std::uint64_t{occluded[i]};
        },
        [&](std::size_t i) { occluded[i] = 0; });
}

template <class Steps>
AllHits all_batch(const Bvh& bvh, std::span<const Ray> rays) {
    const TriangleTree tree = view_of(bvh);
    std::vector<std::vector<Hit>> found((rays.size() + rays_per_block - 1) / rays_per_block);
    AllHits all;
    all.offsets.resize(rays.size() + 1, 0);
    all.counts = for_each_ray<Steps>(
        tree, rays,
        [&](std::size_t i, const RayFrame& ray, WalkStack& stack, Steps& steps) {
            std::vector<Hit>& block = found[i / rays_per_block];
            const std::size_t before = block.size();
            find_all(tree, ray, stack, steps, block);
            all.offsets[i + 1] = block.size() - before;
            return all.offsets[i + 1];
        },
        [](std::size_t) {});
    join_blocks(found, rays_per_block, all);
    return all;
}

}  // namespace

TraceCounts trace(const Bvh& bvh, std::span<const Ray> rays, std::span<Hit> hits,
                  const TraceOptions& options) {
    check_sizes(rays.size(), hits.size());
    TraceCounts counts;
    with_threads(options.threads, [&] {
        counts = options.counters ? closest_batch<RaySteps>(bvh, rays, hits)
                                  : closest_batch<NoSteps>(bvh, rays, hits);
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
    TraceCounts counts;
    with_threads(options.threads, [&] {
        counts = options.counters ? any_batch<RaySteps>(bvh, rays, occluded)
                                  : any_batch<NoSteps>(bvh, rays, occluded);
    });
    return counts;
}

AllHits trace_all(const Bvh& bvh, std::span<const Ray> rays, const TraceOptions& options) {
    AllHits all;
    with_threads(options.threads, [&] {
        all = options.counters ? all_batch<RaySteps>(bvh, rays) : all_batch<NoSteps>(bvh, rays);
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
                hits[i] = public_hit(find_closest(tree, ray, stack, own), ray);
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
                hits[i] = public_hit(best, ray);
                hits[i].prim = best.position;
                return std::uint64_t{hits[i].hit()};
            },
            [&](std::size_t i) { hits[i] = Hit{}; });
    });
    return counts;
}

}  // namespace raydix
