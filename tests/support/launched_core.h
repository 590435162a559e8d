// The k-d tree and the octree of a GPU (gpu/device_trees.h) on the host, by any launcher, as trees
// that can be compared.
#pragma once

#include <raydix/kdtree.h>
#include <raydix/octree.h>

#include <cstring>
#include <vector>

#include "gpu/device_assemble.h"
#include "gpu/device_trees.h"
#include "support/launched_build.h"

namespace raydix::test {

/// An array that begins as garbage.
template <class T>
std::vector<T> garbage_array(std::size_t size, unsigned char garbage) {
    std::vector<T> values(size);
    if (size != 0) std::memset(static_cast<void*>(values.data()), garbage, size * sizeof(T));
    return values;
}

inline const auto fetch_on_host = [](auto& out, const auto* from, std::size_t size) {
    out.reset(size);
    std::copy_n(from, size, out.data());
};

inline DeviceMesh device_mesh(const MeshView& mesh) {
    return {mesh.vertices.data(), static_cast<std::uint32_t>(mesh.vertices.size()),
            mesh.triangles.data(), static_cast<std::uint32_t>(mesh.triangles.size())};
}
inline PrimitiveKind kind_of(const MeshView& mesh) {
    return mesh.triangles.empty() ? PrimitiveKind::points : PrimitiveKind::triangles;
}
inline std::uint32_t count_of(const MeshView& mesh) {
    return static_cast<std::uint32_t>(mesh.triangles.empty() ? mesh.vertices.size()
                                                             : mesh.triangles.size());
}

/// Scratch of exactly the size that the query gives, then the launches.
template <class Build, class Launcher>
void run_with_exact_scratch(const Build& build, Launcher& launcher, unsigned char garbage) {
    Arena sizing = sizing_arena();
    IdleLauncher idle;
    build.run(idle, sizing);
    LentMemory memory(sizing.bytes(), garbage);
    build.run(launcher, memory.arena);
    memory.expect_exact_use();
}

template <class Launcher>
KdTree launched_kdtree(Launcher& launcher, const MeshView& mesh, const KdTreeOptions& options,
                       unsigned char garbage = 0xA5) {
    const std::uint32_t n = count_of(mesh);
    auto nodes = garbage_array<KdNode>(device_node_capacity(n, kind_of(mesh), options), garbage);
    auto order = garbage_array<std::uint32_t>(n, garbage);
    auto triangles = garbage_array<LeafTriangle>(n, garbage);
    auto points = garbage_array<Vec3>(n, garbage);
    DeviceCounts counts;
    const DeviceKdArrays tree{nodes.data(), order.data(), triangles.data(), points.data(), &counts};
    with_device_kdtree(device_mesh(mesh), options, tree, [&](const auto& build) {
        run_with_exact_scratch(build, launcher, garbage);
    });
    return assemble_kdtree(tree, counts, kind_of(mesh), options, fetch_on_host);
}

/// An octree's arrays with room for `node_capacity` nodes.
struct LaunchedOctree {
    std::vector<OctreeNode> nodes;
    std::vector<std::uint32_t> order;
    std::vector<Vec3> points;
    DeviceOctreeCounts counts{};
    DeviceOctreeArrays tree;

    template <class Launcher>
    LaunchedOctree(Launcher& launcher, const MeshView& mesh, const OctreeOptions& options,
                   std::uint32_t node_capacity, unsigned char garbage = 0xA5)
        : nodes(garbage_array<OctreeNode>(node_capacity, garbage)),
          order(garbage_array<std::uint32_t>(count_of(mesh), garbage)),
          points(garbage_array<Vec3>(count_of(mesh), garbage)),
          tree{nodes.data(), node_capacity, order.data(), points.data(), &counts} {
        with_device_octree(device_mesh(mesh), options, tree, [&](const auto& build) {
            run_with_exact_scratch(build, launcher, garbage);
        });
    }
    LaunchedOctree(const LaunchedOctree&) = delete;
    LaunchedOctree& operator=(const LaunchedOctree&) = delete;

    [[nodiscard]] Octree assemble(const MeshView& mesh, const OctreeOptions& options) const {
        return assemble_octree(tree, counts, kind_of(mesh), options, fetch_on_host);
    }
};

template <class Launcher>
Octree launched_octree(Launcher& launcher, const MeshView& mesh, const OctreeOptions& options) {
    const auto bound = static_cast<std::uint32_t>(device_node_bound(count_of(mesh), options));
    return LaunchedOctree(launcher, mesh, options, bound).assemble(mesh, options);
}

}  // namespace raydix::test
