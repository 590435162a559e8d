#include "device_scene.h"

#include <raydix/error.h>

#include <chrono>

namespace raydix::cli {

DeviceScene::DeviceScene(const Mesh& mesh, const BuildOptions& options) : options_(options) {
    static_cast<void>(device_name());  // before anything large: says what is missing
    if (mesh.vertices.size() >= std::size_t{1} << 31 || mesh.triangles.size() >= std::size_t{1}
                                                                                     << 31)
        throw InputError("a device takes fewer than 2147483648 vertices and triangles");
    vertices_.upload(mesh.vertices);
    triangles_.upload(mesh.triangles);
    mesh_ = {vertices_.data(), static_cast<std::uint32_t>(vertices_.size()), triangles_.data(),
             static_cast<std::uint32_t>(triangles_.size())};
}

BuildMs DeviceScene::build_fresh() {
    tree_.reset();
    const auto start = std::chrono::steady_clock::now();
    const bool points = mesh_.triangle_count == 0;
    tree_ =
        std::make_unique<DeviceBvh>(points ? PrimitiveKind::points : PrimitiveKind::triangles,
                                    points ? mesh_.vertex_count : mesh_.triangle_count, options_);
    BuildMs ms = tree_->build_timed(mesh_);
    const std::chrono::duration<double, std::milli> all = std::chrono::steady_clock::now() - start;
    ms.total = all.count();
    return ms;
}

BuildMs DeviceScene::build_again() { return tree_->build_timed(mesh_); }

DeviceScene::Built DeviceScene::build() {
    const BuildMs ms = build_fresh();
    return {download(), ms};
}

}  // namespace raydix::cli
