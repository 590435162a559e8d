// Nearest points, points within a radius, closest points of a mesh and overlapping pairs on an
// NVIDIA GPU, over trees that lie there (raydix/device.h, raydix/device_trees.h). Device pointers
// in, device pointers out, on the caller's stream; memory belongs to the caller. The answers are
// those of raydix/points.h, closest.h and pairs.h, bit for bit. Plain C++: in a build without CUDA
// every call that needs a device throws BackendUnavailable.
//
// All launches are asynchronous: nothing is allocated and nothing waited for, and the call returns.
// Rows whose length nobody knows before come in two steps: `count` writes where they begin, the
// caller reads the total (device_row_total) and makes room, `fill` writes them.
#pragma once

#include <raydix/closest.h>
#include <raydix/device.h>
#include <raydix/device_trees.h>
#include <raydix/pairs.h>

#include <cstddef>
#include <cstdint>
#include <span>

namespace raydix {

/// A k-d tree of points on the device with what the host must know of it. After a rebuild of the
/// tree it has to be made anew.
struct DevicePoints {
    const KdNode* nodes = nullptr;
    const std::uint32_t* order = nullptr;  // [references]
    const Vec3* points = nullptr;          // [references], in leaf order
    Aabb bounds{};
    std::uint32_t references = 0;  // points in the tree
    std::uint32_t max_depth = 0;
};
/// Waits for `stream` to learn the tree's counts. Throws InputError for a tree of triangles, and
/// BackendUnavailable, DeviceError.
[[nodiscard]] DevicePoints device_points(const DeviceKdArrays& tree, Stream stream = nullptr);

/// The same of a binary tree. One of the three arrays of primitives is not null, unless the tree is
/// empty; nodes are aligned to 64 bytes.
struct DevicePrimitives {
    const BvhNode* nodes = nullptr;
    const std::uint32_t* order = nullptr;     // [references]
    const LeafTriangle* triangles = nullptr;  // [references], in leaf order
    const Aabb* boxes = nullptr;
    const Vec3* points = nullptr;
    std::uint32_t input_count = 0;  // primitives given to the build; ids are below
    std::uint32_t references = 0;
    std::uint32_t max_depth = 0;
};
/// `kind`: what the tree was built from. Waits for `stream`; throws as device_points does, and
/// InputError as check_counts.
[[nodiscard]] DevicePrimitives device_primitives(const DeviceTree& tree, PrimitiveKind kind,
                                                 Stream stream = nullptr);

/// Trees deeper than this are refused with an InputError that names both depths: a thread's stack
/// has as many entries. Radix trees have at most 94 levels; those of hploc may have more.
inline constexpr std::uint32_t device_query_max_depth = 96;

/// The k nearest points of each query, any k > 0, as knn() of an index over the same points gives
/// them: true distances, ordered by (d2, index); rows end with no_primitive and infinity where
/// there are fewer points. queries [n] -> indices and distances [n * k]. `invalid`: null, or [1] in
/// device memory, to which the number of queries that are not finite is added. Throws InputError: k
/// = 0, sizes that do not fit, 2^31 queries or more, too deep a tree; BackendUnavailable;
/// DeviceError.
void knn_on_device(const DevicePoints& tree, std::span<const Vec3> queries, std::uint32_t k,
                   std::span<std::uint32_t> indices, std::span<float> distances,
                   std::uint32_t* invalid, Stream stream);

/// Bytes of scratch of a count over n queries, or n ids of pairs, that are scanned into offsets.
/// Throws BackendUnavailable.
[[nodiscard]] std::size_t device_offsets_scratch_bytes(std::uint32_t n);

/// Waits for `stream`: the last of offsets [n + 1], which is the length of all rows together.
[[nodiscard]] std::uint64_t device_row_total(std::span<const std::uint64_t> offsets, Stream stream);

/// Where the rows of radius_fill_on_device begin: queries [n] -> offsets [n + 1]. A point counts if
/// d2 <= radius * radius. `scratch`: aligned to 256 bytes, device_offsets_scratch_bytes(n) or more.
/// Throws as knn_on_device, and InputError: a radius that is negative or NaN, too little scratch.
void radius_count_on_device(const DevicePoints& tree, std::span<const Vec3> queries, float radius,
                            std::span<std::uint64_t> offsets, std::uint32_t* invalid,
                            std::span<std::byte> scratch, Stream stream);

/// The rows of radius_search(), ascending by index or, if `by_distance`, by (d2, index). All but
/// the last three arguments are those of the count. Rows that do not fit entirely into the two
/// arrays, which are equally long, are left as they are.
void radius_fill_on_device(const DevicePoints& tree, std::span<const Vec3> queries, float radius,
                           std::span<const std::uint64_t> offsets, bool by_distance,
                           std::span<std::uint32_t> indices, std::span<float> distances,
                           Stream stream);

/// The results of closest_points(): queries [n] -> results [n]. Throws as knn_on_device, and
/// InputError: a max_distance that is negative or NaN, a tree without triangles.
void closest_points_on_device(const DevicePrimitives& tree, std::span<const Vec3> queries,
                              float max_distance, std::span<ClosestPoint> results,
                              std::uint32_t* invalid, Stream stream);

/// Pairs within one set, or between two.
struct DevicePairQuery {
    DevicePrimitives a;
    DevicePrimitives b{};  // only read if `between`
    bool between = false;
    bool narrow = false;  // as in PairOptions
};
/// Where the pairs of each first id begin: offsets [a.input_count + 1]. `scratch` as for the
/// radius, with a.input_count. Throws InputError: `narrow` without triangles, sizes, depths.
void pairs_count_on_device(const DevicePairQuery& query, std::span<std::uint64_t> offsets,
                           std::span<std::byte> scratch, Stream stream);
/// The pairs of overlapping_pairs(), sorted. Those of a first id that do not all fit are left out,
/// and so are all behind them.
void pairs_fill_on_device(const DevicePairQuery& query, std::span<const std::uint64_t> offsets,
                          std::span<PrimitivePair> pairs, Stream stream);

}  // namespace raydix
