// Families of small meshes that have broken ray tracers and searches: a seed -> a mesh.
#pragma once

#include <raydix/double.h>
#include <raydix/mesh.h>

#include <cstdint>

#include "attack/random.h"

namespace raydix::attack {

enum class Family : std::uint32_t {
    soup,              // triangles of any size anywhere
    needles,           // one edge up to 10^7 times as long as the others
    integer_coplanar,  // small whole numbers, many triangles in one plane
    grid,              // a flat square of equal triangles
    sphere,            // closed
    voxels,            // closed boxes that share faces, edges and corners
    tiny_and_huge,     // sizes from 1e-6 to 1e11 in one mesh
    subnormal,         // coordinates down to the least float
    far_away,          // near 1e11
    duplicates,        // triangles that are there several times
    non_finite,        // NaN, infinities and numbers out of range
    zero_area,         // segments and points
    fan,               // many triangles around one corner
    stretched_sphere,  // closed, one axis up to 10^7 times as long
    tetrahedra,        // closed, small whole numbers
    far_small,         // triangles of size 1 near 1e6
    strays,            // a small thing, and a few corners far from it
    count
};
const char* family_name(Family family);

struct TestMesh {
    Family family = Family::soup;
    Mesh mesh;
};

/// A mesh of about `triangles` triangles.
TestMesh make_mesh(Random& random, Family family, std::uint32_t triangles);
/// Of any family, of 1 to `most` triangles, now and then scaled, turned or stretched as a whole.
TestMesh any_mesh(Random& random, std::uint32_t most);
/// A closed mesh of finite coordinates; whole numbers up to 64 if `whole`.
TestMesh closed_mesh(Random& random, std::uint32_t most, bool whole);

/// Closed, with poles on z. Consistently oriented, normals outward.
Mesh make_sphere(std::uint32_t around, std::uint32_t rings, Vec3 center, Vec3 radii);
void add_triangle(Mesh& mesh, Vec3 a, Vec3 b, Vec3 c);

/// Around the vertices in range; the unit cube if there are none.
Aabb finite_bounds(const Mesh& mesh);
/// The same mesh in double, moved and with digits that a float cannot hold.
MeshD to_double(Random& random, const Mesh& mesh);
/// The triangles that `keep` names, in order, with corners of their own.
Mesh only(const Mesh& mesh, const std::vector<std::uint32_t>& keep);
MeshD only(const MeshD& mesh, const std::vector<std::uint32_t>& keep);

}  // namespace raydix::attack
