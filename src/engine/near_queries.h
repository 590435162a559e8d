// Batches of distance and overlap queries over threads, and single calls: what scenes in float and
// in double share. Near is one call's view of a scene, of its type:
//   Near(scene, mask, call)     throws InputError for geometry that has no answer
//   order(places)               positions of queries in the order in which to take them, or none
//   Thread(near)                what one thread asks by
//     closest(query, limit)     of a finite query: the least (d2, name) with d2 <= limit
//     touch(query, found)       of a valid query: those touched go behind `found`, perhaps more
//                               than once; null: the first ends the search. Whether there is any
//     sweep(sweep)              of a valid sweep
#pragma once

#include <raydix/buffer.h>
#include <raydix/error.h>
#include <raydix/scene_queries.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "base/float_env.h"
#include "base/options.h"
#include "engine/near_call.h"
#include "exec/parallel.h"
#include "exec/result_budget.h"
#include "proximity/query_batch.h"
#include "proximity/row_blocks.h"
#include "proximity/sweep_walk.h"
#include "proximity/touch_walk.h"
#include "trace/simd/wide_batch.h"

namespace raydix {

/// In a plain environment: the square of a small distance is a denormal number.
template <class Scalar>
Scalar square_limit_of(Scalar max_distance) {
    check_not_negative("closest points: max_distance", max_distance);
    return max_distance * max_distance;
}

/// Whether a batch is worth an order, and can have one.
inline bool is_ordered(std::size_t queries) {
    return queries >= worth_ordering && queries < std::size_t{1} << 31;
}
template <class Near, class Query>
Buffer<std::uint32_t> order_in(const Near& near, std::span<const Query> queries) {
    if (!is_ordered(queries.size())) return {};
    Buffer<decltype(place_of(queries[0]))> places(queries.size());
    for_each_index(queries.size(), [&](std::size_t i) { places[i] = place_of(queries[i]); });
    return near.order(places.view());
}
/// Bytes that ordering a query takes: its place, that around the center of a tree in double, and
/// what a sort holds (radix_sort.h).
template <class Query>
constexpr std::uint64_t bytes_of_ordering = sizeof(place_of(std::declval<Query>())) + sizeof(Vec3) +
                                            6 * sizeof(std::uint32_t);

/// Calls one(thread, block, i) -> how many were found, for each valid query; done(block) after
/// those of a block.
template <class Near, class Query, class One, class Done>
QueryCounts for_each_query(const Near& near, std::span<const Query> queries,
                           std::span<const std::uint32_t> order, const One& one, const Done& done) {
    std::vector<QueryCounts> parts(block_count(queries.size()));
    for_each_query_block(
        queries.size(), order,
        [&](std::size_t block, std::size_t begin, std::size_t end, const auto& at) {
            typename Near::Thread thread(near);
            for (std::size_t k = begin; k < end; ++k) {
                const std::size_t i = at(k);
                if (!is_valid(queries[i]))
                    ++parts[block].invalid_queries;
                else
                    parts[block].found += one(thread, block, i);
            }
            done(block);
        });
    return sum_of(parts, queries.size());
}

template <class Near, class Scene, class Query, class Result, class Options>
QueryCounts closest_batch(const Scene& scene, std::span<const Query> queries,
                          std::span<Result> results, const Options& options) {
    require_room(name_of(NearCall::closest), queries.size(), results.size());
    static_cast<void>(kernels_for(options.isa));  // throws
    std::vector<QueryCounts> parts(block_count(queries.size()));
    with_threads(options.threads, [&] {
        const auto limit = square_limit_of(options.max_distance);
        const Near near(scene, options.mask, NearCall::closest, options.isa);
        Buffer<std::uint32_t> order;
        if (is_ordered(queries.size())) order = near.order(queries);
        for_each_query_block(
            queries.size(), order.view(),
            [&](std::size_t block, std::size_t begin, std::size_t end, const auto& at) {
                typename Near::Thread thread(near);
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
                    results[i] = thread.closest(queries[i], limit);
                    parts[block].found += results[i].found();
                }
            });
    });
    return sum_of(parts, queries.size());
}

template <class Near, class Scene, class Query>
QueryCounts touch_any_batch(const Scene& scene, std::span<const Query> queries,
                            std::span<std::uint8_t> touched, const SceneOverlapOptions& options) {
    require_room(name_of(NearCall::overlap), queries.size(), touched.size());
    static_cast<void>(kernels_for(options.isa));  // throws
    QueryCounts counts;
    with_threads(options.threads, [&] {
        const Near near(scene, options.mask, NearCall::overlap, options.isa);
        std::fill(touched.begin(), touched.end(), std::uint8_t{0});
        const Buffer<std::uint32_t> order = order_in(near, queries);
        counts = for_each_query(
            near, queries, order.view(),
            [&](auto& thread, std::size_t, std::size_t i) {
                touched[i] = thread.touch(queries[i], nullptr);
                return std::uint64_t{touched[i]};
            },
            [](std::size_t) {});
    });
    return counts;
}

template <class Near, class Scene, class Query>
SceneOverlapLists touch_all_batch(const Scene& scene, std::span<const Query> queries,
                                  const SceneOverlapOptions& options) {
    static_cast<void>(kernels_for(options.isa));  // throws
    SceneOverlapLists lists;
    with_threads(options.threads, [&] {
        ResultBudget budget("touch_all", options.max_result_bytes);
        const Near near(scene, options.mask, NearCall::overlap, options.isa, &budget);
        RowBlocks<SceneOverlapLists> rows(queries.size(), true, budget);
        // Without room to put the queries in order they are taken as they come.
        Buffer<std::uint32_t> order;
        const std::uint64_t bytes = bytes_of_ordering<Query> * queries.size();
        if (budget.try_take(bytes)) {
            order = order_in(near, queries);
            budget.give_back(bytes - order.size() * sizeof(std::uint32_t));
        }
        const std::span<const std::uint32_t> in_order = order.view();
        const QueryCounts counts = for_each_query(
            near, queries, in_order,
            [&](auto& thread, std::size_t block, std::size_t i) {
                return rows.add_row(block, i,
                                    [&](auto& found) { thread.touch(queries[i], &found); });
            },
            [&](std::size_t block) { rows.finish(block); });
        lists = rows.join(in_order);
        lists.counts = counts;
    });
    return lists;
}

template <class Near, class Scene, class Query>
bool touches_one(const Scene& scene, const Query& query, std::uint32_t mask) {
    const FloatEnvironment plain;
    const Near near(scene, mask, NearCall::overlap);
    return is_valid(query) && typename Near::Thread(near).touch(query, nullptr);
}

template <class Near, class Scene, class Sweep, class Hit>
QueryCounts sweep_batch(const Scene& scene, std::span<const Sweep> sweeps, std::span<Hit> hits,
                        const SceneOverlapOptions& options) {
    require_room(name_of(NearCall::sweep), sweeps.size(), hits.size());
    static_cast<void>(kernels_for(options.isa));  // throws
    QueryCounts counts;
    with_threads(options.threads, [&] {
        const Near near(scene, options.mask, NearCall::sweep, options.isa);
        std::fill(hits.begin(), hits.end(), Hit{});
        counts = for_each_query(
            near, sweeps, {},
            [&](auto& thread, std::size_t, std::size_t i) {
                hits[i] = thread.sweep(sweeps[i]);
                return std::uint64_t{hits[i].hit()};
            },
            [](std::size_t) {});
    });
    return counts;
}

template <class Near, class Hit, class Scene, class Sweep>
Hit sweep_single(const Scene& scene, const Sweep& sweep, std::uint32_t mask) {
    const FloatEnvironment plain;
    const Near near(scene, mask, NearCall::sweep);
    return is_valid(sweep) ? typename Near::Thread(near).sweep(sweep) : Hit{};
}

}  // namespace raydix
