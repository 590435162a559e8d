// What every view of a picture works with: what it is taken of, the camera, and one tile of the
// screen at a time.
#pragma once

#include <raydix/picture.h>

#include <cstdint>
#include <span>
#include <vector>

#include "image/render_tracers.h"
#include "image/surface_points.h"
#include "rays/camera_frame.h"

namespace raydix {

/// Sun and sky light open scenes; a lamp at the camera takes over where walls shut them out.
struct Lights {
    Vec3 up;         // the axis of the scene that the camera's `up` leans on most
    Vec3 sun;        // unit, toward the sun
    Vec3 lamp;       // position
    float enclosed;  // part of all directions from the camera that hit something
};

struct RenderScene {
    const Tracer& tracer;
    const RenderOptions& options;
    CameraFrame frame;
    Lights lights;
    double step_back;  // of secondary origins
    float ao_radius;
    std::uint32_t rays_per_pixel;   // primary ones: 1, or 4 where edges are smoothed
    std::uint32_t samples_per_ray;  // secondary rays from each primary hit
};

/// Primary rays and their closest hits, those of a pixel in a row: [pixels * rays_per_pixel].
struct PrimarySamples {
    std::vector<Ray> rays;
    std::vector<Hit> hits;
    std::vector<Double3> normals;              // of those that hit
    std::vector<std::uint32_t> hit_positions;  // of the samples that hit, ascending
    std::vector<SurfacePoint> points;          // [hit_positions]
};

[[nodiscard]] PrimarySamples trace_primary(const RenderScene& scene,
                                           std::span<const std::uint32_t> pixels);

/// Surface points of those `rays` that hit, in order; their pixel and sequence stay 0. [positions]
[[nodiscard]] std::vector<SurfacePoint> points_of_hits(const RenderScene& scene,
                                                       std::span<const Ray> rays,
                                                       std::span<const Hit> hits,
                                                       std::span<const Double3> normals,
                                                       std::span<const std::uint32_t> positions);

}  // namespace raydix
