// Tracing on an NVIDIA GPU with the kernels of Aila and Laine 2009 and 2012: device pointers in,
// device pointers out, on the caller's stream. Plain C++: in a build without CUDA every call throws
// BackendUnavailable. The triangle test is Woop's, as in trace_reference, whose hits these are bit
// for bit.
#pragma once

#include <raydix/device.h>
#include <raydix/simulate.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

namespace raydix {

/// A tree of triangles in device memory, in the form that the kernels read: node pairs of 64 bytes,
/// Woop's triangles of 48 bytes. It belongs to the device that was current when it was made.
class DeviceWarpTree {
public:
    /// Copies a tree from the host and waits for that. Throws InputError for a tree so deep that no
    /// kernel has a stack for it, naming both depths; BackendUnavailable; DeviceError.
    explicit DeviceWarpTree(const WarpTree& tree, Stream stream = nullptr);
    /// Of a tree of triangles that was built on the device with pairs. Reads the pairs and ids
    /// where they lie: they must outlive this object, and a rebuild there calls for a new one.
    /// Waits for `stream` to learn the tree's counts. Throws as above and as check_counts does;
    /// InputError if the tree has no pairs or no triangles.
    explicit DeviceWarpTree(const DeviceTree& tree, Stream stream = nullptr);
    ~DeviceWarpTree();
    DeviceWarpTree(DeviceWarpTree&&) noexcept;
    DeviceWarpTree& operator=(DeviceWarpTree&&) noexcept;

    [[nodiscard]] bool empty() const;
    [[nodiscard]] std::uint32_t max_depth() const;
    /// Device memory that belongs to this object.
    [[nodiscard]] std::uint64_t bytes() const;

    struct Arrays;
    [[nodiscard]] const Arrays& arrays() const { return *arrays_; }

private:
    std::unique_ptr<Arrays> arrays_;
};

struct DeviceTraceOptions {
    WarpKernel kernel = WarpKernel::speculative_while_while;
    bool any_hit = false;  // rays end at their first hit; which one that is differs by kernel
    // Null, or [1] in device memory: the number of invalid rays is added.
    std::uint32_t* invalid_rays = nullptr;
};

/// Bytes of scratch for launches of up to `count` rays, below 2^31.
[[nodiscard]] std::size_t device_trace_scratch_bytes(const DeviceWarpTree& tree,
                                                     std::uint32_t count,
                                                     const DeviceTraceOptions& options);

/// rays [n] -> hits [n], both in device memory and aligned to 16 bytes. Invalid rays miss.
/// Asynchronous: the launches are put on `stream` and the call returns; nothing is allocated and
/// nothing waited for. `scratch`: device memory, aligned to 256 bytes, device_trace_scratch_bytes
/// or more, in use until the stream is past the launches. Throws InputError, BackendUnavailable,
/// DeviceError.
void trace_warps_on_device(const DeviceWarpTree& tree, std::span<const Ray> rays,
                           std::span<TreeHit> hits, const DeviceTraceOptions& options,
                           std::span<std::byte> scratch, Stream stream);

/// Milliseconds as the device saw them (CUDA events).
struct DeviceTraceMs {
    double kernel = 0;  // of the traversal kernel alone, which is what Aila and Laine report
    double total = 0;   // with the preparation of the rays and the scaling of the hits
};
/// The same, but waits for the end. For measurements.
DeviceTraceMs time_trace_on_device(const DeviceWarpTree& tree, std::span<const Ray> rays,
                                   std::span<TreeHit> hits, const DeviceTraceOptions& options,
                                   std::span<std::byte> scratch, Stream stream);

}  // namespace raydix
