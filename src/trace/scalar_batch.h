// Batches of rays over threads, each ray by the walk of its tree: binary, in float or in double, or
// a k-d tree. Blocks of rays are fixed, so that counts and the order of all-hits results do not
// depend on the number of threads.
#pragma once

#include <raydix/trace.h>

#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>
#include <vector>

#include "exec/parallel.h"
#include "trace/all_hits.h"
#include "trace/batch.h"
#include "trace/scalar.h"
#include "trace/tree_hits.h"

namespace raydix {

inline constexpr std::size_t rays_per_block = 1024;

template <class AnyHit, class Scalar>
AnyHit public_hit(const BasicClosestHit<Scalar>& best, const BasicRayFrame<Scalar>& ray) {
    if (best.prim == no_primitive) return {};
    return hit_in_tree<AnyHit>(best.t * ray.t_scale, best.prim, best.u, best.v);
}

/// What a walk of the tree keeps.
template <class Tree>
BasicWalkStack<typename Tree::Scalar> stack_of(const Tree& tree) {
    return BasicWalkStack<typename Tree::Scalar>(tree.max_depth);
}

/// What `batch(steps)` gives, on the threads of `options`. Which steps are counted, if any, is told
/// by the type of `steps`.
template <class Batch>
auto on_threads(const TraceOptions& options, const Batch& batch) {
    check_options(options);
    decltype(batch(NoSteps())) result;
    with_threads(options.threads,
                 [&] { result = options.counters ? batch(RaySteps()) : batch(NoSteps()); });
    return result;
}

/// Calls one(i, frame, stack, steps) -> number of hits for each valid ray and miss(i) for each
/// other one; done(b) after those of block b.
template <class Steps, class Tree, class AnyRay, class One, class Miss, class Done>
TraceCounts for_each_ray(const Tree& tree, std::span<const AnyRay> rays, const One& one,
                         const Miss& miss, const Done& done) {
    std::vector<TraceCounts> parts((rays.size() + rays_per_block - 1) / rays_per_block);
    for_each_block(rays.size(), rays_per_block,
                   [&](std::size_t block, std::size_t begin, std::size_t end) {
                       auto stack = stack_of(tree);
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
                       done(block);
                   });
    TraceCounts sum;
    for (const TraceCounts& part : parts) add(sum, part);
    return sum;
}

template <class Steps, class Tree, class AnyRay, class One, class Miss>
TraceCounts for_each_ray(const Tree& tree, std::span<const AnyRay> rays, const One& one,
                         const Miss& miss) {
    return for_each_ray<Steps>(tree, rays, one, miss, [](std::size_t) {});
}

template <class Steps, class Tree, class AnyRay, class AnyHit>
TraceCounts closest_batch(const Tree& tree, std::span<const AnyRay> rays, std::span<AnyHit> hits) {
    return for_each_ray<Steps>(
        tree, rays,
        [&](std::size_t i, const auto& ray, auto& stack, Steps& steps) {
            hits[i] = public_hit<AnyHit>(find_closest(tree, ray, stack, steps), ray);
            return std::uint64_t{hits[i].hit()};
        },
        [&](std::size_t i) { hits[i] = AnyHit{}; });
}

template <class Steps, class Tree, class AnyRay>
TraceCounts any_batch(const Tree& tree, std::span<const AnyRay> rays,
                      std::span<std::uint8_t> occluded) {
    return for_each_ray<Steps>(
        tree, rays,
        [&](std::size_t i, const auto& ray, auto& stack, Steps& steps) {
            occluded[i] = find_any(tree, ray, stack, steps);
            return std::uint64_t{occluded[i]};
        },
        [&](std::size_t i) { occluded[i] = 0; });
}

/// All: AllHits or AllHitsD.
template <class All, class Steps, class Tree, class AnyRay>
All all_batch(const Tree& tree, std::span<const AnyRay> rays, std::uint64_t max_result_bytes) {
    HitBlocks<All> found(rays.size(), rays_per_block, max_result_bytes);
    std::uint64_t* const hit_counts = found.hit_counts();
    const TraceCounts counts = for_each_ray<Steps>(
        tree, rays,
        [&](std::size_t i, const auto& ray, auto& stack, Steps& steps) {
            auto& block = found.hits(i / rays_per_block);
            const std::size_t before = block.size();
            find_all(tree, ray, stack, steps, [&](auto t, std::uint32_t k, auto u, auto v) {
                block.push_back(
                    hit_in_tree<typename decltype(All::hits)::value_type>(t, tree.order[k], u, v));
            });
            finish_ray(block, before);
            return hit_counts[i] = block.size() - before;
        },
        [](std::size_t) {}, [&](std::size_t block) { found.finish(block); });
    All all = found.join();
    all.counts = counts;
    return all;
}

}  // namespace raydix
