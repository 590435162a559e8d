// Points on surfaces -> rays over the hemisphere above each: AO, diffuse, and the light of rendered
// pictures.
#pragma once

#include <raydix/types.h>

#include <cstdint>
#include <span>

#include "base/double3.h"

namespace raydix {

/// Where secondary rays start.
struct SurfacePoint {
    Vec3 origin;
    Vec3 normal;  // geometric, unit, toward the side that the point was seen from
    std::uint32_t pixel;
    std::uint32_t sequence =
        0;  // which run of Halton points: 0 .. HemisphereOptions::sequences - 1
};

/// Protocol: secondary origins move back along the primary ray by this part of the scene box's
/// diagonal.
inline constexpr double step_back_part = 3e-6;
/// Protocol: AO radius where none is given, as a part of the diagonal.
inline constexpr double ao_radius_part = 0.05;

/// Geometric, by the right-hand rule, of any length; 0 without area.
[[nodiscard]] Double3 normal_of(Vec3 v0, Vec3 v1, Vec3 v2);

/// A normal of any length, of unit length and turned against `direction`; -direction instead of 0.
[[nodiscard]] Vec3 normal_toward(Double3 normal, Vec3 direction);

/// The same before it is rounded.
[[nodiscard]] Double3 turned_against(Double3 normal, Double3 direction);

/// The point at `t` along the ray, moved back toward its origin by the distance `step_back`.
[[nodiscard]] Vec3 point_before(const Ray& ray, float t, double step_back);

struct HemisphereOptions {
    std::uint32_t samples = 32;  // rays per point
    std::uint32_t sequences =
        1;  // points that share a pixel can share one longer run of Halton points
    float tmax = infinity;
    std::uint64_t seed = 1;
};

/// A ray without an end in this direction about +z, turned to the normal.
[[nodiscard]] Ray ray_above(const SurfacePoint& point, Vec3 direction);

/// Rays [points * samples], those of a point in a row: the directions of Halton indices
/// [1 + sequence * samples, 1 + (sequence + 1) * samples), the same for every point, turned about
/// its normal by the angle 2 pi * unit_from(hash_of(seed, pixel)).
void make_hemisphere_rays(std::span<const SurfacePoint> points, const HemisphereOptions& options,
                          std::span<Ray> rays);

}  // namespace raydix
