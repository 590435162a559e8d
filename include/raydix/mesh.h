// Triangle meshes and point clouds as the builders take them.
#pragma once

#include <raydix/types.h>

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace raydix {

/// An indexed triangle mesh that owns its arrays. Vertices without triangles are a point cloud.
template <class Scalar>
struct BasicMesh {
    std::string name;
    std::vector<BasicVec3<Scalar>> vertices;
    std::vector<Triangle> triangles;

    [[nodiscard]] bool is_point_cloud() const { return triangles.empty() && !vertices.empty(); }
};
using Mesh = BasicMesh<float>;
using MeshD = BasicMesh<double>;

/// A mesh that owns no arrays: [vertices], [triangles]. The caller keeps them alive during the call
/// that takes the view; Scene::share says when longer.
template <class Scalar>
struct BasicMeshView {
    std::span<const BasicVec3<Scalar>> vertices;
    std::span<const Triangle> triangles;

    BasicMeshView() = default;
    BasicMeshView(std::span<const BasicVec3<Scalar>> v, std::span<const Triangle> t)
        : vertices(v), triangles(t) {}
    BasicMeshView(const BasicMesh<Scalar>& mesh)
        : vertices(mesh.vertices), triangles(mesh.triangles) {}  // NOLINT: meant to be implicit
};
using MeshView = BasicMeshView<float>;
using MeshViewD = BasicMeshView<double>;

/// What `inspect` counts. "Out of range" are coordinates beyond 1e12 and boxes with a diagonal in
/// (0, 1e-12). Builders leave out what is out of range or not finite (docs/contract.md 1).
template <class Scalar>
struct BasicMeshInfo {
    std::uint64_t vertices = 0;
    std::uint64_t triangles = 0;
    std::uint64_t points = 0;    // vertices, if there are no triangles
    BasicAabb<Scalar> bounds{};  // of all finite, in-range vertices; lo > hi if there are none
    std::uint64_t non_finite_vertices = 0;    // NaN or Inf in a coordinate
    std::uint64_t out_of_range_vertices = 0;  // finite, but |coordinate| > 1e12
    std::uint64_t unreferenced_vertices = 0;  // in no triangle (0 for point clouds)
    std::uint64_t zero_area_triangles = 0;    // the exact cross product is 0 (repeated indices
                                              // included); in double, of those in range
    std::uint64_t repeated_index_triangles = 0;
    std::uint64_t left_out_triangles =
        0;                    // a vertex is non-finite or out of range, or the box is too small
    std::uint64_t bytes = 0;  // of the two arrays
};
using MeshInfo = BasicMeshInfo<float>;
using MeshInfoD = BasicMeshInfo<double>;

/// Counts the elements that a user should know about. Throws InputError if an index is past the
/// vertices.
[[nodiscard]] MeshInfo inspect(const MeshView& mesh);
[[nodiscard]] MeshInfoD inspect(const MeshViewD& mesh);

}  // namespace raydix
