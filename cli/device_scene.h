// A mesh in the memory of a GPU, and trees built from it there.
#pragma once

#include <raydix/device_trees.h>

#include <memory>

namespace raydix::cli {

/// The mesh alone.
class DeviceInput {
public:
    /// Copies the mesh to the device. Throws BackendUnavailable if there is none.
    explicit DeviceInput(const Mesh& mesh);
    [[nodiscard]] const DeviceMesh& mesh() const { return mesh_; }
    [[nodiscard]] PrimitiveKind kind() const;
    [[nodiscard]] std::uint32_t count() const;

private:
    DeviceBuffer<Vec3> vertices_;
    DeviceBuffer<Triangle> triangles_;
    DeviceMesh mesh_;
};

/// A tree in new device memory. `ms`, if asked for: stages as the device saw them; `total` is the
/// host's time with the allocation in it.
[[nodiscard]] DeviceKdTree build_on_device(const DeviceInput& input, const KdTreeOptions& options,
                                           BuildMs* ms);
/// Where the usual room for nodes is too small, built again in as much as it takes.
[[nodiscard]] DeviceOctree build_on_device(const DeviceInput& input, const OctreeOptions& options,
                                           BuildMs* ms);

class DeviceScene {
public:
    struct Built {
        Bvh bvh;
        BuildMs ms;
    };

    /// Throws as DeviceInput does.
    DeviceScene(const Mesh& mesh, const BuildOptions& options) : options_(options), input_(mesh) {}

    /// Into new device memory. `ms.total` has the allocation in it and is the host's time; the
    /// stages are the device's.
    [[nodiscard]] BuildMs build_fresh();
    /// Into the memory of the build before. All times are the device's.
    [[nodiscard]] BuildMs build_again();
    [[nodiscard]] Bvh download() const { return tree_->download(); }
    [[nodiscard]] Built build();
    /// Device memory of the tree and of its builder; the mesh's is apart.
    [[nodiscard]] std::size_t tree_bytes() const { return tree_->bytes(); }

private:
    BuildOptions options_;
    DeviceInput input_;
    std::unique_ptr<DeviceBvh> tree_;
};

}  // namespace raydix::cli
