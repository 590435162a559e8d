// A mesh in the memory of a GPU, and trees built from it there.
#pragma once

#include <raydix/device.h>

#include <memory>

namespace raydix::cli {

class DeviceScene {
public:
    struct Built {
        Bvh bvh;
        BuildMs ms;
    };

    /// Copies the mesh to the device. Throws BackendUnavailable if there is none.
    DeviceScene(const Mesh& mesh, const BuildOptions& options);

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
    DeviceBuffer<Vec3> vertices_;
    DeviceBuffer<Triangle> triangles_;
    DeviceMesh mesh_;
    std::unique_ptr<DeviceBvh> tree_;
};

}  // namespace raydix::cli
