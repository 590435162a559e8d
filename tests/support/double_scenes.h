// Scenes and rays in double.
#pragma once

#include <raydix/double.h>
#include <raydix/mesh.h>

#include <cstddef>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "base/math.h"

namespace raydix::test {

/// Where georeferenced meshes lie: metres east and north of a UTM zone's origin, and a height.
inline constexpr Vec3d utm_place{500'000.0, 4'500'000.0, 250.0};

/// scale * p + move of every corner, in double.
MeshD in_double(const Mesh& mesh, double scale = 1.0, Vec3d move = {0.0, 0.0, 0.0});
/// Rounded to float.
Mesh in_float(const MeshD& mesh);

class RandomD {
public:
    explicit RandomD(std::uint64_t seed) : engine_(seed) {}
    double unit() { return static_cast<double>(engine_() >> 11) * 0x1p-53; }
    double between(double lo, double hi) { return lo + (hi - lo) * unit(); }
    std::size_t below(std::size_t n) { return engine_() % n; }
    Vec3d in(const AabbD& box) {
        return {between(box.lo.x, box.hi.x), between(box.lo.y, box.hi.y),
                between(box.lo.z, box.hi.z)};
    }
    /// Neither short nor long, in any direction.
    Vec3d direction();

private:
    std::mt19937_64 engine_;
};

/// `count` small triangles, each within `size` of a place in the unit cube.
MeshD random_soup_d(std::size_t count, std::uint64_t seed, double size = 0.05);

/// Where builders cut: long thin triangles in all directions among small ones.
MeshD slivers_d(std::size_t count, std::uint64_t seed, Vec3d place = utm_place);
/// One more triangle. Far away it makes the scene so large that builders find little to cut.
MeshD with_stray(MeshD mesh, Vec3d at);

/// Rays in the planes of triangles, up to rounding: what they hit, and where, is nearly chance.
std::vector<RayD> rays_in_planes(const MeshD& mesh, std::size_t count, std::uint64_t seed);

/// Around the corners that are finite and within 1e12.
AabbD box_of_mesh(const MeshD& mesh);

/// Rays of ten kinds in turn: anywhere, at corners and middles of edges, along axes through
/// corners, with a component of 0 or -0, with limits, from surfaces, of any length, along edges.
std::vector<RayD> mixed_rays(const MeshD& mesh, std::size_t count, std::uint64_t seed);

}  // namespace raydix::test
