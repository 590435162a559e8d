// Scene box -> a camera that sees all of it: from the front, a little to the right and above, y up.
#include <raydix/camera.h>
#include <raydix/error.h>

#include <algorithm>
#include <numbers>

#include "base/double3.h"
#include "base/float_env.h"

namespace raydix {
namespace {

constexpr double margin = 1.05;  // of the distance at which a corner touches the edge of the screen

/// Least distance from the box's centre at which all corners lie within `tangent` of the view axis,
/// up and across.
double fitting_distance(Double3 half, Double3 forward, double tangent) {
    const Double3 right = normalized(cross(forward, Double3(0, 1, 0)));
    const Double3 up = cross(right, forward);
    double distance = 0.0;
    for (int corner = 0; corner < 8; ++corner) {
        const Double3 p((corner & 1) ? half.x : -half.x, (corner & 2) ? half.y : -half.y,
                        (corner & 4) ? half.z : -half.z);
        const double off_axis = std::max(std::abs(dot(p, right)), std::abs(dot(p, up)));
        distance = std::max(distance, off_axis / tangent - dot(p, forward));
    }
    return distance;
}

/// `step`: numbers of the camera's type are this part of themselves apart, at most.
template <class AnyCamera, class Box>
AnyCamera fitted(const Box& bounds, decltype(AnyCamera::vfov) vfov, double step) {
    const FloatEnvironment plain;
    if (!(vfov > 0 && vfov < 180))
        throw InputError("vfov is " + std::to_string(vfov) + "; it must lie between 0 and 180");
    AnyCamera camera;
    camera.name = "fitted";
    camera.vfov = vfov;
    const Double3 lo(bounds.lo), hi(bounds.hi);
    const bool holds_something = lo.x <= hi.x && lo.y <= hi.y && lo.z <= hi.z;
    if (!holds_something || !is_finite(lo) || !is_finite(hi)) return camera;

    const Double3 center = (lo + hi) * 0.5, half = (hi - lo) * 0.5;
    const Double3 backward = normalized(Double3(0.45, 0.35, 1.0));
    const double tangent = std::tan(vfov * (std::numbers::pi / 360.0));
    double distance = margin * fitting_distance(half, backward * -1.0, tangent);
    if (distance == 0.0) distance = 1.0;  // a single point
    // Far from the origin position and target must not round to the same point.
    const double largest = std::max({std::abs(center.x), std::abs(center.y), std::abs(center.z)});
    distance = std::max(distance, largest * (0x1p7 * step));

    center.round_to(camera.target);
    (center + backward * distance).round_to(camera.position);
    return camera;
}

}  // namespace

Camera fit_camera(const Aabb& bounds, float vfov) { return fitted<Camera>(bounds, vfov, 0x1p-23); }

CameraD fit_camera(const AabbD& bounds, double vfov) {
    return fitted<CameraD>(bounds, vfov, 0x1p-52);
}

}  // namespace raydix
