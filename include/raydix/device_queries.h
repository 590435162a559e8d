// Nearest points, points within a radius, closest points of a mesh and overlapping pairs on a
// device, an NVIDIA GPU or one with OpenCL or AMD's HIP, over trees that lie there
// (raydix/device.h, raydix/device_trees.h). Device pointers in, device pointers out, on the
// caller's stream. Memory belongs to the caller. The answers are those of raydix/points.h,
// closest.h and pairs.h, bit for bit. Plain C++. Where there is no such device every call that
// needs one throws BackendUnavailable.
//
// The calls that take queries or pairs are asynchronous: they put launches on `stream` and return.
// They allocate nothing and wait for nothing. Rows of any length take three steps. `count` writes
// where they begin. The caller reads their total length (device_row_total) and makes room. `fill`
// writes them.
#pragma once

#include <raydix/closest.h>
#include <raydix/device.h>
#include <raydix/device_trees.h>
#include <raydix/pairs.h>

#include <cstddef>
#include <cstdint>
#include <span>

namespace raydix {

/// A k-d tree of points on the device, with what the host must know of it. After a rebuild of the
/// tree it must be made again.
struct DevicePoints {
    const KdNode* nodes = nullptr;
    const std::uint32_t* order = nullptr;  // [references]
    const Vec3* points = nullptr;          // [references], in leaf order
    Aabb bounds{};
    std::uint32_t references = 0;  // points in the tree
    std::uint32_t max_depth = 0;
};
/// Waits for `stream` to learn the tree's counts. Throws InputError: a tree of triangles, a tree
/// deeper than device_query_max_depth. Throws BackendUnavailable, DeviceError.
[[nodiscard]] DevicePoints device_points(const DeviceKdArrays& tree, Stream stream = nullptr);

/// A binary tree on the device, with what the host must know of it. One of the three arrays of
/// primitives is not null, unless the tree is empty. Nodes are aligned to 64 bytes.
struct DevicePrimitives {
    const BvhNode* nodes = nullptr;
    const std::uint32_t* order = nullptr;     // [references]
    const LeafTriangle* triangles = nullptr;  // [references], in leaf order
    const Aabb* boxes = nullptr;
    const Vec3* points = nullptr;
    std::uint32_t input_count = 0;  // primitives given to the build: ids are less than this
    std::uint32_t references = 0;
    std::uint32_t max_depth = 0;
};
/// `kind` is what the tree was built from. Waits for `stream` to learn the tree's counts. Throws
/// InputError: an index past the vertices in the data, a tree deeper than device_query_max_depth.
/// Throws BackendUnavailable, DeviceError.
[[nodiscard]] DevicePrimitives device_primitives(const DeviceTree& tree, PrimitiveKind kind,
                                                 Stream stream = nullptr);

/// The deepest tree that is asked: a thread's stack has so many entries. The InputError for a
/// deeper one names both depths. Radix trees have at most 94 levels. Those of hploc may have more.
inline constexpr std::uint32_t device_query_max_depth = 96;

/// Finds the k nearest points of each query, as knn() of an index over the same points does.
/// queries [n] -> indices and distances [n * k]. Rows are ordered by (d2, index). Where there are
/// fewer points they end with no_primitive and infinity. `invalid` is null, or [1] in device
/// memory: the number of queries that are not finite is added to it. Throws InputError: k = 0,
/// sizes that do not fit, 2^31 - 1 queries or more, a tree deeper than device_query_max_depth.
/// Throws BackendUnavailable, DeviceError.
void knn_on_device(const DevicePoints& tree, std::span<const Vec3> queries, std::uint32_t k,
                   std::span<std::uint32_t> indices, std::span<float> distances,
                   std::uint32_t* invalid, Stream stream);

/// Bytes of scratch that a count needs, for n queries or for a.input_count = n. Throws
/// BackendUnavailable.
[[nodiscard]] std::size_t device_offsets_scratch_bytes(std::uint32_t n);

/// The last of offsets [n + 1], which is the length of all rows together. Waits for `stream`.
/// Throws InputError if there are none.
[[nodiscard]] std::uint64_t device_row_total(std::span<const std::uint64_t> offsets, Stream stream);

/// Writes where the rows of radius_fill_on_device begin. queries [n] -> offsets [n + 1]. A point
/// counts if d2 <= radius * radius. `invalid` as for knn_on_device. `scratch` is device memory of
/// device_offsets_scratch_bytes(n) or more, aligned to 256 bytes. It is in use until the stream is
/// past the call. Throws as knn_on_device does, and InputError: a radius that is negative or NaN,
/// scratch that is too small or not aligned.
void radius_count_on_device(const DevicePoints& tree, std::span<const Vec3> queries, float radius,
                            std::span<std::uint64_t> offsets, std::uint32_t* invalid,
                            std::span<std::byte> scratch, Stream stream);

/// Writes the rows of radius_search(), ascending by index or, with `by_distance`, by (d2, index).
/// tree, queries, radius and offsets are those of the count. `indices` and `distances` are equally
/// long. A row that does not fit into them entirely is not written. Throws as the count does.
void radius_fill_on_device(const DevicePoints& tree, std::span<const Vec3> queries, float radius,
                           std::span<const std::uint64_t> offsets, bool by_distance,
                           std::span<std::uint32_t> indices, std::span<float> distances,
                           Stream stream);

/// Finds what closest_points() finds. queries [n] -> results [n]. `invalid` as for knn_on_device.
/// Throws as knn_on_device does, and InputError: a max_distance that is negative or NaN, a tree of
/// boxes or points.
void closest_points_on_device(const DevicePrimitives& tree, std::span<const Vec3> queries,
                              float max_distance, std::span<ClosestPoint> results,
                              std::uint32_t* invalid, Stream stream);

/// Pairs within one set, or between two.
struct DevicePairQuery {
    DevicePrimitives a;
    DevicePrimitives b{};  // read only if `between`
    bool between = false;
    bool narrow = false;  // as in PairOptions
};
/// Writes where the pairs of each first id begin: offsets [a.input_count + 1]. `scratch` as for
/// radius_count_on_device, with n = a.input_count. Throws InputError: `narrow` with a tree of boxes
/// or points, sizes that do not fit, a tree deeper than device_query_max_depth, scratch that is too
/// small or not aligned. Throws BackendUnavailable, DeviceError.
void pairs_count_on_device(const DevicePairQuery& query, std::span<std::uint64_t> offsets,
                           std::span<std::byte> scratch, Stream stream);
/// Writes the pairs of overlapping_pairs(), sorted. `query` and `offsets` are those of the count.
/// Where `pairs` is too short, the first id whose pairs do not all fit is not written, nor any
/// behind it. Throws as the count does.
void pairs_fill_on_device(const DevicePairQuery& query, std::span<const std::uint64_t> offsets,
                          std::span<PrimitivePair> pairs, Stream stream);

}  // namespace raydix
