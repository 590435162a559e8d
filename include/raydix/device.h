// Building on a device, an NVIDIA GPU or one with OpenCL or AMD's HIP: device pointers in, device
// pointers out, on the caller's stream. Memory belongs to the caller. Plain C++. Where there is no
// such device every call that needs one throws BackendUnavailable.
#pragma once

#include <raydix/bvh.h>

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

namespace raydix {

/// A cudaStream_t, null for the default stream; or an in-order cl_command_queue of the context that
/// opencl_context() returns, null for the device's own; or a hipStream_t of the selected device,
/// null for its own, which does not wait for others.
using Stream = void*;

/// A device that this build and this machine have, or why one that is there cannot be used.
struct DeviceDescription {
    std::string selector;  // as select_device takes it
    std::string name;      // the driver's, or "" if there is no device
    std::string driver;    // its version, or ""
    std::string missing;   // "" if it can be used; else the reason
};
/// One at least for each kind of device that the library knows. Opens nothing. Never throws.
[[nodiscard]] std::vector<DeviceDescription> list_devices();
/// What the device calls of this thread run on from now on: "cuda", which is where a thread starts,
/// "opencl", "opencl:N", "hip" or "hip:N". Memory and trees belong to the device that was selected
/// when they were made, and calls with them need it selected. Opens a device that was never
/// selected before, which compiles a few kernels; others are compiled by the first call that runs
/// them. Throws InputError for another word. Throws BackendUnavailable with what the device lacks.
/// A call that throws has selected nothing.
void select_device(std::string_view selector);
/// As it was selected last, by this thread.
[[nodiscard]] std::string selected_device();
/// The cl_context and cl_device_id of the selected OpenCL device: queues and memory of the caller's
/// are made in them. Memory is that of cl_intel_unified_shared_memory. Throws BackendUnavailable if
/// another kind of device is selected.
[[nodiscard]] void* opencl_context();
[[nodiscard]] void* opencl_device_id();

/// True if the selected device can be used. Never throws.
[[nodiscard]] bool device_available() noexcept;
/// The name of the selected device. Throws BackendUnavailable, which says why, if there is none.
[[nodiscard]] std::string device_name();
/// Waits until `stream` has done all that was put on it. Throws DeviceError if any of it failed.
void synchronize(Stream stream);

class DeviceBackend;  // of the library's own

/// The GPU of CUDA that `memory` lies in is this thread's current one for as long as this lives;
/// then it is the one from before. Does nothing for memory of the host and for other kinds of
/// devices. Calls with memory or trees of a device do so by themselves; what is allocated lies on
/// the current GPU. Throws DeviceError.
class OnDeviceOf {
public:
    explicit OnDeviceOf(const void* memory);
    ~OnDeviceOf();
    OnDeviceOf(const OnDeviceOf&) = delete;
    OnDeviceOf& operator=(const OnDeviceOf&) = delete;

    /// The current GPU's number in CUDA; -1 for other kinds of devices.
    [[nodiscard]] int index() const;

private:
    DeviceBackend* backend_;
    int before_;
};

namespace detail {
struct DeviceMemory {
    void* data = nullptr;
    DeviceBackend* owner = nullptr;
};
/// Aligned to 256 bytes. Throws BackendUnavailable or DeviceError.
[[nodiscard]] DeviceMemory device_allocate(std::size_t bytes);
void device_free(const DeviceMemory& memory) noexcept;
void copy_to_device(void* device, const void* host, std::size_t bytes, Stream stream);
void copy_to_host(void* host, const void* device, std::size_t bytes, Stream stream);
}  // namespace detail

/// An array in device memory. Move-only. Elements are plain data and start uninitialised. Memory is
/// taken in whole lines of 256 bytes.
template <class T>
class DeviceBuffer {
    static_assert(std::is_trivially_copyable_v<T>);

public:
    DeviceBuffer() = default;
    explicit DeviceBuffer(std::size_t size) { reset(size); }
    explicit DeviceBuffer(std::span<const T> values, Stream stream = nullptr) : DeviceBuffer() {
        upload(values, stream);  // if it throws, the memory is freed: the first constructor is done
    }
    DeviceBuffer(DeviceBuffer&& other) noexcept { swap(other); }
    DeviceBuffer& operator=(DeviceBuffer&& other) noexcept {
        DeviceBuffer moved(std::move(other));
        swap(moved);
        return *this;
    }
    ~DeviceBuffer() { detail::device_free(memory_); }

    /// Makes room for `size` elements. The old ones are lost. Keeps the memory if it is large
    /// enough. Throws BackendUnavailable, DeviceError.
    void reset(std::size_t size) {
        if (size > capacity_) {
            *this = DeviceBuffer();
            constexpr std::size_t all = std::numeric_limits<std::size_t>::max();
            memory_ = detail::device_allocate(size > all / sizeof(T) ? all : size * sizeof(T));
            capacity_ = size;
        }
        size_ = size;
    }
    /// Copies `values` and waits for the end: they may change once the call returns.
    void upload(std::span<const T> values, Stream stream = nullptr) {
        reset(values.size());
        detail::copy_to_device(memory_.data, values.data(), values.size_bytes(), stream);
        synchronize(stream);
    }
    /// Copies the first out.size() elements, after all that is on `stream`, and waits for the end.
    /// There must be so many.
    void download(std::span<T> out, Stream stream = nullptr) const {
        detail::copy_to_host(out.data(), memory_.data, out.size_bytes(), stream);
        synchronize(stream);
    }

    [[nodiscard]] T* data() const { return static_cast<T*>(memory_.data); }
    [[nodiscard]] std::size_t size() const { return size_; }
    [[nodiscard]] std::size_t bytes() const { return size_ * sizeof(T); }

private:
    void swap(DeviceBuffer& other) noexcept {
        std::swap(memory_, other.memory_);
        std::swap(size_, other.size_);
        std::swap(capacity_, other.capacity_);
    }

    detail::DeviceMemory memory_;
    std::size_t size_ = 0;
    std::size_t capacity_ = 0;
};

/// A mesh on the device. Without triangles its vertices are the primitives, as points.
struct DeviceMesh {
    const Vec3* vertices = nullptr;       // [vertex_count]
    std::uint32_t vertex_count = 0;       // below 2^31
    const Triangle* triangles = nullptr;  // [triangle_count]
    std::uint32_t triangle_count = 0;     // below 2^31
};
/// Boxes on the device.
struct DeviceBoxList {
    const Aabb* boxes = nullptr;  // [count]
    std::uint32_t count = 0;      // below 2^31
};

/// What a build finds out about its input. It lies on the device.
struct DeviceInputCounts {
    Aabb bounds;                     // around all valid primitives
    std::uint32_t input_count;       // primitives given
    std::uint32_t references;        // of them valid, and so in the tree
    std::uint32_t left_out;          // not finite, out of range or inverted
    std::uint32_t first_left_out;    // the lowest id among them, or no_primitive
    std::uint32_t unreadable;        // triangles with an index past the vertices; left out as well
    std::uint32_t first_unreadable;  // the lowest id among them, or no_primitive
};
/// What a build finds out about its input and about the binary tree.
struct DeviceCounts : DeviceInputCounts {
    std::uint32_t inner_count;  // inner nodes; leaves are one more, unless references is 0
    std::uint32_t max_depth;    // edges from the root to the deepest leaf
};

/// The node of 64 bytes of Aila and Laine 2009: it holds the boxes of both children. Its fields are
/// in src/layout/pair64.h.
struct NodePair;

/// Where a build writes. Every pointer is device memory of the caller's, aligned to 64 bytes. After
/// the build the arrays hold what those of a Bvh hold: `nodes` in its first 2 * inner_count + 2
/// elements, the others in their first `references`.
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
/// Number of elements that `nodes` and `pairs` need for up to n primitives. Throws InputError as
/// device_scratch_bytes does.
[[nodiscard]] std::size_t device_node_capacity(std::uint32_t n, const BuildOptions& options);
[[nodiscard]] std::size_t device_pair_capacity(std::uint32_t n, const BuildOptions& options);

/// Bytes of scratch that a build of up to n primitives needs. karras, lauterbach, garanzha, apetrei
/// and hploc run on a device. Throws InputError: another builder, any reinsertion rounds, an option
/// out of range, 2^31 primitives or more. Throws BackendUnavailable.
[[nodiscard]] std::size_t device_scratch_bytes(std::uint32_t n, const BuildOptions& options);

/// Builds the tree that build_bvh builds from the same input, bit for bit, and the node pairs if
/// `tree.pairs` is not null. k-d trees and octrees are in raydix/device_trees.h.
///
/// Asynchronous: the call puts launches on `stream` and returns. It allocates nothing and waits for
/// nothing. `scratch` is device memory of device_scratch_bytes or more, aligned to 256 bytes. It is
/// in use until the stream is past the build. Another call with the same arrays rebuilds in place.
///
/// Faults of the data are found on the device and stand in `counts` (check_counts). options.strict
/// and options.threads have no effect, nor has options.fit for hploc. Throws InputError as
/// device_scratch_bytes does, and for scratch that is too small or not aligned. Throws
/// BackendUnavailable, DeviceError.
void build_bvh_on_device(const DeviceMesh& mesh, const BuildOptions& options,
                         const DeviceTree& tree, std::span<std::byte> scratch, Stream stream);
void build_bvh_on_device(const DeviceBoxList& boxes, const BuildOptions& options,
                         const DeviceTree& tree, std::span<std::byte> scratch, Stream stream);

/// The same, but waits for the end. Returns the milliseconds of the stages as the device saw them
/// (CUDA events; with others the host's clock, which waits behind each stage). `layout` includes
/// the node pairs. For measurements.
BuildMs time_build_on_device(const DeviceMesh& mesh, const BuildOptions& options,
                             const DeviceTree& tree, std::span<std::byte> scratch, Stream stream);
BuildMs time_build_on_device(const DeviceBoxList& boxes, const BuildOptions& options,
                             const DeviceTree& tree, std::span<std::byte> scratch, Stream stream);

/// Copies `bytes` from one place of the device's memory to another, once and then `repeat` times.
/// Returns the bytes read and written per second by the fastest of the `repeat` copies. Allocates
/// twice `bytes`. Throws BackendUnavailable, DeviceError.
[[nodiscard]] double measure_device_copy(std::size_t bytes, int repeat);

/// Throws InputError where build_bvh would, for the same input: an index past the vertices or, with
/// `strict`, a primitive that was left out.
void check_counts(const DeviceInputCounts& counts, PrimitiveKind kind, bool strict);

/// Copies a finished tree to the host, as the Bvh that build_bvh returns. Its times and peak_bytes
/// are 0. Waits for `stream`. Throws as check_counts does with options.strict, and
/// BackendUnavailable, DeviceError.
[[nodiscard]] Bvh download_bvh(const DeviceTree& tree, PrimitiveKind kind,
                               const BuildOptions& options, Stream stream);

/// Device memory for builds of up to n primitives of one kind, kept from one build to the next. The
/// convenient way to a DeviceTree.
class DeviceBvh {
public:
    DeviceBvh() = default;
    /// `with_pairs`: builds make node pairs too. Throws as device_scratch_bytes does, and
    /// DeviceError.
    DeviceBvh(PrimitiveKind kind, std::uint32_t n, const BuildOptions& options,
              bool with_pairs = false);

    /// As build_bvh_on_device. Throws InputError also for primitives of another kind, or more than
    /// n.
    void build(const DeviceMesh& mesh, Stream stream = nullptr);
    void build(const DeviceBoxList& boxes, Stream stream = nullptr);
    /// As time_build_on_device.
    BuildMs build_timed(const DeviceMesh& mesh, Stream stream = nullptr);
    [[nodiscard]] DeviceTree tree() const;
    /// As download_bvh.
    [[nodiscard]] Bvh download(Stream stream = nullptr) const;
    /// Of all arrays, scratch included.
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
