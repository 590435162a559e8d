// Queries over trees on a device as launches for any backend, and what they refuse.
#pragma once

#include <raydix/device_queries.h>

#include <cstdint>
#include <span>

#include "proximity/device_rows.h"
#include "trace/kd_queries.h"

namespace raydix {

static_assert(device_query_max_depth == device_walk_depth &&
              device_query_max_depth == kd_stack_entries);

// Each throws the InputError that the public calls promise.
void check_knn(const DevicePoints& tree, std::span<const Vec3> queries, std::uint32_t k,
               std::span<std::uint32_t> indices, std::span<float> distances);
void check_radius(const DevicePoints& tree, std::span<const Vec3> queries, float radius,
                  std::size_t offsets);
void check_rows(std::size_t indices, std::size_t distances);
void check_closest(const DevicePrimitives& tree, std::span<const Vec3> queries, float max_distance,
                   std::size_t results);
void check_pairs(const DevicePairQuery& query, std::size_t offsets);
void check_offsets_scratch(std::span<std::byte> scratch, std::size_t needed);

inline PointQueries queries_on(const DevicePoints& tree, std::span<const Vec3> queries,
                               std::uint32_t* invalid) {
    PointQueries from;
    from.tree.nodes = tree.nodes;
    from.tree.order = tree.order;
    from.tree.bounds = tree.bounds;
    from.tree.max_depth = tree.max_depth;
    from.tree.empty = tree.references == 0;
    from.points = tree.points;
    from.queries = queries.data();
    from.invalid = invalid;
    return from;
}

inline PairSet pair_set(const DevicePrimitives& tree) {
    return {tree.nodes, tree.order, tree.triangles, tree.boxes, tree.points, tree.references};
}

inline std::uint32_t count_of(std::span<const Vec3> queries) {
    return static_cast<std::uint32_t>(queries.size());
}

template <class Launcher>
void launch_knn(Launcher& launcher, const DevicePoints& tree, std::span<const Vec3> queries,
                std::uint32_t k, std::span<std::uint32_t> indices, std::span<float> distances,
                std::uint32_t* invalid) {
    launcher.launch(
        "query.knn", count_of(queries),
        FindNearest{queries_on(tree, queries, invalid), k, indices.data(), distances.data()});
}

template <class Launcher>
void launch_radius_count(Launcher& launcher, const DevicePoints& tree,
                         std::span<const Vec3> queries, float radius,
                         std::span<std::uint64_t> offsets, std::uint32_t* invalid) {
    const std::uint32_t n = count_of(queries);
    launcher.launch(
        "query.radius.count", n + 1,
        CountWithin{queries_on(tree, queries, invalid), n, radius * radius, offsets.data()});
    launcher.exclusive_scan_wide("query.radius.offsets", offsets.data(), n + 1);
}

template <class Launcher>
void launch_radius_fill(Launcher& launcher, const DevicePoints& tree, std::span<const Vec3> queries,
                        float radius, std::span<const std::uint64_t> offsets, bool by_distance,
                        std::span<std::uint32_t> indices, std::span<float> distances) {
    launcher.launch("query.radius.fill", count_of(queries),
                    FillWithin{queries_on(tree, queries, nullptr), radius * radius, by_distance,
                               offsets.data(), indices.size(), indices.data(), distances.data()});
}

template <class Launcher>
void launch_closest(Launcher& launcher, const DevicePrimitives& tree, std::span<const Vec3> queries,
                    float max_distance, std::span<ClosestPoint> results, std::uint32_t* invalid) {
    FindClosest work{{}, queries.data(), max_distance * max_distance, results.data(), invalid};
    work.tree.nodes = tree.nodes;
    work.tree.triangles = tree.triangles;
    work.tree.order = tree.order;
    work.tree.max_depth = tree.max_depth;
    work.tree.empty = tree.references == 0;
    launcher.launch("query.closest", count_of(queries), work);
}

/// Calls with(std::bool_constant same, std::bool_constant narrow).
template <class With>
void with_pair_kind(const DevicePairQuery& query, const With& with) {
    const auto narrow_too = [&](auto same) {
        query.narrow ? with(same, std::true_type()) : with(same, std::false_type());
    };
    query.between ? narrow_too(std::false_type()) : narrow_too(std::true_type());
}

/// Threads: one for each primitive of the first set, none if the other is empty.
inline std::uint32_t walkers_of(const DevicePairQuery& query) {
    return query.between && query.b.references == 0 ? 0 : query.a.references;
}

template <class Launcher>
void launch_pairs_count(Launcher& launcher, const DevicePairQuery& query,
                        std::span<std::uint64_t> offsets) {
    const std::uint32_t rows = query.a.input_count + 1;
    launcher.launch("query.pairs.clear", rows, ClearOffset{offsets.data()});
    with_pair_kind(query, [&](auto same, auto narrow) {
        const PartnerWalk<same, narrow> walk{pair_set(query.a),
                                             pair_set(query.between ? query.b : query.a)};
        launcher.launch("query.pairs.count", walkers_of(query),
                        CountPartners<same, narrow>{walk, offsets.data()});
    });
    launcher.exclusive_scan_wide("query.pairs.offsets", offsets.data(), rows);
}

template <class Launcher>
void launch_pairs_fill(Launcher& launcher, const DevicePairQuery& query,
                       std::span<const std::uint64_t> offsets, std::span<PrimitivePair> pairs) {
    with_pair_kind(query, [&](auto same, auto narrow) {
        const PartnerWalk<same, narrow> walk{pair_set(query.a),
                                             pair_set(query.between ? query.b : query.a)};
        launcher.launch(
            "query.pairs.fill", walkers_of(query),
            FillPartners<same, narrow>{walk, offsets.data(), pairs.size(), pairs.data()});
    });
}

}  // namespace raydix
