// Distance and overlap on scenes: batches over threads and single calls.
#include <raydix/error.h>
#include <raydix/scene_queries.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "base/float_env.h"
#include "base/options.h"
#include "engine/near_job.h"
#include "engine/near_scene.h"
#include "engine/scene_state.h"
#include "exec/parallel.h"
#include "exec/result_budget.h"
#include "proximity/query_batch.h"
#include "proximity/row_blocks.h"
#include "proximity/sweep_walk.h"
#include "proximity/touch_walk.h"
#include "trace/simd/wide_batch.h"

namespace raydix {
namespace {

/// The job of each thread: its memory stays from batch to batch.
NearJob& near_job_of_this_thread(const SceneTree& tree, std::uint32_t mask) {
    thread_local NearJob job;
    job.tree = &tree;
    job.mask = mask;
    job.guess.view = nullptr;
    return job;
}

[[noreturn]] void refuse_shapes(const char* call, const ShapeTree& shapes, const char* why) {
    throw InputError(std::string(call) + ": geometry " + std::to_string(shapes.id) + " (" +
                     kind_of(shapes.shapes) + ") " + why);
}

/// What every call asks first. Throws InputError for geometry that has no answer.
const SceneTree& tree_for_distance(const Scene& scene, const char* call, std::uint32_t mask) {
    const SceneTree& tree = *SceneAccess::tree(scene);
    for (const ShownShapes& shown : near_scene_of(tree).shapes)
        if (shown.shapes->user() != nullptr && shown.seen_by(mask))
            refuse_shapes(call, *shown.shapes, "has no distances: it is known by its hits alone");
    return tree;
}
const SceneTree& tree_for_sweeps(const Scene& scene, const char* call, std::uint32_t mask) {
    const SceneTree& tree = *SceneAccess::tree(scene);
    for (const ShownShapes& shown : near_scene_of(tree).shapes)
        if (shown.seen_by(mask))
            refuse_shapes(call, *shown.shapes, "cannot be swept against: only triangles can");
    return tree;
}

float square_limit_of(float max_distance) {
    if (!(max_distance >= 0))
        throw InputError("closest points: max_distance is " + std::to_string(max_distance) +
                         "; it must be 0 or more");
    return max_distance * max_distance;
}

const NearKernels& kernels_of(const std::string& isa) {
    static_cast<void>(kernels_for(isa));  // throws
    return near_kernels_for(isa);
}

/// Around all that a scene holds; lo > hi if that is nothing.
Aabb bounds_of(const SceneTree& tree) {
    const NearScene& near = near_scene_of(tree);
    return near.has_flats() ? unite(tree.bounds, near.flats.arrays.bounds) : tree.bounds;
}

/// Positions of queries in the order in which to take them; empty: as they come.
std::vector<std::uint32_t> order_in(const Aabb& bounds, std::span<const Vec3> places) {
    if (places.size() < worth_ordering || places.size() >= std::size_t{1} << 31 || is_empty(bounds))
        return {};
    return order_by_place(bounds, places);
}
template <class Query>
std::vector<std::uint32_t> order_in(const Aabb& bounds, std::span<const Query> queries) {
    std::vector<Vec3> places(queries.size());
    for_each_index(queries.size(), [&](std::size_t i) { places[i] = place_of(queries[i]); });
    return order_in(bounds, std::span<const Vec3>(places));
}
/// Bytes that ordering a query takes: its place, and what a sort holds (radix_sort.h).
constexpr std::uint64_t bytes_of_ordering = sizeof(Vec3) + 6 * sizeof(std::uint32_t);

SceneClosestPoint public_point(const NearBest& best) {
    if (!best.found()) return {};
    return {best.position, std::sqrt(best.d2), best.prim, best.geometry, best.instance, best.u,
            best.v};
}

SceneSweepHit public_hit(const NearContact& contact, const SphereSweep& sweep) {
    if (!contact.found()) return {};
    if (sweep.radius == 0.0f) {
        const float t = contact.t * make_frame(sweep.path).t_scale + 0.0f;  // -0 becomes +0
        if (!(t < infinity)) return {};  // farther than numbers go
        const LeafTriangle& triangle = contact.triangle;
        const Double3 a(triangle.v0), b(triangle.v1), c(triangle.v2);
        const Double3 at = a + (b - a) * contact.u + (c - a) * contact.v;
        return {t,         contact.prim, contact.geometry, contact.instance, at.rounded(),
                contact.u, contact.v};
    }
    const Vec3 center = kept(path_of(sweep.path).at(contact.t).rounded());
    const TrianglePoint at = closest_on_triangle(contact.triangle, center);
    return {contact.t + 0.0f,
            contact.prim,
            contact.geometry,
            contact.instance,
            at.position,
            at.u,
            at.v};
}

/// Of parts of a batch.
template <class Counts>
Counts sum_of(const std::vector<Counts>& parts, std::size_t queries) {
    Counts sum;
    sum.queries = queries;
    for (const Counts& part : parts) {
        sum.found += part.found;
        sum.invalid_queries += part.invalid_queries;
    }
    return sum;
}

/// Calls one(job, block, i) -> how many were found, for each valid query; done(block) after those
/// of a block.
template <class Query, class One, class Done>
OverlapCounts for_each_query(const SceneTree& tree, std::uint32_t mask,
                             std::span<const Query> queries, std::span<const std::uint32_t> order,
                             const One& one, const Done& done) {
    std::vector<OverlapCounts> parts(block_count(queries.size()));
    for_each_query_block(
        queries.size(), order,
        [&](std::size_t block, std::size_t begin, std::size_t end, const auto& at) {
            NearJob& job = near_job_of_this_thread(tree, mask);
            for (std::size_t k = begin; k < end; ++k) {
                const std::size_t i = at(k);
                if (!is_valid(queries[i]))
                    ++parts[block].invalid_queries;
                else
                    parts[block].found += one(job, block, i);
            }
            done(block);
        });
    return sum_of(parts, queries.size());
}

bool touch(const NearKernels& kernels, NearJob& job, const Segment& segment,
           BudgetVector<ScenePrimitive>* found) {
    return kernels.touch_segment(job, segment, found);
}
bool touch(const NearKernels& kernels, NearJob& job, const Sphere& sphere,
           BudgetVector<ScenePrimitive>* found) {
    return kernels.touch_sphere(job, sphere, found);
}

template <class Query>
OverlapCounts touch_any_in(const Scene& scene, std::span<const Query> queries,
                           std::span<std::uint8_t> touched, const SceneOverlapOptions& options) {
    require_room("overlap queries", queries.size(), touched.size());
    const NearKernels& kernels = kernels_of(options.isa);
    OverlapCounts counts;
    with_threads(options.threads, [&] {
        const SceneTree& tree = tree_for_distance(scene, "overlap queries", options.mask);
        std::fill(touched.begin(), touched.end(), std::uint8_t{0});
        const std::vector<std::uint32_t> order = order_in(bounds_of(tree), queries);
        counts = for_each_query(
            tree, options.mask, queries, std::span<const std::uint32_t>(order),
            [&](NearJob& job, std::size_t, std::size_t i) {
                touched[i] = touch(kernels, job, queries[i], nullptr);
                return std::uint64_t{touched[i]};
            },
            [](std::size_t) {});
    });
    return counts;
}

template <class Query>
SceneOverlapLists touch_all_in(const Scene& scene, std::span<const Query> queries,
                               const SceneOverlapOptions& options) {
    const NearKernels& kernels = kernels_of(options.isa);
    SceneOverlapLists lists;
    with_threads(options.threads, [&] {
        const SceneTree& tree = tree_for_distance(scene, "overlap queries", options.mask);
        ResultBudget budget("touch_all", options.max_result_bytes);
        RowBlocks<SceneOverlapLists> rows(queries.size(), true, budget);
        // Without room to put the queries in order they are taken as they come.
        std::vector<std::uint32_t> order;
        const std::uint64_t bytes = bytes_of_ordering * queries.size();
        if (budget.try_take(bytes)) {
            order = order_in(bounds_of(tree), queries);
            budget.give_back(bytes - order.size() * sizeof(std::uint32_t));
        }
        const std::span<const std::uint32_t> in_order(order);
        const OverlapCounts counts = for_each_query(
            tree, options.mask, queries, in_order,
            [&](NearJob& job, std::size_t block, std::size_t i) {
                return rows.add_row(block, i,
                                    [&](auto& found) { touch(kernels, job, queries[i], &found); });
            },
            [&](std::size_t block) { rows.finish(block); });
        lists = rows.join(in_order);
        lists.counts = counts;
    });
    return lists;
}

template <class Query>
bool touches_in(const Scene& scene, const Query& query, std::uint32_t mask) {
    const FloatEnvironment plain;
    const SceneTree& tree = tree_for_distance(scene, "overlap queries", mask);
    static const NearKernels& kernels = near_kernels_for({});
    return is_valid(query) && touch(kernels, near_job_of_this_thread(tree, mask), query, nullptr);
}

}  // namespace

ClosestCounts closest_points(const Scene& scene, std::span<const Vec3> queries,
                             std::span<SceneClosestPoint> results,
                             const SceneClosestOptions& options) {
    require_room("closest points", queries.size(), results.size());
    const float limit = square_limit_of(options.max_distance);
    const NearKernels& kernels = kernels_of(options.isa);
    std::vector<ClosestCounts> parts(block_count(queries.size()));
    with_threads(options.threads, [&] {
        const SceneTree& tree = tree_for_distance(scene, "closest points", options.mask);
        const std::vector<std::uint32_t> order = order_in(bounds_of(tree), queries);
        for_each_query_block(
            queries.size(), order,
            [&](std::size_t block, std::size_t begin, std::size_t end, const auto& at) {
                NearJob& job = near_job_of_this_thread(tree, options.mask);
                constexpr std::size_t ahead = 8;
                for (std::size_t k = begin; k < end; ++k) {
                    const std::size_t i = at(k), later = at(std::min(k + ahead, end - 1));
                    __builtin_prefetch(&queries[later]);
                    __builtin_prefetch(&results[later], 1);
                    if (!is_finite(queries[i])) {
                        results[i] = {};
                        ++parts[block].invalid_queries;
                        continue;
                    }
                    results[i] = public_point(kernels.closest(job, queries[i], limit));
                    parts[block].found += results[i].found();
                }
            });
    });
    return sum_of(parts, queries.size());
}

std::vector<SceneClosestPoint> closest_points(const Scene& scene, std::span<const Vec3> queries,
                                              const SceneClosestOptions& options) {
    std::vector<SceneClosestPoint> results(queries.size());
    closest_points(scene, queries, results, options);
    return results;
}

SceneClosestPoint closest_point(const Scene& scene, Vec3 query, float max_distance,
                                std::uint32_t mask) {
    const float limit = square_limit_of(max_distance);
    const SceneTree& tree = tree_for_distance(scene, "closest points", mask);
    if (!is_finite(query)) return {};
    static const NearKernels& kernels = near_kernels_for({});
    NearJob& job = near_job_of_this_thread(tree, mask);
    if (FloatEnvironment::is_plain()) return public_point(kernels.closest(job, query, limit));
    const FloatEnvironment plain;
    return public_point(kernels.closest(job, query, limit));
}

OverlapCounts touch_any(const Scene& scene, std::span<const Segment> queries,
                        std::span<std::uint8_t> touched, const SceneOverlapOptions& options) {
    return touch_any_in(scene, queries, touched, options);
}
OverlapCounts touch_any(const Scene& scene, std::span<const Sphere> queries,
                        std::span<std::uint8_t> touched, const SceneOverlapOptions& options) {
    return touch_any_in(scene, queries, touched, options);
}
bool touches(const Scene& scene, const Segment& segment, std::uint32_t mask) {
    return touches_in(scene, segment, mask);
}
bool touches(const Scene& scene, const Sphere& sphere, std::uint32_t mask) {
    return touches_in(scene, sphere, mask);
}

SceneOverlapLists touch_all(const Scene& scene, std::span<const Segment> queries,
                            const SceneOverlapOptions& options) {
    return touch_all_in(scene, queries, options);
}
SceneOverlapLists touch_all(const Scene& scene, std::span<const Sphere> queries,
                            const SceneOverlapOptions& options) {
    return touch_all_in(scene, queries, options);
}

OverlapCounts sweep_spheres(const Scene& scene, std::span<const SphereSweep> sweeps,
                            std::span<SceneSweepHit> hits, const SceneOverlapOptions& options) {
    require_room("sweeps", sweeps.size(), hits.size());
    const NearKernels& kernels = kernels_of(options.isa);
    OverlapCounts counts;
    with_threads(options.threads, [&] {
        const SceneTree& tree = tree_for_sweeps(scene, "sweeps", options.mask);
        std::fill(hits.begin(), hits.end(), SceneSweepHit{});
        counts = for_each_query(
            tree, options.mask, sweeps, {},
            [&](NearJob& job, std::size_t, std::size_t i) {
                hits[i] = public_hit(kernels.sweep(job, sweeps[i]), sweeps[i]);
                return std::uint64_t{hits[i].hit()};
            },
            [](std::size_t) {});
    });
    return counts;
}
std::vector<SceneSweepHit> sweep_spheres(const Scene& scene, std::span<const SphereSweep> sweeps,
                                         const SceneOverlapOptions& options) {
    std::vector<SceneSweepHit> hits(sweeps.size());
    sweep_spheres(scene, sweeps, hits, options);
    return hits;
}
SceneSweepHit sweep_sphere(const Scene& scene, const SphereSweep& sweep, std::uint32_t mask) {
    const FloatEnvironment plain;
    const SceneTree& tree = tree_for_sweeps(scene, "sweeps", mask);
    if (!is_valid(sweep)) return {};
    static const NearKernels& kernels = near_kernels_for({});
    return public_hit(kernels.sweep(near_job_of_this_thread(tree, mask), sweep), sweep);
}

}  // namespace raydix
