#include "device_scene.h"

#include <raydix/error.h>

#include <chrono>

namespace raydix::cli {
namespace {

using Clock = std::chrono::steady_clock;

double ms_since(Clock::time_point start) {
    return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

}  // namespace

DeviceInput::DeviceInput(const Mesh& mesh) {
    static_cast<void>(device_name());  // before anything large: says what is missing
    if (mesh.vertices.size() >= std::size_t{1} << 31 || mesh.triangles.size() >= std::size_t{1}
                                                                                     << 31)
        throw InputError("a device takes fewer than 2147483648 vertices and triangles");
    vertices_.upload(mesh.vertices);
    triangles_.upload(mesh.triangles);
    mesh_ = {vertices_.data(), static_cast<std::uint32_t>(vertices_.size()), triangles_.data(),
             static_cast<std::uint32_t>(triangles_.size())};
}

PrimitiveKind DeviceInput::kind() const {
    return mesh_.triangle_count == 0 ? PrimitiveKind::points : PrimitiveKind::triangles;
}

std::uint32_t DeviceInput::count() const {
    return mesh_.triangle_count == 0 ? mesh_.vertex_count : mesh_.triangle_count;
}

DeviceKdTree build_on_device(const DeviceInput& input, const KdTreeOptions& options, BuildMs* ms) {
    const Clock::time_point start = Clock::now();
    DeviceKdTree tree(input.kind(), input.count(), options);
    BuildMs times = tree.build_timed(input.mesh());
    times.total = ms_since(start);
    if (ms != nullptr) *ms = times;
    return tree;
}

DeviceOctree build_on_device(const DeviceInput& input, const OctreeOptions& options, BuildMs* ms) {
    const Clock::time_point start = Clock::now();
    DeviceOctree tree(input.kind(), input.count(), options);
    BuildMs times = tree.build_timed(input.mesh());
    if (const std::uint32_t nodes = tree.node_count(); nodes > tree.node_capacity()) {
        tree = DeviceOctree();
        tree = DeviceOctree(input.kind(), input.count(), options, nodes);
        times = tree.build_timed(input.mesh());
    }
    times.total = ms_since(start);
    if (ms != nullptr) *ms = times;
    return tree;
}

BuildMs DeviceScene::build_fresh() {
    tree_.reset();
    const Clock::time_point start = Clock::now();
    tree_ = std::make_unique<DeviceBvh>(input_.kind(), input_.count(), options_);
    BuildMs ms = tree_->build_timed(input_.mesh());
    ms.total = ms_since(start);
    return ms;
}

BuildMs DeviceScene::build_again() { return tree_->build_timed(input_.mesh()); }

DeviceScene::Built DeviceScene::build() {
    const BuildMs ms = build_fresh();
    return {download(), ms};
}

}  // namespace raydix::cli
