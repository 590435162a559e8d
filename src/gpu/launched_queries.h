// Queries of device_queries.h, and names of hits, on a stream of any machine.
#pragma once

#include "engine/name_hit.h"
#include "gpu/device_queries.h"
#include "gpu/launched_backend.h"

namespace raydix {

template <class Machine>
auto LaunchedQueries<Machine>::scanning_launcher(Scratch scratch, std::uint32_t rows,
                                                 Stream stream) {
    check_offsets_scratch(scratch, offsets_scratch_bytes(rows));
    return this->machine_.launcher(stream, scratch.data(), scratch.size());
}

template <class Machine>
std::size_t LaunchedQueries<Machine>::offsets_scratch_bytes(std::uint32_t n) {
    static_cast<void>(this->name());  // says what is missing
    typename Machine::Sizer sizer;
    sizer.exclusive_scan_wide("", nullptr, n + 1);
    return Machine::reserved_bytes + sizer.bytes();
}

template <class Machine>
void LaunchedQueries<Machine>::knn(const DevicePoints& tree, std::span<const Vec3> queries,
                                   std::uint32_t k, std::span<std::uint32_t> indices,
                                   std::span<float> distances, std::uint32_t* invalid,
                                   Stream stream) {
    static_cast<void>(this->name());
    check_knn(tree, queries, k, indices, distances);
    auto launcher = this->plain_launcher(stream);
    launch_knn(launcher, tree, queries, k, indices, distances, invalid);
}

template <class Machine>
void LaunchedQueries<Machine>::radius_count(const DevicePoints& tree, std::span<const Vec3> queries,
                                            float radius, std::span<std::uint64_t> offsets,
                                            std::uint32_t* invalid, Scratch scratch,
                                            Stream stream) {
    static_cast<void>(this->name());
    check_radius(tree, queries, radius, offsets.size());
    auto launcher = scanning_launcher(scratch, count_of(queries), stream);
    launch_radius_count(launcher, tree, queries, radius, offsets, invalid);
}

template <class Machine>
void LaunchedQueries<Machine>::radius_fill(const DevicePoints& tree, std::span<const Vec3> queries,
                                           float radius, std::span<const std::uint64_t> offsets,
                                           bool by_distance, std::span<std::uint32_t> indices,
                                           std::span<float> distances, Stream stream) {
    static_cast<void>(this->name());
    check_radius(tree, queries, radius, offsets.size());
    check_rows(indices.size(), distances.size());
    auto launcher = this->plain_launcher(stream);
    launch_radius_fill(launcher, tree, queries, radius, offsets, by_distance, indices, distances);
}

template <class Machine>
void LaunchedQueries<Machine>::closest_points(const DevicePrimitives& tree,
                                              std::span<const Vec3> queries, float max_distance,
                                              std::span<ClosestPoint> results,
                                              std::uint32_t* invalid, Stream stream) {
    static_cast<void>(this->name());
    check_closest(tree, queries, max_distance, results.size());
    auto launcher = this->plain_launcher(stream);
    launch_closest(launcher, tree, queries, max_distance, results, invalid);
}

template <class Machine>
void LaunchedQueries<Machine>::pairs_count(const DevicePairQuery& query,
                                           std::span<std::uint64_t> offsets, Scratch scratch,
                                           Stream stream) {
    static_cast<void>(this->name());
    check_pairs(query, offsets.size());
    auto launcher = scanning_launcher(scratch, query.a.input_count, stream);
    launch_pairs_count(launcher, query, offsets);
}

template <class Machine>
void LaunchedQueries<Machine>::pairs_fill(const DevicePairQuery& query,
                                          std::span<const std::uint64_t> offsets,
                                          std::span<PrimitivePair> pairs, Stream stream) {
    static_cast<void>(this->name());
    check_pairs(query, offsets.size());
    auto launcher = this->plain_launcher(stream);
    launch_pairs_fill(launcher, query, offsets, pairs);
}

template <class Machine>
void LaunchedQueries<Machine>::name_hits(const DeviceMeshNames& names,
                                         std::span<const TreeHit> found, std::span<Hit> hits,
                                         Stream stream) {
    static_cast<void>(this->name());
    check_name_hits(found.size(), hits.size());
    if (found.size() >= 0x80000000u) throw InputError("2^31 hits or more in one launch");
    auto launcher = this->plain_launcher(stream);
    launcher.launch(
        "scene.name", static_cast<std::uint32_t>(found.size()),
        NameHit{{names.first(), names.ids(), names.count()}, found.data(), hits.data()});
}

}  // namespace raydix
