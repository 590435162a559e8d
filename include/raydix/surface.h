// What hits of a scene say about the surface there: points and normals in the world.
#pragma once

#include <raydix/scene.h>
#include <raydix/types.h>

#include <span>
#include <vector>

namespace raydix {

/// The point of each hit: (1-u-v)*v0 + u*v1 + v*v2 of its triangle, through the transforms of all
/// instances on its path, the innermost first. Computed in double, rounded once; of a SceneD every
/// sum and product is rounded to double. There the triangle, and each instance, adds an error of at
/// most 2^-50 of the magnitudes it sums up: those of the corners; those of a row's products and its
/// translation. A miss gives NaN. hits [n] -> points [n]. The vertices are those of the scene's
/// last commit; of shared meshes they are read from the caller's arrays. `threads`: 0 to 1,024; 0:
/// all the machine has. Throws InputError: sizes that differ, a scene that was never committed, a
/// hit whose path, geometry or triangle the last commit does not have; the message names the first
/// such hit.
void positions(const Scene& scene, std::span<const Hit> hits, std::span<Vec3> points,
               int threads = 0);
void positions(const SceneD& scene, std::span<const HitD> hits, std::span<Vec3d> points,
               int threads = 0);
[[nodiscard]] std::vector<Vec3> positions(const Scene& scene, std::span<const Hit> hits,
                                          int threads = 0);
[[nodiscard]] std::vector<Vec3d> positions(const SceneD& scene, std::span<const HitD> hits,
                                           int threads = 0);

/// The same for scenes that hold shapes, with the rays that hit: the point of a shape's hit is
/// origin + t * direction of its ray. rays [n], hits [n] -> points [n].
void positions(const Scene& scene, std::span<const Ray> rays, std::span<const Hit> hits,
               std::span<Vec3> points, int threads = 0);
void positions(const SceneD& scene, std::span<const RayD> rays, std::span<const HitD> hits,
               std::span<Vec3d> points, int threads = 0);

/// The geometric normal at each hit, of unit length. In the mesh's own space it is the direction of
/// (v1-v0) x (v2-v0): counter-clockwise corners face the viewer. Each instance moves it by the
/// inverse transpose of its transform, so that the outside of a mesh stays outside where an
/// instance mirrors it; there the corners in the world appear clockwise. Computed in double,
/// rounded once; of a SceneD every step is rounded to double, and errors grow where a triangle is
/// long and narrow and where a transform shears. NaN: a miss, or a triangle without area, which
/// rays never hit. hits [n] -> normals [n]. Vertices, `threads` and errors as for positions.
void normals(const Scene& scene, std::span<const Hit> hits, std::span<Vec3> normals,
             int threads = 0);
void normals(const SceneD& scene, std::span<const HitD> hits, std::span<Vec3d> normals,
             int threads = 0);
/// The same for scenes that hold shapes, with the rays that hit. The normal of a sphere points from
/// its center to the hit, that of a capsule from the nearest point of its axis; NaN for a radius
/// of 0. Throws InputError for user geometry too, whose normals its owner knows.
void normals(const Scene& scene, std::span<const Ray> rays, std::span<const Hit> hits,
             std::span<Vec3> normals, int threads = 0);
void normals(const SceneD& scene, std::span<const RayD> rays, std::span<const HitD> hits,
             std::span<Vec3d> normals, int threads = 0);
[[nodiscard]] std::vector<Vec3> normals(const Scene& scene, std::span<const Hit> hits,
                                        int threads = 0);
[[nodiscard]] std::vector<Vec3d> normals(const SceneD& scene, std::span<const HitD> hits,
                                         int threads = 0);

}  // namespace raydix
