// Building k-d trees and octrees on a device, an NVIDIA GPU or one with OpenCL or AMD's HIP, by the
// rules of raydix/device.h: device pointers in, device pointers out, on the caller's stream. Memory
// belongs to the caller. Where there is no such device every call that needs one throws
// BackendUnavailable.
#pragma once

#include <raydix/device.h>
#include <raydix/kdtree.h>
#include <raydix/octree.h>

#include <cstddef>
#include <cstdint>
#include <span>

namespace raydix {

/// Where a k-d tree is written. Every pointer is device memory, aligned to 64 bytes. After the
/// build the arrays hold what those of a KdTree hold: `nodes` in its first 2 * inner_count + 2
/// elements, the others in their first `references`.
struct DeviceKdArrays {
    KdNode* nodes = nullptr;            // [device_node_capacity(n, kind, options)]
    std::uint32_t* order = nullptr;     // [n]
    LeafTriangle* triangles = nullptr;  // [n], of a mesh with triangles
    Vec3* points = nullptr;             // [n], of points
    DeviceCounts* counts = nullptr;     // [1]
};
/// Number of elements that `nodes` needs for up to n primitives. `kind` is triangles or points,
/// which differ in the default of max_leaf. Throws InputError: an option out of range, 2^31
/// primitives or more, more inner nodes than a k-d tree can number.
[[nodiscard]] std::size_t device_node_capacity(std::uint32_t n, PrimitiveKind kind,
                                               const KdTreeOptions& options);
/// Bytes of scratch that a build of up to n primitives needs. Throws InputError as
/// device_node_capacity does, and BackendUnavailable.
[[nodiscard]] std::size_t device_scratch_bytes(std::uint32_t n, PrimitiveKind kind,
                                               const KdTreeOptions& options);

/// Builds the tree that build_kdtree builds from the same input, bit for bit. Asynchronous;
/// `scratch`, rebuilds, faults of the data, options and errors as for build_bvh_on_device.
void build_kdtree_on_device(const DeviceMesh& mesh, const KdTreeOptions& options,
                            const DeviceKdArrays& tree, std::span<std::byte> scratch,
                            Stream stream);
/// The same, but waits for the end. Returns the milliseconds of the stages as the device saw them
/// (CUDA events). For measurements.
BuildMs time_kdtree_on_device(const DeviceMesh& mesh, const KdTreeOptions& options,
                              const DeviceKdArrays& tree, std::span<std::byte> scratch,
                              Stream stream);
/// Copies a finished tree to the host. Its times and peak_bytes are 0. Waits for `stream`. Throws
/// as check_counts does with options.strict, and BackendUnavailable, DeviceError.
[[nodiscard]] KdTree download_kdtree(const DeviceKdArrays& tree, PrimitiveKind kind,
                                     const KdTreeOptions& options, Stream stream);

/// What a build finds out about its input and about the octree.
struct DeviceOctreeCounts : DeviceInputCounts {
    std::uint32_t node_count;       // of the whole tree, even where there was too little room
    std::uint32_t level_begin[23];  // first node of each level up to max_level, then node_count
};

/// Where an octree is written. Every pointer is device memory, aligned to 64 bytes. The number of
/// nodes is not known before the build. If it is more than `node_capacity`, no node is written;
/// counts->node_count says how many there are.
struct DeviceOctreeArrays {
    OctreeNode* nodes = nullptr;  // [node_capacity]
    std::uint32_t node_capacity = 0;
    std::uint32_t* order = nullptr;        // [n]
    Vec3* points = nullptr;                // [n], of triangles the centers of their boxes
    DeviceOctreeCounts* counts = nullptr;  // [1]
};
/// The most nodes that an octree over n points can have. Most octrees have far fewer
/// (docs/algorithms/octree.md). Throws InputError: an option out of range, 2^28 points or more.
[[nodiscard]] std::uint64_t device_node_bound(std::uint32_t n, const OctreeOptions& options);
/// Bytes of scratch that a build of up to n primitives and `node_capacity` nodes needs. Throws
/// InputError as device_node_bound does, and BackendUnavailable.
[[nodiscard]] std::size_t device_scratch_bytes(std::uint32_t n, std::uint32_t node_capacity,
                                               const OctreeOptions& options);

/// Builds the octree that build_octree builds from the same input, bit for bit. All else as for
/// build_kdtree_on_device.
void build_octree_on_device(const DeviceMesh& mesh, const OctreeOptions& options,
                            const DeviceOctreeArrays& tree, std::span<std::byte> scratch,
                            Stream stream);
BuildMs time_octree_on_device(const DeviceMesh& mesh, const OctreeOptions& options,
                              const DeviceOctreeArrays& tree, std::span<std::byte> scratch,
                              Stream stream);
/// Copies a finished octree to the host, as download_kdtree does. Throws InputError also if there
/// was too little room, and names the number of nodes.
[[nodiscard]] Octree download_octree(const DeviceOctreeArrays& tree, PrimitiveKind kind,
                                     const OctreeOptions& options, Stream stream);

/// Device memory for k-d trees over up to n primitives of one kind, kept from one build to the
/// next.
class DeviceKdTree {
public:
    DeviceKdTree() = default;
    /// Throws as device_scratch_bytes does, and DeviceError.
    DeviceKdTree(PrimitiveKind kind, std::uint32_t n, const KdTreeOptions& options);

    /// As build_kdtree_on_device. Throws InputError also for primitives of another kind, or more
    /// than n.
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
    /// `node_capacity` 0: 2n + 64, or device_node_bound if that is less. Throws as
    /// device_scratch_bytes does, and DeviceError.
    DeviceOctree(PrimitiveKind kind, std::uint32_t n, const OctreeOptions& options,
                 std::uint32_t node_capacity = 0);

    /// As build_octree_on_device. Throws InputError also for primitives of another kind, or more
    /// than n.
    void build(const DeviceMesh& mesh, Stream stream = nullptr);
    BuildMs build_timed(const DeviceMesh& mesh, Stream stream = nullptr);
    [[nodiscard]] DeviceOctreeArrays tree() const;
    /// Number of nodes of the last build's octree, whether there was room or not. Waits for
    /// `stream`.
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
