// Scenes of meshes on an NVIDIA GPU (device_trace.h, device_cwbvh.h) and in the warp simulator
// (simulate.h), whose trees know neither geometries nor instances. A tree is made over all meshes
// as one. Its hits are named afterwards, on the host or on the device.
//
//   const MergedMeshes merged = merge_meshes(scene);
//   const DeviceCwbvh tree{Cwbvh(build_bvh(merged.mesh, build_options_for(Quality::balanced)))};
//   const DeviceMeshNames names(merged.names);
//   trace_on_device(tree.tree(), rays, n, found.data(), CwbvhKernel::cwbvh, {}, stream);
//   name_hits_on_device(names, found, hits, stream);
//
// These hits are those of trace(scene, rays), bit for bit. Those of the warp kernels are not: they
// have another triangle test (device_trace.h).
#pragma once

#include <raydix/device.h>
#include <raydix/mesh.h>
#include <raydix/scene.h>
#include <raydix/types.h>

#include <cstdint>
#include <span>
#include <vector>

namespace raydix {

/// Which meshes a merged one consists of, one behind the other.
struct MeshNames {
    std::vector<std::uint32_t> first;  // [meshes] the first triangle of each, ascending from 0
    std::vector<std::uint32_t> ids;    // [meshes] their geometry ids, ascending
};

struct MergedMeshes {
    Mesh mesh;
    MeshNames names;
};

/// Copies the meshes of the scene's last commit into one, by ascending id. Meshes without triangles
/// are left out, and so are those that rays of this mask do not see: on a device all rays have one
/// mask. Throws BackendUnavailable for a scene with an instance, a sphere, a capsule, a point or
/// user geometry, whatever its mask, and names the geometry. Throws InputError: a scene that was
/// never committed, 2^32 - 1 triangles or vertices or more.
[[nodiscard]] MergedMeshes merge_meshes(const Scene& scene, std::uint32_t mask = 0xFFFFFFFFu);

/// Turns hits of a tree over the merged mesh into hits of the scene. found [n] -> hits [n]. Misses
/// stay misses. `threads`: 0 to 1,024; 0: all the machine has. Throws InputError if the sizes
/// differ.
void name_hits(const MeshNames& names, std::span<const TreeHit> found, std::span<Hit> hits,
               int threads = 0);

/// A copy of the names in device memory.
class DeviceMeshNames {
public:
    DeviceMeshNames() = default;
    /// Waits for the copy. Throws BackendUnavailable, DeviceError.
    explicit DeviceMeshNames(const MeshNames& names, Stream stream = nullptr)
        : first_(std::span<const std::uint32_t>(names.first), stream),
          ids_(std::span<const std::uint32_t>(names.ids), stream) {}

    [[nodiscard]] const std::uint32_t* first() const { return first_.data(); }
    [[nodiscard]] const std::uint32_t* ids() const { return ids_.data(); }
    [[nodiscard]] std::uint32_t count() const { return static_cast<std::uint32_t>(ids_.size()); }

private:
    DeviceBuffer<std::uint32_t> first_, ids_;
};

/// As name_hits on the device. found [n] -> hits [n], both in device memory, aligned to 4 bytes.
/// They may not overlap. Asynchronous: the call puts a launch on `stream` and returns. It allocates
/// nothing and waits for nothing. `names` and `found` are in use until the stream is past it.
/// Throws InputError: sizes that differ, 2^31 hits or more. Throws BackendUnavailable, DeviceError.
void name_hits_on_device(const DeviceMeshNames& names, std::span<const TreeHit> found,
                         std::span<Hit> hits, Stream stream);

}  // namespace raydix
