// What hits of a scene say about the surface there: points and normals in the world.
#pragma once

#include <raydix/scene.h>
#include <raydix/types.h>

#include <span>
#include <vector>

namespace raydix {

/// Computes the point of each hit: (1-u-v)*v0 + u*v1 + v*v2 of its triangle, moved through the
/// transforms of all instances on its path, the innermost first. hits [n] -> points [n]. A miss
/// gives NaN.
///
/// The vertices are those of the scene's last commit; those of shared meshes are read from the
/// caller's arrays. Sums are in double. The point of a Scene is rounded to float once. In a SceneD
/// every step is rounded: the triangle and each instance add an error of at most 2^-50 of what they
/// sum up.
///
/// `threads`: 0 to 1,024; 0: all the machine has. Throws InputError: sizes that differ, a scene
/// that was never committed, a hit whose path, geometry or triangle the last commit does not have
/// (the first such hit is named).
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
[[nodiscard]] std::vector<Vec3> positions(const Scene& scene, std::span<const Ray> rays,
                                          std::span<const Hit> hits, int threads = 0);
[[nodiscard]] std::vector<Vec3d> positions(const SceneD& scene, std::span<const RayD> rays,
                                           std::span<const HitD> hits, int threads = 0);

/// Computes the geometric normal at each hit, of unit length. hits [n] -> normals [n]. In the
/// mesh's own space it is the direction of (v1-v0) x (v2-v0): it points to the side from which the
/// corners appear counter-clockwise. Each instance moves it by the inverse transpose of its
/// transform. So the outside of a mesh stays outside where an instance mirrors it; there the
/// corners appear clockwise. A miss, and a triangle without area, gives NaN. The normal of a Scene
/// is computed in double and rounded once. In a SceneD every step is rounded; errors grow where a
/// triangle is long and narrow and where a transform shears. Vertices, `threads` and errors as for
/// positions.
void normals(const Scene& scene, std::span<const Hit> hits, std::span<Vec3> normals,
             int threads = 0);
void normals(const SceneD& scene, std::span<const HitD> hits, std::span<Vec3d> normals,
             int threads = 0);
[[nodiscard]] std::vector<Vec3> normals(const Scene& scene, std::span<const Hit> hits,
                                        int threads = 0);
[[nodiscard]] std::vector<Vec3d> normals(const SceneD& scene, std::span<const HitD> hits,
                                         int threads = 0);

/// The same for scenes that hold shapes, with the rays that hit. The normal of a sphere points from
/// its center to the hit, that of a capsule from the nearest point of its axis; NaN for a radius
/// of 0. Throws InputError for user geometry too, whose normals its owner knows.
void normals(const Scene& scene, std::span<const Ray> rays, std::span<const Hit> hits,
             std::span<Vec3> normals, int threads = 0);
void normals(const SceneD& scene, std::span<const RayD> rays, std::span<const HitD> hits,
             std::span<Vec3d> normals, int threads = 0);
[[nodiscard]] std::vector<Vec3> normals(const Scene& scene, std::span<const Ray> rays,
                                        std::span<const Hit> hits, int threads = 0);
[[nodiscard]] std::vector<Vec3d> normals(const SceneD& scene, std::span<const RayD> rays,
                                         std::span<const HitD> hits, int threads = 0);

}  // namespace raydix
