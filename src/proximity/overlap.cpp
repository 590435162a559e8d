// Batches of segments and spheres against the triangles of a tree, in float and in double.
#include <raydix/buffer.h>
#include <raydix/double.h>
#include <raydix/overlap.h>

#include <algorithm>
#include <utility>

#include "base/float_env.h"
#include "exec/result_budget.h"
#include "proximity/query_batch.h"
#include "proximity/row_blocks.h"
#include "proximity/touch_walk.h"
#include "proximity/unsplit_tree.h"

namespace raydix {
namespace {

constexpr const char* what = "overlap queries need";

PaddedTree padded_tree(const Bvh& bvh) { return PaddedTree(bvh); }
PaddedTreeD padded_tree(const BvhD& bvh) { return PaddedTreeD(bvh); }

template <class Query>
auto places_of(std::span<const Query> queries) {
    std::vector<decltype(place_of(queries[0]))> places(queries.size());
    for_each_index(queries.size(), [&](std::size_t i) { places[i] = place_of(queries[i]); });
    return places;
}

/// Positions of queries in the order in which to take them; empty: as they come.
template <class AnyBvh, class Query>
Buffer<std::uint32_t> order_of(const AnyBvh& bvh, std::span<const Query> queries) {
    const auto places = places_of(queries);
    return query_order(bvh, std::span(places));
}

/// Bytes that order_of() holds at most for each query: its place, that around the center of the
/// tree, and what a sort holds (radix_sort.h).
template <class Query>
constexpr std::uint64_t ordering_bytes = sizeof(place_of(std::declval<Query>())) + sizeof(Vec3) +
                                         6 * sizeof(std::uint32_t);

/// Calls one(block, i, stack) -> how many were found, for each valid query; done(block) after those
/// of a block. `order` as order_of() gives it.
template <class Tree, class Query, class One, class Done>
QueryCounts for_each_query(const Tree& tree, std::span<const Query> queries,
                           std::span<const std::uint32_t> order, const One& one, const Done& done) {
    std::vector<QueryCounts> parts(block_count(queries.size()));
    for_each_query_block(
        queries.size(), order,
        [&](std::size_t block, std::size_t begin, std::size_t end, const auto& at) {
            BasicWalkStack<typename Tree::Scalar> stack(tree.max_depth);
            for (std::size_t k = begin; k < end; ++k) {
                const std::size_t i = at(k);
                if (!is_valid(queries[i]))
                    ++parts[block].invalid_queries;
                else if (!tree.empty)
                    parts[block].found += one(block, i, stack);
            }
            done(block);
        });
    return sum_of(parts, queries.size());
}

template <class Tree, class Query, class Stack>
bool touches_any(const Tree& tree, const Query& query, Stack& stack) {
    bool touched = false;
    for_each_touched(tree, prepared(query), stack, [&](std::uint32_t) { return touched = true; });
    return touched;
}

template <class AnyBvh, class Query>
QueryCounts any_batch(const AnyBvh& bvh, std::span<const Query> queries,
                      std::span<std::uint8_t> touched, const OverlapOptions& options) {
    require_triangles(bvh, what);
    require_room("overlap queries", queries.size(), touched.size());
    std::fill(touched.begin(), touched.end(), std::uint8_t{0});
    QueryCounts counts;
    with_threads(options.threads, [&] {
        const auto tree = padded_tree(bvh);
        counts = for_each_query(
            tree, queries, order_of(bvh, queries).view(),
            [&](std::size_t, std::size_t i, auto& stack) {
                touched[i] = touches_any(tree, queries[i], stack);
                return std::uint64_t{touched[i]};
            },
            [](std::size_t) {});
    });
    return counts;
}

template <class AnyBvh, class Query>
OverlapLists all_batch(const AnyBvh& bvh, std::span<const Query> queries,
                       const OverlapOptions& options) {
    require_triangles(bvh, what);
    OverlapLists lists;
    with_threads(options.threads, [&] {
        const auto tree = padded_tree(bvh);
        ResultBudget budget("touch_all", options.max_result_bytes);
        RowBlocks<OverlapLists> rows(queries.size(), has_parts(bvh), budget);
        // Without room to put the queries in order they are taken as they come.
        Buffer<std::uint32_t> order;
        const std::uint64_t bytes = ordering_bytes<Query> * queries.size();
        if (budget.try_take(bytes)) {
            order = order_of(bvh, queries);
            budget.give_back(bytes - order.size() * sizeof(std::uint32_t));
        }
        const std::span<const std::uint32_t> in_order = order.view();
        const QueryCounts counts = for_each_query(
            tree, queries, in_order,
            [&](std::size_t block, std::size_t i, auto& stack) {
                return rows.add_row(block, i, [&](auto& ids) {
                    for_each_touched(tree, prepared(queries[i]), stack,
                                     [&](std::uint32_t position) {
                                         ids.push_back(tree.order[position]);
                                         return false;
                                     });
                });
            },
            [&](std::size_t block) { rows.finish(block); });
        lists = rows.join(in_order);
        lists.counts = counts;
    });
    return lists;
}

template <class AnyBvh, class Query>
bool touches_one(const AnyBvh& bvh, const Query& query) {
    require_triangles(bvh, what);
    const FloatEnvironment plain;
    if (bvh.empty() || !is_valid(query)) return false;
    const auto tree = padded_tree(bvh);
    BasicWalkStack<typename decltype(padded_tree(bvh))::Scalar> stack(tree.max_depth);
    return touches_any(tree, query, stack);
}

}  // namespace

QueryCounts touch_any(const Bvh& bvh, std::span<const Segment> queries,
                      std::span<std::uint8_t> touched, const OverlapOptions& options) {
    return any_batch(bvh, queries, touched, options);
}
QueryCounts touch_any(const Bvh& bvh, std::span<const Sphere> queries,
                      std::span<std::uint8_t> touched, const OverlapOptions& options) {
    return any_batch(bvh, queries, touched, options);
}
bool touches(const Bvh& bvh, const Segment& segment) { return touches_one(bvh, segment); }
bool touches(const Bvh& bvh, const Sphere& sphere) { return touches_one(bvh, sphere); }

OverlapLists touch_all(const Bvh& bvh, std::span<const Segment> queries,
                       const OverlapOptions& options) {
    return all_batch(bvh, queries, options);
}
OverlapLists touch_all(const Bvh& bvh, std::span<const Sphere> queries,
                       const OverlapOptions& options) {
    return all_batch(bvh, queries, options);
}

QueryCounts touch_any(const BvhD& bvh, std::span<const SegmentD> queries,
                      std::span<std::uint8_t> touched, const OverlapOptions& options) {
    return any_batch(bvh, queries, touched, options);
}
QueryCounts touch_any(const BvhD& bvh, std::span<const SphereD> queries,
                      std::span<std::uint8_t> touched, const OverlapOptions& options) {
    return any_batch(bvh, queries, touched, options);
}
bool touches(const BvhD& bvh, const SegmentD& segment) { return touches_one(bvh, segment); }
bool touches(const BvhD& bvh, const SphereD& sphere) { return touches_one(bvh, sphere); }

OverlapLists touch_all(const BvhD& bvh, std::span<const SegmentD> queries,
                       const OverlapOptions& options) {
    return all_batch(bvh, queries, options);
}
OverlapLists touch_all(const BvhD& bvh, std::span<const SphereD> queries,
                       const OverlapOptions& options) {
    return all_batch(bvh, queries, options);
}

}  // namespace raydix
