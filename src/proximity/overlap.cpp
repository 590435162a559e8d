// Batches of segments and spheres against the triangles of a tree.
#include <raydix/overlap.h>

#include <algorithm>

#include "base/float_env.h"
#include "proximity/query_batch.h"
#include "proximity/result_limit.h"
#include "proximity/touch_walk.h"

namespace raydix {
namespace {

constexpr const char* what = "overlap queries need";

template <class Query>
std::vector<Vec3> places_of(std::span<const Query> queries) {
    std::vector<Vec3> places(queries.size());
    for_each_index(queries.size(), [&](std::size_t i) { places[i] = place_of(queries[i]); });
    return places;
}

/// Calls one(i, stack) -> how many were found, for each valid query.
template <class Query, class One>
OverlapCounts for_each_query(const Bvh& bvh, std::span<const Query> queries, const One& one) {
    std::vector<OverlapCounts> parts(block_count(queries.size()));
    for_each_query_block(
        bvh, places_of(queries),
        [&](std::size_t block, std::size_t begin, std::size_t end, const auto& at) {
            WalkStack stack(bvh.max_depth());
            for (std::size_t k = begin; k < end; ++k) {
                const std::size_t i = at(k);
                if (!is_valid(queries[i]))
                    ++parts[block].invalid_queries;
                else if (!bvh.empty())
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

template <class Query>
bool touches_any(const PaddedTree& tree, const Query& query, WalkStack& stack) {
    bool touched = false;
    for_each_touched(tree, query, stack, [&](std::uint32_t) { return touched = true; });
    return touched;
}

template <class Query>
OverlapCounts any_batch(const Bvh& bvh, std::span<const Query> queries,
                        std::span<std::uint8_t> touched, const OverlapOptions& options) {
    require_triangles(bvh, what);
    require_room("overlap queries", queries.size(), touched.size());
    std::fill(touched.begin(), touched.end(), std::uint8_t{0});
    OverlapCounts counts;
    const PaddedTree tree(bvh);
    with_threads(options.threads, [&] {
        counts = for_each_query(bvh, queries, [&](std::size_t i, WalkStack& stack) {
            touched[i] = touches_any(tree, queries[i], stack);
            return std::uint64_t{touched[i]};
        });
    });
    return counts;
}

/// Each query's ids in a list of its own at first: rows of any length fit, and end in order.
template <class Query>
OverlapLists all_batch(const Bvh& bvh, std::span<const Query> queries,
                       const OverlapOptions& options) {
    require_triangles(bvh, what);
    const PaddedTree tree(bvh);
    ResultLimit limit("overlap queries", options.max_bytes, sizeof(std::uint32_t));
    std::vector<std::vector<std::uint32_t>> rows(queries.size());
    OverlapLists lists;
    with_threads(options.threads, [&] {
        lists.counts = for_each_query(bvh, queries, [&](std::size_t i, WalkStack& stack) {
            std::vector<std::uint32_t>& row = rows[i];
            for_each_touched(tree, queries[i], stack, [&](std::uint32_t position) {
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

template <class Query>
bool touches_one(const Bvh& bvh, const Query& query) {
    require_triangles(bvh, what);
    if (bvh.empty() || !is_valid(query)) return false;
    const FloatEnvironment plain;
    WalkStack stack(bvh.max_depth());
    return touches_any(PaddedTree(bvh), query, stack);
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

}  // namespace raydix
