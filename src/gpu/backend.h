// What a kind of device does for the public calls of raydix/device*.h. A backend overrides what it
// has; the rest says what is missing. backend.cpp holds the table of them.
#pragma once

#include <raydix/device_cwbvh.h>
#include <raydix/device_queries.h>
#include <raydix/device_scene.h>
#include <raydix/device_trace.h>
#include <raydix/device_trees.h>
#include <raydix/error.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

namespace raydix {

class DeviceBackend {
public:
    using Scratch = std::span<std::byte>;

    explicit DeviceBackend(std::string selector) : selector_(std::move(selector)) {}
    DeviceBackend(const DeviceBackend&) = delete;
    DeviceBackend& operator=(const DeviceBackend&) = delete;
    virtual ~DeviceBackend() = default;

    /// As select_device takes it.
    [[nodiscard]] const std::string& selector() const { return selector_; }

    /// Throws BackendUnavailable, which says why there is no device.
    [[nodiscard]] virtual std::string name() = 0;
    // CUDA's backend is all of its GPUs. enter() makes the one of `memory` current for this thread
    // and returns what leave() takes back. Other backends have one device each.
    [[nodiscard]] virtual int enter(const void*) { return -1; }
    virtual void leave(int) noexcept {}
    [[nodiscard]] virtual int current() { return -1; }
    virtual void synchronize(Stream stream) = 0;
    [[nodiscard]] virtual void* allocate(std::size_t bytes) = 0;  // bytes > 0; aligned to 256
    virtual void free(void* memory) noexcept = 0;
    virtual void copy_to_device(void* device, const void* host, std::size_t bytes,
                                Stream stream) = 0;
    virtual void copy_to_host(void* host, const void* device, std::size_t bytes, Stream stream) = 0;
    [[nodiscard]] virtual double measure_copy(std::size_t bytes, int repeat) = 0;

    [[nodiscard]] virtual std::size_t scratch_bytes(std::uint32_t, const BuildOptions&) {
        missing("builds");
    }
    virtual void build(const DeviceMesh&, const BuildOptions&, const DeviceTree&, Scratch, Stream) {
        missing("builds");
    }
    virtual void build(const DeviceBoxList&, const BuildOptions&, const DeviceTree&, Scratch,
                       Stream) {
        missing("builds");
    }
    virtual BuildMs time(const DeviceMesh&, const BuildOptions&, const DeviceTree&, Scratch,
                         Stream) {
        missing("builds");
    }
    virtual BuildMs time(const DeviceBoxList&, const BuildOptions&, const DeviceTree&, Scratch,
                         Stream) {
        missing("builds");
    }

    [[nodiscard]] virtual std::size_t scratch_bytes(std::uint32_t, PrimitiveKind,
                                                    const KdTreeOptions&) {
        missing("k-d trees");
    }
    virtual void build(const DeviceMesh&, const KdTreeOptions&, const DeviceKdArrays&, Scratch,
                       Stream) {
        missing("k-d trees");
    }
    virtual BuildMs time(const DeviceMesh&, const KdTreeOptions&, const DeviceKdArrays&, Scratch,
                         Stream) {
        missing("k-d trees");
    }
    [[nodiscard]] virtual std::size_t scratch_bytes(std::uint32_t, std::uint32_t,
                                                    const OctreeOptions&) {
        missing("octrees");
    }
    virtual void build(const DeviceMesh&, const OctreeOptions&, const DeviceOctreeArrays&, Scratch,
                       Stream) {
        missing("octrees");
    }
    virtual BuildMs time(const DeviceMesh&, const OctreeOptions&, const DeviceOctreeArrays&,
                         Scratch, Stream) {
        missing("octrees");
    }

    [[nodiscard]] virtual std::unique_ptr<DeviceWarpTree::Arrays> warp_tree(const WarpTree& tree,
                                                                            Stream stream);
    [[nodiscard]] virtual std::unique_ptr<DeviceWarpTree::Arrays> warp_tree(const DeviceTree& tree,
                                                                            Stream stream);
    virtual void trace_warps(const DeviceWarpTree&, std::span<const Ray>, std::span<TreeHit>,
                             const DeviceTraceOptions&, Scratch, Stream) {
        missing("the kernels of Aila and Laine");
    }
    virtual DeviceTraceMs time_warps(const DeviceWarpTree&, std::span<const Ray>,
                                     std::span<TreeHit>, const DeviceTraceOptions&, Scratch,
                                     Stream) {
        missing("the kernels of Aila and Laine");
    }

    /// Rays through a compressed wide tree: hits or, if `occluded` is not null, any hit.
    struct CwbvhCall {
        const DeviceCwbvhTree& tree;
        const Ray* rays;
        std::uint32_t count;
        TreeHit* hits;
        std::uint8_t* occluded;
        CwbvhKernel kernel;
        Scratch scratch;
        Stream stream;
    };
    virtual void trace_cwbvh(const CwbvhCall&) { missing("compressed wide trees"); }
    virtual double time_cwbvh(const CwbvhCall&) { missing("compressed wide trees"); }

    [[nodiscard]] virtual std::size_t offsets_scratch_bytes(std::uint32_t) { missing("queries"); }
    virtual void knn(const DevicePoints&, std::span<const Vec3>, std::uint32_t,
                     std::span<std::uint32_t>, std::span<float>, std::uint32_t*, Stream) {
        missing("queries");
    }
    virtual void radius_count(const DevicePoints&, std::span<const Vec3>, float,
                              std::span<std::uint64_t>, std::uint32_t*, Scratch, Stream) {
        missing("queries");
    }
    virtual void radius_fill(const DevicePoints&, std::span<const Vec3>, float,
                             std::span<const std::uint64_t>, bool, std::span<std::uint32_t>,
                             std::span<float>, Stream) {
        missing("queries");
    }
    virtual void closest_points(const DevicePrimitives&, std::span<const Vec3>, float,
                                std::span<ClosestPoint>, std::uint32_t*, Stream) {
        missing("queries");
    }
    virtual void pairs_count(const DevicePairQuery&, std::span<std::uint64_t>, Scratch, Stream) {
        missing("queries");
    }
    virtual void pairs_fill(const DevicePairQuery&, std::span<const std::uint64_t>,
                            std::span<PrimitivePair>, Stream) {
        missing("queries");
    }

    virtual void name_hits(const DeviceMeshNames&, std::span<const TreeHit>, std::span<Hit>,
                           Stream) {
        missing("naming of hits");
    }

protected:
    /// Says first if there is no device at all.
    [[noreturn]] void missing(const char* what) {
        static_cast<void>(name());
        throw BackendUnavailable("device " + selector_ + " has no " + what);
    }

private:
    std::string selector_;
};

/// The one that this thread's calls go to.
[[nodiscard]] DeviceBackend& device_backend();

// The rows of the table: each in files of its own, or a BackendUnavailable of this build.
[[nodiscard]] DeviceBackend& cuda_backend();
[[nodiscard]] DeviceBackend& opencl_backend(std::uint32_t index);
[[nodiscard]] DeviceBackend& hip_backend(std::uint32_t index);
void list_cuda_devices(std::vector<DeviceDescription>& out);
void list_opencl_devices(std::vector<DeviceDescription>& out);
void list_hip_devices(std::vector<DeviceDescription>& out);

}  // namespace raydix
