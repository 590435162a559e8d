// Batches of closest-point queries. Each starts from the triangle that was closest to the one
// before it: along a Morton curve that is near, and most of the tree is out of reach at once.
#include <raydix/closest.h>
#include <raydix/double.h>

#include "base/float_env.h"
#include "base/options.h"
#include "proximity/closest_walk.h"
#include "proximity/query_batch.h"

namespace raydix {
namespace {

/// In a plain environment: the square of a small distance is a denormal number.
template <class Scalar>
Scalar square_limit(Scalar max_distance) {
    check_not_negative("closest points: max_distance", max_distance);
    return max_distance * max_distance;
}

template <class Result, class Scalar>
Result public_point(const BasicClosestTriangle<Scalar>& best) {
    if (best.prim == no_primitive) return {};
    return {best.point.position, std::sqrt(best.point.d2), best.prim, best.point.u, best.point.v};
}

/// Tree: PaddedTree of a Bvh, PaddedTreeD of a BvhD.
template <class Tree, class AnyBvh, class Vec, class Result>
QueryCounts closest_batch(const AnyBvh& bvh, std::span<const Vec> queries,
                          std::span<Result> results, typename Tree::Scalar max_distance) {
    using Scalar = typename Tree::Scalar;
    const Scalar limit = square_limit(max_distance);
    const Tree tree(bvh);
    std::vector<QueryCounts> parts(block_count(queries.size()));
    for_each_query_block(
        bvh, queries, [&](std::size_t block, std::size_t begin, std::size_t end, const auto& at) {
            BasicWalkStack<Scalar> stack(tree.max_depth);
            std::uint32_t guess = no_primitive;
            for (std::size_t k = begin; k < end; ++k) {
                const std::size_t i = at(k);
                results[i] = {};
                if (!is_finite(queries[i])) {
                    ++parts[block].invalid_queries;
                } else if (!tree.empty) {
                    const BasicClosestTriangle<Scalar> best =
                        find_closest_triangle(tree, queries[i], limit, guess, stack);
                    results[i] = public_point<Result>(best);
                    if (best.prim == no_primitive) continue;
                    guess = best.position;
                    ++parts[block].found;
                }
            }
        });
    return sum_of(parts, queries.size());
}

template <class Tree, class Result, class AnyBvh, class Vec>
Result closest_one(const AnyBvh& bvh, Vec query, typename Tree::Scalar max_distance) {
    require_triangles(bvh, "closest points need");
    const FloatEnvironment plain;
    const auto limit = square_limit(max_distance);
    if (bvh.empty() || !is_finite(query)) return {};
    const Tree tree(bvh);
    BasicWalkStack<typename Tree::Scalar> stack(tree.max_depth);
    return public_point<Result>(find_closest_triangle(tree, query, limit, no_primitive, stack));
}

}  // namespace

QueryCounts closest_points(const Bvh& bvh, std::span<const Vec3> queries,
                           std::span<ClosestPoint> results, const ClosestOptions& options) {
    require_triangles(bvh, "closest points need");
    require_room("closest points", queries.size(), results.size());
    QueryCounts counts;
    with_threads(options.threads, [&] {
        counts = closest_batch<PaddedTree>(bvh, queries, results, options.max_distance);
    });
    return counts;
}

QueryCounts closest_points(const BvhD& bvh, std::span<const Vec3d> queries,
                           std::span<ClosestPointD> results, const ClosestOptionsD& options) {
    require_room("closest points", queries.size(), results.size());
    QueryCounts counts;
    with_threads(options.threads, [&] {
        counts = closest_batch<PaddedTreeD>(bvh, queries, results, options.max_distance);
    });
    return counts;
}

std::vector<ClosestPoint> closest_points(const Bvh& bvh, std::span<const Vec3> queries,
                                         const ClosestOptions& options) {
    std::vector<ClosestPoint> results(queries.size());
    closest_points(bvh, queries, results, options);
    return results;
}

std::vector<ClosestPointD> closest_points(const BvhD& bvh, std::span<const Vec3d> queries,
                                          const ClosestOptionsD& options) {
    std::vector<ClosestPointD> results(queries.size());
    closest_points(bvh, queries, results, options);
    return results;
}

ClosestPoint closest_point(const Bvh& bvh, Vec3 query, float max_distance) {
    return closest_one<PaddedTree, ClosestPoint>(bvh, query, max_distance);
}

ClosestPointD closest_point(const BvhD& bvh, Vec3d query, double max_distance) {
    return closest_one<PaddedTreeD, ClosestPointD>(bvh, query, max_distance);
}

}  // namespace raydix
