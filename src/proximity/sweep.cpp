// Batches of moving balls, in float and in double. Balls without a radius are rays, with the
// watertight test of rays.
#include <raydix/double.h>
#include <raydix/overlap.h>

#include <type_traits>

#include "base/float_env.h"
#include "proximity/query_batch.h"
#include "proximity/sweep_hits.h"

namespace raydix {
namespace {

constexpr const char* what = "sweeps need";

template <class Kind, class AnyBvh, class Sweep>
QueryCounts sweep_batch(const AnyBvh& bvh, std::span<const Sweep> sweeps,
                        std::span<typename Kind::Hit> hits) {
    const typename Kind::Tree tree(bvh);
    std::vector<QueryCounts> parts(block_count(sweeps.size()));
    for_each_block(sweeps.size(), queries_per_block,
                   [&](std::size_t block, std::size_t begin, std::size_t end) {
                       BasicWalkStack<typename Kind::Tree::Scalar> stack(tree.max_depth);
                       for (std::size_t i = begin; i < end; ++i) {
                           hits[i] = {};
                           if (!is_valid(sweeps[i]))
                               ++parts[block].invalid_queries;
                           else if (!tree.empty)
                               hits[i] = sweep_one<Kind>(tree, sweeps[i], stack);
                           parts[block].found += hits[i].hit();
                       }
                   });
    return sum_of(parts, sweeps.size());
}

template <class AnyBvh, class Sweep, class AnyHit>
QueryCounts sweep_all(const AnyBvh& bvh, std::span<const Sweep> sweeps, std::span<AnyHit> hits,
                      const OverlapOptions& options) {
    require_triangles(bvh, what);
    require_room("sweeps", sweeps.size(), hits.size());
    QueryCounts counts;
    with_threads(options.threads, [&] {
        counts = sweep_batch<SweepsOf<std::remove_cvref_t<decltype(bvh)>>>(bvh, sweeps, hits);
    });
    return counts;
}

template <class AnyBvh, class Sweep>
auto sweep_single(const AnyBvh& bvh, const Sweep& sweep) {
    using Kind = SweepsOf<std::remove_cvref_t<decltype(bvh)>>;
    require_triangles(bvh, what);
    const FloatEnvironment plain;
    if (bvh.empty() || !is_valid(sweep)) return typename Kind::Hit{};
    BasicWalkStack<typename Kind::Tree::Scalar> stack(bvh.max_depth());
    return sweep_one<Kind>(typename Kind::Tree(bvh), sweep, stack);
}

}  // namespace

QueryCounts sweep_spheres(const Bvh& bvh, std::span<const SphereSweep> sweeps,
                          std::span<SweepHit> hits, const OverlapOptions& options) {
    return sweep_all(bvh, sweeps, hits, options);
}
std::vector<SweepHit> sweep_spheres(const Bvh& bvh, std::span<const SphereSweep> sweeps,
                                    const OverlapOptions& options) {
    std::vector<SweepHit> hits(sweeps.size());
    sweep_spheres(bvh, sweeps, hits, options);
    return hits;
}
SweepHit sweep_sphere(const Bvh& bvh, const SphereSweep& sweep) { return sweep_single(bvh, sweep); }

QueryCounts sweep_spheres(const BvhD& bvh, std::span<const SphereSweepD> sweeps,
                          std::span<SweepHitD> hits, const OverlapOptions& options) {
    return sweep_all(bvh, sweeps, hits, options);
}
std::vector<SweepHitD> sweep_spheres(const BvhD& bvh, std::span<const SphereSweepD> sweeps,
                                     const OverlapOptions& options) {
    std::vector<SweepHitD> hits(sweeps.size());
    sweep_spheres(bvh, sweeps, hits, options);
    return hits;
}
SweepHitD sweep_sphere(const BvhD& bvh, const SphereSweepD& sweep) {
    return sweep_single(bvh, sweep);
}

}  // namespace raydix
