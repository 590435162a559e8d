// Tracing on a device, an NVIDIA GPU or one with OpenCL or AMD's HIP, with the kernels of Aila and
// Laine 2009 and 2012: device pointers in, device pointers out, on the caller's stream. Plain C++.
// Where there is no such device every call that needs one throws BackendUnavailable. The triangle
// test is Woop's. Closest hits are those of trace_reference, bit for bit.
#pragma once

#include <raydix/device.h>
#include <raydix/simulate.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

namespace raydix {

/// A tree of triangles in device memory, in the form that the kernels read: node pairs of 64 bytes
/// and Woop's triangles of 48 bytes. It belongs to the device that was current when it was made.
class DeviceWarpTree {
public:
    /// Copies a tree from the host, its wide nodes too if it has them, and waits for the copy.
    /// Throws InputError for a tree deeper than 127, which no kernel has a stack for. Throws
    /// BackendUnavailable, DeviceError.
    explicit DeviceWarpTree(const WarpTree& tree, Stream stream = nullptr);
    /// Takes a tree of triangles that was built on the device with pairs. Pairs and ids are read
    /// where they lie, so they must outlive this object. After a rebuild there it must be made
    /// again. It has no wide nodes. Waits for `stream`,
    /// so that rays may come on any. Throws InputError: a tree without pairs or triangles, one
    /// deeper than 127, an index past the vertices in its data. Throws BackendUnavailable,
    /// DeviceError.
    explicit DeviceWarpTree(const DeviceTree& tree, Stream stream = nullptr);
    ~DeviceWarpTree();
    DeviceWarpTree(DeviceWarpTree&&) noexcept;
    DeviceWarpTree& operator=(DeviceWarpTree&&) noexcept;

    [[nodiscard]] bool empty() const;
    [[nodiscard]] std::uint32_t max_depth() const;
    /// Of device memory that belongs to this object.
    [[nodiscard]] std::uint64_t bytes() const;

    struct Arrays;
    [[nodiscard]] const Arrays& arrays() const { return *arrays_; }

private:
    std::unique_ptr<Arrays> arrays_;
};

struct DeviceTraceOptions {
    WarpKernel kernel = WarpKernel::speculative_while_while;
    bool any_hit = false;  // rays end at the first hit they meet, which differs by kernel
    // Null, or [1] in device memory: the number of invalid rays is added to it.
    std::uint32_t* invalid_rays = nullptr;
};

/// Bytes of scratch that a launch of up to `count` rays needs. Throws InputError: 2^31 - 1 rays or
/// more, a number that is no kernel.
[[nodiscard]] std::size_t device_trace_scratch_bytes(const DeviceWarpTree& tree,
                                                     std::uint32_t count,
                                                     const DeviceTraceOptions& options);

/// Traces rays [n] -> hits [n], both in device memory and aligned to 16 bytes. Invalid rays miss.
///
/// Asynchronous: the call puts launches on `stream` and returns. It allocates nothing and waits for
/// nothing. `scratch` is device memory of device_trace_scratch_bytes or more, aligned to 256 bytes.
/// It is in use until the stream is past the launches. Throws InputError: sizes that differ,
/// 2^31 - 1 rays or more, a number that is no kernel, memory that is too small or not aligned; a
/// kernel that reads_wide_nodes and a tree without them, or with some deeper than 63; one that
/// has_short_stack and a tree deeper than 63. Throws BackendUnavailable, DeviceError.
void trace_warps_on_device(const DeviceWarpTree& tree, std::span<const Ray> rays,
                           std::span<TreeHit> hits, const DeviceTraceOptions& options,
                           std::span<std::byte> scratch, Stream stream);

/// Milliseconds as the device saw them (CUDA events).
struct DeviceTraceMs {
    double kernel = 0;  // of the traversal kernel alone, as Aila and Laine report it
    double total = 0;   // with the preparation of rays and the scaling of hits
};
/// The same, but waits for the end. For measurements.
DeviceTraceMs time_trace_on_device(const DeviceWarpTree& tree, std::span<const Ray> rays,
                                   std::span<TreeHit> hits, const DeviceTraceOptions& options,
                                   std::span<std::byte> scratch, Stream stream);

}  // namespace raydix
