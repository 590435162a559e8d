// Building on an NVIDIA GPU: device pointers in, device pointers out, on the caller's stream.
// Memory belongs to the caller. Plain C++: in a build without CUDA every call but
// `device_available` throws BackendUnavailable.
#pragma once

#include <raydix/bvh.h>

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <type_traits>
#include <utility>

namespace raydix {

/// A cudaStream_t; null is the default stream.
using Stream = void*;

/// True if this build has CUDA and this machine a device that can run it. Never throws.
[[nodiscard]] bool device_available() noexcept;
/// The name of the current device. Throws BackendUnavailable, with the reason, if there is none.
[[nodiscard]] std::string device_name();
/// Waits until `stream` has done all that was asked of it. Throws DeviceError if any of it failed.
void synchronize(Stream stream);

namespace detail {
/// Aligned to 256 bytes. Throws BackendUnavailable or DeviceError.
[[nodiscard]] void* device_allocate(std::size_t bytes);
void device_free(void* memory) noexcept;
void copy_to_device(void* device, const void* host, std::size_t bytes, Stream stream);
void copy_to_host(void* host, const void* device, std::size_t bytes, Stream stream);
}  // namespace detail

/// An array in device memory. Move-only; elements are plain data and start uninitialised. The
/// memory behind it is a whole number of 256-byte lines.
template <class T>
class DeviceBuffer {
    static_assert(std::is_trivially_copyable_v<T>);

public:
    DeviceBuffer() = default;
    explicit DeviceBuffer(std::size_t size) { reset(size); }
    explicit DeviceBuffer(std::span<const T> values, Stream stream = nullptr) {
        upload(values, stream);
    }
    DeviceBuffer(DeviceBuffer&& other) noexcept { swap(other); }
    DeviceBuffer& operator=(DeviceBuffer&& other) noexcept {
        DeviceBuffer moved(std::move(other));
        swap(moved);
        return *this;
    }
    ~DeviceBuffer() { detail::device_free(data_); }

    /// Makes room for `size` elements; the old ones are lost. Keeps the memory if it is large
    /// enough.
    void reset(std::size_t size) {
        if (size > capacity_) {
            *this = DeviceBuffer();
            data_ = static_cast<T*>(detail::device_allocate(size * sizeof(T)));
            capacity_ = size;
        }
        size_ = size;
    }
    /// Copies; `values` may be changed once the call returns.
    void upload(std::span<const T> values, Stream stream = nullptr) {
        reset(values.size());
        detail::copy_to_device(data_, values.data(), values.size_bytes(), stream);
        synchronize(stream);
    }
    /// Waits for `stream`, then copies the first out.size() elements.
    void download(std::span<T> out, Stream stream = nullptr) const {
        detail::copy_to_host(out.data(), data_, out.size_bytes(), stream);
        synchronize(stream);
    }

    [[nodiscard]] T* data() const { return data_; }
    [[nodiscard]] std::size_t size() const { return size_; }
    [[nodiscard]] std::size_t bytes() const { return size_ * sizeof(T); }

private:
    void swap(DeviceBuffer& other) noexcept {
        std::swap(data_, other.data_);
        std::swap(size_, other.size_);
        std::swap(capacity_, other.capacity_);
    }

    T* data_ = nullptr;
    std::size_t size_ = 0;
    std::size_t capacity_ = 0;
};

/// Arrays on the device. Without triangles the vertices are points.
struct DeviceMesh {
    const Vec3* vertices = nullptr;       // [vertex_count]
    std::uint32_t vertex_count = 0;       // below 2^31
    const Triangle* triangles = nullptr;  // [triangle_count]
    std::uint32_t triangle_count = 0;     // below 2^31
};
struct DeviceBoxList {
    const Aabb* boxes = nullptr;  // [count]
    std::uint32_t count = 0;      // below 2^31
};

/// What a build found out about its input; lies on the device until it is asked for.
struct DeviceInputCounts {
    Aabb bounds;                     // around all valid primitives
    std::uint32_t input_count;       // primitives given
    std::uint32_t references;        // of them valid, and so in the tree
    std::uint32_t left_out;          // not finite, out of range or inverted
    std::uint32_t first_left_out;    // the lowest id among them, or no_primitive
    std::uint32_t unreadable;        // triangles with an index past the vertices; left out as well
    std::uint32_t first_unreadable;  // the lowest id among them, or no_primitive
};
/// And about a binary tree.
struct DeviceCounts : DeviceInputCounts {
    std::uint32_t inner_count;  // inner nodes; leaves are one more, unless references is 0
    std::uint32_t max_depth;    // edges from the root to the deepest leaf
};

/// AL09's node of 64 bytes, both children's boxes in one; src/layout/pair64.h tells the fields.
struct NodePair;

/// Where a build writes; every pointer is the caller's device memory, aligned to 64 bytes. After
/// the build the arrays are as in Bvh, the first `references` and `2 * inner_count + 2` elements.
struct DeviceTree {
    BvhNode* nodes = nullptr;           // [device_node_capacity(n, options)]
    std::uint32_t* order = nullptr;     // [n]
    LeafTriangle* triangles = nullptr;  // [n], of a mesh with triangles
    Aabb* boxes = nullptr;              // [n], of boxes
    Vec3* points = nullptr;             // [n], of points
    DeviceCounts* counts = nullptr;     // [1]
    NodePair* pairs = nullptr;          // null, or [device_pair_capacity(n, options)]
    std::uint32_t* pair_ids = nullptr;  // with pairs: [n], primitive ids, bit 31 ends a leaf's list
};
/// For n primitives at most. Throws InputError as device_scratch_bytes.
[[nodiscard]] std::size_t device_node_capacity(std::uint32_t n, const BuildOptions& options);
[[nodiscard]] std::size_t device_pair_capacity(std::uint32_t n, const BuildOptions& options);

/// Bytes of scratch that a build of up to `n` primitives wants with these options. Throws
/// InputError (as build_bvh, and for builders that do not run on a device: those that do are
/// karras, lauterbach, garanzha, apetrei and hploc), BackendUnavailable.
[[nodiscard]] std::size_t device_scratch_bytes(std::uint32_t n, const BuildOptions& options);

/// Builds the tree that build_bvh builds, bit for bit, for the same input: bounds, codes, sort,
/// hierarchy, leaf copies, boxes, and pairs if asked for. raydix/device_trees.h has k-d trees and
/// octrees. Asynchronous: the launches are put on `stream` and the call returns; nothing is
/// allocated and nothing waited for. `scratch`: device memory, aligned to 256 bytes,
/// device_scratch_bytes or more, in use until the stream is past the build. Calling again with the
/// same arrays rebuilds in place. What is wrong with the data is found on the device and stands in
/// `counts`; see check_counts. options.strict and options.threads have no effect here, nor has
/// options.fit on hploc. Throws InputError, BackendUnavailable, DeviceError.
void build_bvh_on_device(const DeviceMesh& mesh, const BuildOptions& options,
                         const DeviceTree& tree, std::span<std::byte> scratch, Stream stream);
void build_bvh_on_device(const DeviceBoxList& boxes, const BuildOptions& options,
                         const DeviceTree& tree, std::span<std::byte> scratch, Stream stream);

/// The same, but waits for the end and returns the milliseconds between the stages as the device
/// saw them (CUDA events; `layout` has the node pairs as well). For measurements.
BuildMs time_build_on_device(const DeviceMesh& mesh, const BuildOptions& options,
                             const DeviceTree& tree, std::span<std::byte> scratch, Stream stream);
BuildMs time_build_on_device(const DeviceBoxList& boxes, const BuildOptions& options,
                             const DeviceTree& tree, std::span<std::byte> scratch, Stream stream);

/// Bytes read and written per second when the device copies `bytes` from one place of its memory to
/// another: the best of `repeat` copies after a first one. Allocates twice `bytes`.
[[nodiscard]] double measure_device_copy(std::size_t bytes, int repeat);

/// Throws the InputError that build_bvh throws for such an input: an index past the vertices or,
/// with `strict`, a primitive that was left out.
void check_counts(const DeviceInputCounts& counts, PrimitiveKind kind, bool strict);

/// Copies a finished tree to the host, as the Bvh that build_bvh returns (without times). Waits for
/// `stream`; throws as check_counts does.
[[nodiscard]] Bvh download_bvh(const DeviceTree& tree, PrimitiveKind kind,
                               const BuildOptions& options, Stream stream);

/// Device memory for builds of up to so many primitives of one kind, kept from one build to the
/// next: the convenient way to DeviceTree.
class DeviceBvh {
public:
    DeviceBvh() = default;
    /// `with_pairs`: also AL09's node pairs. Throws as device_scratch_bytes does.
    DeviceBvh(PrimitiveKind kind, std::uint32_t n, const BuildOptions& options,
              bool with_pairs = false);

    /// As build_bvh_on_device. The input must be of this kind and no larger than promised.
    void build(const DeviceMesh& mesh, Stream stream = nullptr);
    void build(const DeviceBoxList& boxes, Stream stream = nullptr);
    /// As time_build_on_device.
    BuildMs build_timed(const DeviceMesh& mesh, Stream stream = nullptr);
    [[nodiscard]] DeviceTree tree() const;
    [[nodiscard]] Bvh download(Stream stream = nullptr) const;
    [[nodiscard]] std::size_t bytes() const;

private:
    void check_input(PrimitiveKind kind, std::uint32_t n) const;
    void check_input(const DeviceMesh& mesh) const;

    PrimitiveKind kind_ = PrimitiveKind::triangles;
    std::uint32_t capacity_ = 0;
    BuildOptions options_;
    DeviceBuffer<BvhNode> nodes_;
    DeviceBuffer<std::uint32_t> order_, pair_ids_;
    DeviceBuffer<LeafTriangle> triangles_;
    DeviceBuffer<Aabb> boxes_;
    DeviceBuffer<Vec3> points_;
    DeviceBuffer<DeviceCounts> counts_;
    DeviceBuffer<std::byte> pairs_, scratch_;
};

}  // namespace raydix
