// right = cross(target - position, up), screen up = cross(right, forward), rows from the top
// (contract.md 5).
#include "rays/camera_frame.h"

#include <raydix/error.h>

#include <numbers>

namespace raydix {
namespace {

/// Smallest sine between the view and `up` that still says which way is up.
constexpr double min_sine_to_up = 1e-6;

template <class AnyCamera>
[[noreturn]] void fail(const AnyCamera& camera, const std::string& reason) {
    throw InputError("camera '" + camera.name + "': " + reason);
}

template <class AnyCamera>
CameraFrame frame_of(const AnyCamera& camera, std::uint32_t width, std::uint32_t height) {
    const Double3 position(camera.position), target(camera.target), up(camera.up);
    if (width < 1 || height < 1 || width > max_screen_side || height > max_screen_side)
        fail(camera, "a screen of " + std::to_string(width) + " x " + std::to_string(height) +
                         " pixels; each side must be 1.." + std::to_string(max_screen_side));
    if (!is_finite(position)) fail(camera, "position is not finite");
    if (!is_finite(target)) fail(camera, "target is not finite");
    if (!is_finite(up)) fail(camera, "up is not finite");
    if (!(camera.vfov > 0 && camera.vfov < 180))
        fail(camera, "vfov is " + std::to_string(camera.vfov) + "; it must lie between 0 and 180");

    const Double3 view = target - position;
    if (length(view) == 0.0) fail(camera, "position equals target");
    if (length(up) == 0.0) fail(camera, "up is zero");
    const Double3 forward = normalized(view);
    const Double3 right = cross(forward, normalized(up));
    if (length(right) < min_sine_to_up) fail(camera, "up is parallel to the view");

    const double half_height = std::tan(camera.vfov * (std::numbers::pi / 360.0));
    const double half_width = half_height * width / height;
    const Double3 unit_right = normalized(right);
    return {position,
            forward,
            unit_right * half_width,
            cross(unit_right, forward) * half_height,
            static_cast<double>(width),
            static_cast<double>(height)};
}

}  // namespace

CameraFrame make_camera_frame(const Camera& camera, std::uint32_t width, std::uint32_t height) {
    return frame_of(camera, width, height);
}

CameraFrame make_camera_frame(const CameraD& camera, std::uint32_t width, std::uint32_t height) {
    return frame_of(camera, width, height);
}

Double3 direction_through(const CameraFrame& frame, double x, double y) {
    const double across = 2.0 * x / frame.width - 1.0;
    const double above = 1.0 - 2.0 * y / frame.height;
    return normalized(frame.forward + frame.right * across + frame.up * above);
}

Ray ray_through(const CameraFrame& frame, double x, double y) {
    return {frame.position.rounded(), 0.0f, direction_through(frame, x, y).rounded(), infinity};
}

}  // namespace raydix
