// One frame per point, turned by the pixel's angle; then every ray is a sum of three axes.
#include "rays/hemisphere_rays.h"

#include <vector>

#include "base/check.h"
#include "base/double3.h"
#include "base/math.h"
#include "exec/parallel.h"
#include "rays/sampling.h"

namespace raydix {
namespace {

struct TangentFrame {
    Vec3 across, along, normal;
};

/// Two axes at right angles to the normal, turned about it by `angle`.
TangentFrame turned_frame(Vec3 unit_normal, double angle) {
    const Double3 normal(unit_normal);
    const double ax = std::abs(normal.x), ay = std::abs(normal.y), az = std::abs(normal.z);
    // The axis that the normal leans on least: the cross product with it is far from zero.
    const Double3 helper = ax <= ay && ax <= az ? Double3(1, 0, 0)
                           : ay <= az           ? Double3(0, 1, 0)
                                                : Double3(0, 0, 1);
    const Double3 a = normalized(cross(helper, normal)), b = cross(normal, a);
    const double c = std::cos(angle), s = std::sin(angle);
    return {(a * c + b * s).rounded(), (b * c - a * s).rounded(), unit_normal};
}

Vec3 turned(Vec3 d, const TangentFrame& frame) {
    return d.x * frame.across + d.y * frame.along + d.z * frame.normal;
}

}  // namespace

Double3 normal_of(Vec3 v0, Vec3 v1, Vec3 v2) {
    const Double3 corner(v0);
    return cross(Double3(v1) - corner, Double3(v2) - corner);
}

Double3 turned_against(Double3 normal, Double3 direction) {
    const Double3 against = direction * -1.0;
    if (!(length(normal) > 0.0)) return normalized(against);
    return normalized(dot(normal, against) < 0.0 ? normal * -1.0 : normal);
}

Vec3 normal_toward(Double3 normal, Vec3 direction) {
    return turned_against(normal, Double3(direction)).rounded();
}

Vec3 point_before(const Ray& ray, float t, double step_back) {
    const Double3 direction(ray.direction);
    return (Double3(ray.origin) + direction * (t - step_back / length(direction))).rounded();
}

Ray ray_above(const SurfacePoint& point, Vec3 direction) {
    return {point.origin, 0.0f, turned(direction, turned_frame(point.normal, 0.0)), infinity};
}

void make_hemisphere_rays(std::span<const SurfacePoint> points, const HemisphereOptions& options,
                          std::span<Ray> rays) {
    const std::size_t samples = options.samples;
    RAYDIX_CHECK(rays.size(), ==, points.size() * samples);
    const std::vector<Vec3> directions = halton_directions(1, options.samples * options.sequences);
    const auto emit = [&](std::size_t i) {
        const SurfacePoint& point = points[i];
        const float turn = unit_from(hash_of(options.seed, point.pixel));
        const TangentFrame frame = turned_frame(point.normal, 2.0 * std::numbers::pi * turn);
        for (std::size_t k = 0; k < samples; ++k) {
            const Vec3 direction = directions[point.sequence * samples + k];
            rays[i * samples + k] = {point.origin, 0.0f, turned(direction, frame), options.tmax};
        }
    };
    for_each_index(points.size(), emit, 256);
}

}  // namespace raydix
