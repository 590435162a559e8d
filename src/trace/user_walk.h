// Rays through a tree of boxes with a function of the caller's, in float and in double. Tree: what
// a walk reads; it names the types that go with it and says how early boxes are entered.
#pragma once

#include <raydix/trace.h>

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "base/float_env.h"
#include "exec/parallel.h"
#include "trace/batch.h"
#include "trace/walk.h"

namespace raydix {

/// Long directions are scaled down, and a t there may be beyond all numbers where the
/// caller's is not: four times as long, none is.
template <class Frame>
Frame frame_with_room(Frame frame) {
    if (!(frame.t_scale < 1)) return frame;
    frame.direction = frame.direction * 4;
    frame.inverse = frame.inverse * decltype(frame.tmin)(0.25);
    frame.tmin /= 4;
    frame.tmax /= 4;
    frame.t_scale *= 4;
    return frame;
}

/// One ray at a time.
template <class Tree>
class UserWalk {
public:
    using Scalar = typename Tree::Scalar;
    using AnyRay = typename Tree::AnyRay;
    using AnyHit = typename Tree::AnyHit;
    using Intersect = typename Tree::Intersect;

    UserWalk(const Tree& tree, const Intersect& intersect, bool any)
        : tree_(tree), intersect_(intersect), any_(any), stack_(tree.max_depth) {}

    /// `ray` must be valid, the tree not empty.
    AnyHit run(AnyRay ray, TraceCounts& counts) {
        const auto frame = frame_with_room(make_frame(ray));
        ray.tmin = max_of(ray.tmin, Scalar(0)) + Scalar(0);  // -0 becomes +0
        AnyHit best;
        best.t = ray.tmax;
        NoSteps steps;
        const auto leaf = [&](const BvhNode& node) {
            for (std::uint32_t k = node.first; k < node.first + node.count; ++k) {
                const std::uint32_t prim = tree_.order[k];
                AnyHit hit;
                ++counts.triangle_tests;
                constexpr Scalar farthest = std::numeric_limits<Scalar>::max();
                if (!intersect_(prim, ray, hit) ||
                    !(hit.t >= ray.tmin && hit.t <= min_of(best.t, farthest)))
                    continue;
                if (hit.t == best.t && prim > best.prim) continue;
                best = hit_in_tree<AnyHit>(hit.t + Scalar(0), prim, hit.u, hit.v);
                ray.tmax = best.t;
                if (any_) return true;
            }
            return false;
        };
        walk_slabs(tree_.nodes, tree_.slabs(frame), tree_.enter_from(frame.tmin), stack_, steps,
                   leaf, [&] {
                       return min_of(best.t / frame.t_scale * Tree::reach_factor,
                                     std::numeric_limits<Scalar>::max());
                   });
        return best.hit() ? best : AnyHit{};
    }

private:
    const Tree& tree_;
    const Intersect& intersect_;
    bool any_;
    BasicWalkStack<Scalar> stack_;
};

/// Calls one(i, hit) for each ray; invalid ones miss.
template <class Tree, class One>
TraceCounts trace_user_rays(const Tree& tree, const typename Tree::Intersect& intersect,
                            std::span<const typename Tree::AnyRay> rays, bool any,
                            const TraceOptions& options, const One& one) {
    check_options(options);
    constexpr std::size_t rays_per_block = 256;
    std::vector<TraceCounts> parts((rays.size() + rays_per_block - 1) / rays_per_block);
    with_threads(options.threads, [&] {
        for_each_block(rays.size(), rays_per_block,
                       [&](std::size_t block, std::size_t begin, std::size_t end) {
                           UserWalk walk(tree, intersect, any);
                           TraceCounts part;
                           part.rays = end - begin;
                           for (std::size_t i = begin; i < end; ++i) {
                               typename Tree::AnyHit hit;
                               if (!is_valid(rays[i]))
                                   ++part.invalid_rays;
                               else if (!tree.empty)
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

template <class Tree>
TraceCounts trace_user(const Tree& tree, const typename Tree::Intersect& intersect,
                       std::span<const typename Tree::AnyRay> rays,
                       std::span<typename Tree::AnyHit> hits, const TraceOptions& options) {
    check_sizes(rays.size(), hits.size());
    return trace_user_rays(tree, intersect, rays, false, options,
                           [&](std::size_t i, const auto& hit) { hits[i] = hit; });
}

template <class Tree>
TraceCounts trace_any_user(const Tree& tree, const typename Tree::Intersect& intersect,
                           std::span<const typename Tree::AnyRay> rays,
                           std::span<std::uint8_t> occluded, const TraceOptions& options) {
    check_sizes(rays.size(), occluded.size());
    return trace_user_rays(tree, intersect, rays, true, options,
                           [&](std::size_t i, const auto& hit) { occluded[i] = hit.hit(); });
}

template <class Tree>
typename Tree::AnyHit trace_one_user(const Tree& tree, const typename Tree::Intersect& intersect,
                                     const typename Tree::AnyRay& ray, bool any) {
    if (tree.empty || !is_valid(ray)) return {};
    const FloatEnvironment plain;
    TraceCounts counts;
    return UserWalk(tree, intersect, any).run(ray, counts);
}

}  // namespace raydix
