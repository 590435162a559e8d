// Batches of segments and spheres against the triangles of a tree, in float and in double.
#include <raydix/double.h>
#include <raydix/overlap.h>

#include <algorithm>

#include "base/float_env.h"
#include "proximity/query_batch.h"
#include "proximity/result_limit.h"
#include "proximity/touch_walk.h"

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

/// Calls one(i, stack) -> how many were found, for each valid query.
template <class Tree, class AnyBvh, class Query, class One>
OverlapCounts for_each_query(const Tree& tree, const AnyBvh& bvh, std::span<const Query> queries,
                             const One& one) {
    std::vector<OverlapCounts> parts(block_count(queries.size()));
    const auto places = places_of(queries);
    for_each_query_block(
        bvh, std::span(places),
        [&](std::size_t block, std::size_t begin, std::size_t end, const auto& at) {
            BasicWalkStack<typename Tree::Scalar> stack(tree.max_depth);
            for (std::size_t k = begin; k < end; ++k) {
                const std::size_t i = at(k);
                if (!is_valid(queries[i]))
                    ++parts[block].invalid_queries;
                else if (!tree.empty)
                    parts[block].found += one(i, stack);
            }
        });
    OverlapCounts sum;
    sum.queries = queries.size();
    for (const OverlapCounts& part : parts) {
        sum.found += part.found;
        sum.invalid_queries += part.invalid_queries;
    }
    return sum;
}

template <class Tree, class Query, class Stack>
bool touches_any(const Tree& tree, const Query& query, Stack& stack) {
    bool touched = false;
    for_each_touched(tree, prepared(query), stack, [&](std::uint32_t) { return touched = true; });
    return touched;
}

template <class AnyBvh, class Query>
OverlapCounts any_batch(const AnyBvh& bvh, std::span<const Query> queries,
                        std::span<std::uint8_t> touched, const OverlapOptions& options) {
    require_triangles(bvh, what);
    require_room("overlap queries", queries.size(), touched.size());
    std::fill(touched.begin(), touched.end(), std::uint8_t{0});
    OverlapCounts counts;
    const auto tree = padded_tree(bvh);
    with_threads(options.threads, [&] {
        counts = for_each_query(tree, bvh, queries, [&](std::size_t i, auto& stack) {
            touched[i] = touches_any(tree, queries[i], stack);
            return std::uint64_t{touched[i]};
        });
    });
    return counts;
}

/// Each query's ids in a list of its own at first: rows of any length fit, and end in order.
template <class AnyBvh, class Query>
OverlapLists all_batch(const AnyBvh& bvh, std::span<const Query> queries,
                       const OverlapOptions& options) {
    require_triangles(bvh, what);
    const auto tree = padded_tree(bvh);
    ResultLimit limit("overlap queries", options.max_bytes, sizeof(std::uint32_t));
    std::vector<std::vector<std::uint32_t>> rows(queries.size());
    OverlapLists lists;
    with_threads(options.threads, [&] {
        lists.counts = for_each_query(tree, bvh, queries, [&](std::size_t i, auto& stack) {
            std::vector<std::uint32_t>& row = rows[i];
            for_each_touched(tree, prepared(queries[i]), stack, [&](std::uint32_t position) {
                row.push_back(tree.order[position]);
                return false;
            });
            std::sort(row.begin(), row.end());
            row.erase(std::unique(row.begin(), row.end()), row.end());
            limit.add(row.size());
            return std::uint64_t{row.size()};
        });
        lists.offsets.resize(queries.size() + 1, 0);
        for (std::size_t i = 0; i < rows.size(); ++i)
            lists.offsets[i + 1] = lists.offsets[i] + rows[i].size();
        lists.prims.resize(lists.offsets.back());
        for_each_index(rows.size(), [&](std::size_t i) {
            std::copy(rows[i].begin(), rows[i].end(),
                      lists.prims.begin() + static_cast<std::ptrdiff_t>(lists.offsets[i]));
        });
    });
    return lists;
}

template <class AnyBvh, class Query>
bool touches_one(const AnyBvh& bvh, const Query& query) {
    require_triangles(bvh, what);
    if (bvh.empty() || !is_valid(query)) return false;
    const FloatEnvironment plain;
    const auto tree = padded_tree(bvh);
    BasicWalkStack<typename decltype(padded_tree(bvh))::Scalar> stack(tree.max_depth);
    return touches_any(tree, query, stack);
}

}  // namespace

OverlapCounts touch_any(const Bvh& bvh, std::span<const Segment> queries,
                        std::span<std::uint8_t> touched, const OverlapOptions& options) {
    return any_batch(bvh, queries, touched, options);
}
OverlapCounts touch_any(const Bvh& bvh, std::span<const Sphere> queries,
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

OverlapCounts touch_any(const BvhD& bvh, std::span<const SegmentD> queries,
                        std::span<std::uint8_t> touched, const OverlapOptions& options) {
    return any_batch(bvh, queries, touched, options);
}
OverlapCounts touch_any(const BvhD& bvh, std::span<const SphereD> queries,
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
