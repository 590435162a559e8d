// What all batches of mesh queries do: check their input, and take queries along a Morton curve in
// fixed blocks.
#pragma once

#include <raydix/batch.h>
#include <raydix/buffer.h>
#include <raydix/bvh.h>
#include <raydix/double.h>
#include <raydix/error.h>

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "base/double3.h"
#include "exec/parallel.h"
#include "rays/place_order.h"
#include "trace/double_tree.h"

namespace raydix {

inline constexpr std::size_t queries_per_block = 512;
/// Fewer queries are taken as they come.
inline constexpr std::size_t worth_ordering = 2048;

inline void require_triangles(const Bvh& bvh, const char* what) {
    if (bvh.kind() != PrimitiveKind::triangles && !bvh.empty())
        throw InputError(std::string(what) + " triangles; this tree holds " +
                         (bvh.kind() == PrimitiveKind::points ? "points" : "boxes"));
}

/// Always: there is nothing else in it.
inline void require_triangles(const BvhD&, const char*) {}

inline void require_room(const char* what, std::size_t queries, std::size_t results) {
    if (queries != results)
        throw InputError(std::string(what) + ": " + std::to_string(queries) +
                         " queries, but room for " + std::to_string(results) + " results");
}

/// Of the parts of a batch.
[[nodiscard]] inline QueryCounts sum_of(const std::vector<QueryCounts>& parts,
                                        std::size_t queries) {
    QueryCounts sum;
    sum.queries = queries;
    for (const QueryCounts& part : parts) {
        sum.found += part.found;
        sum.invalid_queries += part.invalid_queries;
    }
    return sum;
}

/// Positions of queries in the order in which to take them; empty: as they come.
[[nodiscard]] inline Buffer<std::uint32_t> query_order(const Bvh& bvh,
                                                       std::span<const Vec3> places) {
    if (places.size() < worth_ordering || places.size() >= std::size_t{1} << 31 || bvh.empty())
        return {};
    return order_by_place(bvh.bounds(), places);
}
[[nodiscard]] inline Buffer<std::uint32_t> query_order(const BvhD& bvh,
                                                       std::span<const Vec3d> places) {
    if (places.size() < worth_ordering) return {};
    const TreeSpace space{bvh.center(), bvh.scale()};
    Buffer<Vec3> local(places.size());
    for_each_index(places.size(),
                   [&](std::size_t i) { Double3(space.local(places[i])).round_to(local[i]); });
    return query_order(bvh.tree(), local.view());
}

/// Calls one(block, begin, end, at) with at(k) = the query that is k-th in line; `order` as
/// query_order() gives it.
template <class One>
void for_each_query_block(std::size_t queries, std::span<const std::uint32_t> order,
                          const One& one) {
    const auto at = [&](std::size_t k) { return order.empty() ? k : order[k]; };
    for_each_block(
        queries, queries_per_block,
        [&](std::size_t block, std::size_t begin, std::size_t end) { one(block, begin, end, at); });
}
template <class AnyBvh, class Vec, class One>
void for_each_query_block(const AnyBvh& bvh, std::span<const Vec> places, const One& one) {
    for_each_query_block(places.size(), query_order(bvh, places).view(), one);
}

[[nodiscard]] inline std::size_t block_count(std::size_t queries) {
    return (queries + queries_per_block - 1) / queries_per_block;
}

}  // namespace raydix
