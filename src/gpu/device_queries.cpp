// What raydix/device_queries.h does on the host: headers that come back, and what is refused.
#include "gpu/device_queries.h"

#include <raydix/error.h>

#include <string>

#include "base/options.h"
#include "exec/arena.h"
#include "gpu/device_fetch.h"

namespace raydix {
namespace {

void check_depth(std::uint32_t max_depth) {
    if (max_depth > device_query_max_depth)
        throw InputError("the tree is " + std::to_string(max_depth) +
                         " levels deep; queries on a device have stacks for " +
                         std::to_string(device_query_max_depth));
}

void check_count(std::span<const Vec3> queries) {
    if (queries.size() >= 0x7FFFFFFFu) throw InputError("2^31 queries or more in one launch");
}

[[noreturn]] void no_room(const char* what, std::size_t wanted, std::size_t given) {
    throw InputError(std::string(what) + " on a device: " + std::to_string(wanted) +
                     " results, but room for " + std::to_string(given));
}

void check_offsets(std::size_t rows, std::size_t offsets) {
    if (offsets != rows + 1)
        throw InputError("offsets on a device: " + std::to_string(rows) + " rows want " +
                         std::to_string(rows + 1) + " of them, not " + std::to_string(offsets));
}

}  // namespace

DevicePoints device_points(const DeviceKdArrays& tree, Stream stream) {
    static_cast<void>(device_name());  // says what is missing
    const DeviceCounts counts = fetch_counts(tree.counts, stream);
    check_counts(counts, PrimitiveKind::points, false);
    if (counts.references != 0 && tree.points == nullptr)
        throw InputError("point queries on a device: the k-d tree holds no points");
    check_depth(counts.max_depth);
    return {tree.nodes,    tree.order,        tree.points,
            counts.bounds, counts.references, counts.max_depth};
}

DevicePrimitives device_primitives(const DeviceTree& tree, PrimitiveKind kind, Stream stream) {
    static_cast<void>(device_name());
    const DeviceCounts counts = fetch_counts(tree.counts, stream);
    check_counts(counts, kind, false);
    check_depth(counts.max_depth);
    DevicePrimitives found;
    found.nodes = tree.nodes;
    found.order = tree.order;
    if (kind == PrimitiveKind::triangles) found.triangles = tree.triangles;
    if (kind == PrimitiveKind::boxes) found.boxes = tree.boxes;
    if (kind == PrimitiveKind::points) found.points = tree.points;
    found.input_count = counts.input_count;
    found.references = counts.references;
    found.max_depth = counts.max_depth;
    return found;
}

std::uint64_t device_row_total(std::span<const std::uint64_t> offsets, Stream stream) {
    if (offsets.empty()) throw InputError("offsets on a device: there are none");
    std::uint64_t total = 0;
    detail::copy_to_host(&total, &offsets.back(), sizeof(total), stream);
    synchronize(stream);
    return total;
}

void check_knn(const DevicePoints& tree, std::span<const Vec3> queries, std::uint32_t k,
               std::span<std::uint32_t> indices, std::span<float> distances) {
    check_depth(tree.max_depth);
    check_count(queries);
    if (k == 0) throw InputError("nearest points on a device: k is 0; it must be at least 1");
    const std::size_t wanted = queries.size() * k;
    if (indices.size() != wanted) no_room("nearest points", wanted, indices.size());
    if (distances.size() != wanted) no_room("nearest points", wanted, distances.size());
}

void check_radius(const DevicePoints& tree, std::span<const Vec3> queries, float radius,
                  std::size_t offsets) {
    check_depth(tree.max_depth);
    check_count(queries);
    check_not_negative("points within a radius on a device: the radius", radius);
    check_offsets(queries.size(), offsets);
}

void check_rows(std::size_t indices, std::size_t distances) {
    if (indices != distances) no_room("points within a radius", indices, distances);
}

void check_closest(const DevicePrimitives& tree, std::span<const Vec3> queries, float max_distance,
                   std::size_t results) {
    check_depth(tree.max_depth);
    check_count(queries);
    check_not_negative("closest points on a device: max_distance", max_distance);
    if (tree.references != 0 && tree.triangles == nullptr)
        throw InputError("closest points on a device need triangles");
    if (results != queries.size()) no_room("closest points", queries.size(), results);
}

void check_pairs(const DevicePairQuery& query, std::size_t offsets) {
    const auto check_set = [&](const DevicePrimitives& set) {
        check_depth(set.max_depth);
        if (set.references == 0) return;
        if (query.narrow && set.triangles == nullptr)
            throw InputError("pairs on a device: narrow needs triangles");
        if (set.triangles == nullptr && set.boxes == nullptr && set.points == nullptr)
            throw InputError("pairs on a device: a tree without primitives");
    };
    check_set(query.a);
    if (query.between) check_set(query.b);
    check_offsets(query.a.input_count, offsets);
}

void check_offsets_scratch(std::span<std::byte> scratch, std::size_t needed) {
    if (scratch.size() < needed)
        throw InputError("offsets on a device want " + std::to_string(needed) +
                         " bytes of scratch; " + std::to_string(scratch.size()) + " were given");
    if (reinterpret_cast<std::uintptr_t>(scratch.data()) % Arena::alignment != 0)
        throw InputError("the scratch on the device is not aligned to 256 bytes");
}

}  // namespace raydix
