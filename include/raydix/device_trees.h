// k-d trees and octrees built on an NVIDIA GPU, by the rules of raydix/device.h: device pointers
// in, device pointers out, on the caller's stream, memory of the caller's. In a build without CUDA
// every call but the capacities throws BackendUnavailable.
#pragma once

#include <raydix/device.h>
#include <raydix/kdtree.h>
#include <raydix/octree.h>

#include <cstddef>
#include <cstdint>
#include <span>

namespace raydix {

/// Where a k-d tree is written; device memory, aligned to 64 bytes. After the build the arrays are
/// as in KdTree, the first `references` and `2 * inner_count + 2` elements.
struct DeviceKdArrays {
    KdNode* nodes = nullptr;            // [device_node_capacity(n, kind, options)]
    std::uint32_t* order = nullptr;     // [n]
    LeafTriangle* triangles = nullptr;  // [n], of a mesh with triangles
    Vec3* points = nullptr;             // [n], of points
    DeviceCounts* counts = nullptr;     // [1]
};
/// For n primitives at most; `kind` is triangles or points, which differ in the default of
/// max_leaf. Throws InputError as build_kdtree.
[[nodiscard]] std::size_t device_node_capacity(std::uint32_t n, PrimitiveKind kind,
                                               const KdTreeOptions& options);
/// Bytes of scratch for n primitives at most. Throws BackendUnavailable as well.
[[nodiscard]] std::size_t device_scratch_bytes(std::uint32_t n, PrimitiveKind kind,
                                               const KdTreeOptions& options);

/// Builds the tree that build_kdtree builds, bit for bit: bounds, codes, sort, ranges of radix
/// nodes, leaf copies, nodes and their intervals. Asynchronous, without allocation, and in place
/// when called again: see build_bvh_on_device, also for `scratch`, errors and options.
void build_kdtree_on_device(const DeviceMesh& mesh, const KdTreeOptions& options,
                            const DeviceKdArrays& tree, std::span<std::byte> scratch,
                            Stream stream);
/// The same, but waits for the end and returns the milliseconds of the stages (CUDA events).
BuildMs time_kdtree_on_device(const DeviceMesh& mesh, const KdTreeOptions& options,
                              const DeviceKdArrays& tree, std::span<std::byte> scratch,
                              Stream stream);
/// Copies a finished tree to the host (without times). Waits for `stream`; throws as check_counts.
[[nodiscard]] KdTree download_kdtree(const DeviceKdArrays& tree, PrimitiveKind kind,
                                     const KdTreeOptions& options, Stream stream);

/// What the build of an octree found out.
struct DeviceOctreeCounts : DeviceInputCounts {
    std::uint32_t node_count;       // of the whole tree, even where there was too little room
    std::uint32_t level_begin[23];  // first node of each level up to max_level, then node_count
};

/// Where an octree is written; device memory, aligned to 64 bytes. How many nodes there will be is
/// not known before: with more than `node_capacity` no node is written, and counts->node_count says
/// how many it takes.
struct DeviceOctreeArrays {
    OctreeNode* nodes = nullptr;  // [node_capacity]
    std::uint32_t node_capacity = 0;
    std::uint32_t* order = nullptr;        // [n]
    Vec3* points = nullptr;                // [n], of triangles their centres
    DeviceOctreeCounts* counts = nullptr;  // [1]
};
/// The most nodes an octree over n points can have. The built-in scenes have 0.6n to 0.8n with
/// leaves of up to 4 and 1.5n to 3.7n with leaves of 1: the bound is for codes that stay together
/// down to the last level. Throws InputError as build_octree.
[[nodiscard]] std::uint64_t device_node_bound(std::uint32_t n, const OctreeOptions& options);
/// Bytes of scratch for n primitives and `node_capacity` nodes at most. Throws BackendUnavailable
/// as well.
[[nodiscard]] std::size_t device_scratch_bytes(std::uint32_t n, std::uint32_t node_capacity,
                                               const OctreeOptions& options);

/// Builds the octree that build_octree builds, bit for bit; else as build_kdtree_on_device.
void build_octree_on_device(const DeviceMesh& mesh, const OctreeOptions& options,
                            const DeviceOctreeArrays& tree, std::span<std::byte> scratch,
                            Stream stream);
BuildMs time_octree_on_device(const DeviceMesh& mesh, const OctreeOptions& options,
                              const DeviceOctreeArrays& tree, std::span<std::byte> scratch,
                              Stream stream);
/// Waits for `stream`. Throws as check_counts does, and InputError that names the nodes it takes if
/// there was too little room.
[[nodiscard]] Octree download_octree(const DeviceOctreeArrays& tree, PrimitiveKind kind,
                                     const OctreeOptions& options, Stream stream);

/// Device memory for k-d trees over up to n primitives of one kind, kept from one build to the
/// next.
class DeviceKdTree {
public:
    DeviceKdTree() = default;
    DeviceKdTree(PrimitiveKind kind, std::uint32_t n, const KdTreeOptions& options);

    /// The mesh must be of this kind and no larger than promised.
    void build(const DeviceMesh& mesh, Stream stream = nullptr);
    BuildMs build_timed(const DeviceMesh& mesh, Stream stream = nullptr);
    [[nodiscard]] DeviceKdArrays tree() const;
    [[nodiscard]] KdTree download(Stream stream = nullptr) const;
    [[nodiscard]] std::size_t bytes() const;

private:
    PrimitiveKind kind_ = PrimitiveKind::triangles;
    std::uint32_t capacity_ = 0;
    KdTreeOptions options_;
    DeviceBuffer<KdNode> nodes_;
    DeviceBuffer<std::uint32_t> order_;
    DeviceBuffer<LeafTriangle> triangles_;
    DeviceBuffer<Vec3> points_;
    DeviceBuffer<DeviceCounts> counts_;
    DeviceBuffer<std::byte> scratch_;
};

/// Device memory for octrees over up to n primitives of one kind, kept from one build to the next.
class DeviceOctree {
public:
    DeviceOctree() = default;
    /// `node_capacity` 0: 2n + 64, or the bound if that is less.
    DeviceOctree(PrimitiveKind kind, std::uint32_t n, const OctreeOptions& options,
                 std::uint32_t node_capacity = 0);

    void build(const DeviceMesh& mesh, Stream stream = nullptr);
    BuildMs build_timed(const DeviceMesh& mesh, Stream stream = nullptr);
    [[nodiscard]] DeviceOctreeArrays tree() const;
    /// Nodes of the last build's tree, for which there may not have been room. Waits for `stream`.
    [[nodiscard]] std::uint32_t node_count(Stream stream = nullptr) const;
    [[nodiscard]] std::uint32_t node_capacity() const { return node_capacity_; }
    [[nodiscard]] Octree download(Stream stream = nullptr) const;
    [[nodiscard]] std::size_t bytes() const;

private:
    PrimitiveKind kind_ = PrimitiveKind::triangles;
    std::uint32_t capacity_ = 0, node_capacity_ = 0;
    OctreeOptions options_;
    DeviceBuffer<OctreeNode> nodes_;
    DeviceBuffer<std::uint32_t> order_;
    DeviceBuffer<Vec3> points_;
    DeviceBuffer<DeviceOctreeCounts> counts_;
    DeviceBuffer<std::byte> scratch_;
};

}  // namespace raydix
