// Rays through a compressed wide tree on a device, an NVIDIA GPU or one with OpenCL or AMD's HIP
// (Ylitie, Karras, Laine 2017): device pointers in, device pointers out, on the caller's stream.
// Memory belongs to the caller. Plain C++. Where there is no such device every call that needs one
// throws BackendUnavailable.
#pragma once

#include <raydix/cwbvh.h>
#include <raydix/device.h>
#include <raydix/types.h>

#include <cstddef>
#include <cstdint>
#include <span>

namespace raydix {

/// The node of 80 bytes and the triangle of 48. Their fields are in src/layout/cwbvh.h.
struct CwbvhNode;
struct CwbvhTriangle;

/// A tree in device memory. Pointers are aligned to 16 bytes.
struct DeviceCwbvhTree {
    const CwbvhNode* nodes = nullptr;          // [node_count]
    const CwbvhTriangle* triangles = nullptr;  // [references]
    std::uint32_t node_count = 0;              // 0: nothing to hit
    std::uint32_t max_depth = 0;               // as in CwbvhStats; stacks are chosen by it
    Aabb bounds{};                             // of the root; rays widen boxes by its size
};

/// The deepest tree that is traced: a thread's stack has so many entries.
inline constexpr std::uint32_t device_cwbvh_max_depth = 128;

/// How threads come by their rays.
enum class CwbvhKernel : std::uint32_t {
    cwbvh = 0,  // one thread a ray
    persistent_cwbvh =
        1  // as many threads as fit; a warp takes new rays when few of its own are left
};

/// Bytes of scratch that a launch of this kernel needs: 0 or 256. Throws InputError for a number
/// that is no kernel.
[[nodiscard]] std::size_t device_cwbvh_scratch_bytes(CwbvhKernel kernel);

/// Finds what trace() and trace_any() of the Bvh find, bit for bit. rays [count] -> hits [count],
/// or occluded [count]: 1 or 0. All are device memory; rays and hits are aligned to 16 bytes.
/// Invalid rays miss and are not counted.
///
/// Asynchronous: the call puts launches on `stream` and returns. It allocates nothing and waits for
/// nothing. `scratch` is device memory of device_cwbvh_scratch_bytes or more, aligned to 256 bytes.
/// It is in use until the stream is past the call. Throws InputError: 2^31 rays or more, a tree
/// deeper than device_cwbvh_max_depth, scratch that is too small, memory that is not aligned.
/// Throws BackendUnavailable, DeviceError.
void trace_on_device(const DeviceCwbvhTree& tree, const Ray* rays, std::uint32_t count,
                     TreeHit* hits, CwbvhKernel kernel, std::span<std::byte> scratch,
                     Stream stream);
void trace_any_on_device(const DeviceCwbvhTree& tree, const Ray* rays, std::uint32_t count,
                         std::uint8_t* occluded, CwbvhKernel kernel, std::span<std::byte> scratch,
                         Stream stream);

/// The same, but waits for the end. Returns the milliseconds of the kernel as the device saw them
/// (CUDA events). For measurements.
[[nodiscard]] double time_trace_on_device(const DeviceCwbvhTree& tree, const Ray* rays,
                                          std::uint32_t count, TreeHit* hits, CwbvhKernel kernel,
                                          std::span<std::byte> scratch, Stream stream);
[[nodiscard]] double time_trace_any_on_device(const DeviceCwbvhTree& tree, const Ray* rays,
                                              std::uint32_t count, std::uint8_t* occluded,
                                              CwbvhKernel kernel, std::span<std::byte> scratch,
                                              Stream stream);

/// A copy of a tree in device memory. The convenient way to a DeviceCwbvhTree.
class DeviceCwbvh {
public:
    DeviceCwbvh() = default;
    /// Waits for the copy. Throws BackendUnavailable, DeviceError.
    explicit DeviceCwbvh(const Cwbvh& tree, Stream stream = nullptr);

    /// Valid as long as this object.
    [[nodiscard]] DeviceCwbvhTree tree() const;
    [[nodiscard]] std::size_t bytes() const { return memory_.bytes(); }

private:
    DeviceBuffer<std::byte> memory_;  // nodes, then triangles
    DeviceCwbvhTree tree_;
};

}  // namespace raydix
