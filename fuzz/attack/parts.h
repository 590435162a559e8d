// What references by single triangles share: which triangles count, and trees of one each.
#pragma once

#include <raydix/double.h>

#include <cstdint>
#include <vector>

#include "attack/exact.h"
#include "attack/meshes.h"

namespace raydix::attack {

/// Triangles that builders keep (contract of the input range), ascending.
std::vector<std::uint32_t> valid_triangles(const Mesh& mesh);
std::vector<std::uint32_t> valid_triangles(const MeshD& mesh);

template <class AnyMesh>
Corners corners_of(const AnyMesh& mesh, std::uint32_t triangle) {
    Corners made;
    for (std::size_t k = 0; k < 3; ++k) {
        const auto& p = mesh.vertices[mesh.triangles[triangle][k]];
        made[k] = {p.x, p.y, p.z};
    }
    return made;
}

/// Trees of one triangle each: calls fn(tree, triangle) for all valid ones.
template <class AnyMesh, class Fn>
void for_each_alone(const AnyMesh& mesh, const Fn& fn) {
    for (const std::uint32_t triangle : valid_triangles(mesh))
        fn(build_bvh(only(mesh, {triangle}), {.threads = 1}), triangle);
}

/// The longest edge over the least height; 1 for triangles without area.
long double stretch_of(const Corners& triangle);
/// The distance of a point from a triangle, in extended precision.
long double distance_to(const Corners& triangle, Vec3d point);

}  // namespace raydix::attack
