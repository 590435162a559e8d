// A camera as three axes, and the rays through points of its screen.
#pragma once

#include <raydix/camera.h>
#include <raydix/types.h>

#include <cstdint>

#include "base/double3.h"

namespace raydix {

/// Longest side of a screen, in pixels: pixel ids then fit 32 bits with room to spare.
inline constexpr std::uint32_t max_screen_side = 16384;

struct CameraFrame {
    Double3 position;
    Double3 forward;    // unit
    Double3 right, up;  // from the middle of the screen at distance 1 to its right and upper edge
    double width, height;  // pixels
};

/// Throws InputError that names the camera: non-finite numbers, position equal to target, `up`
/// along the view, vfov outside (0, 180), a side of the screen outside 1..16384.
[[nodiscard]] CameraFrame make_camera_frame(const Camera& camera, std::uint32_t width,
                                            std::uint32_t height);
[[nodiscard]] CameraFrame make_camera_frame(const CameraD& camera, std::uint32_t width,
                                            std::uint32_t height);

/// From the camera to (x, y), in pixels from the upper left corner; pixel centres lie at .5. Unit.
[[nodiscard]] Double3 direction_through(const CameraFrame& frame, double x, double y);
/// The ray there, rounded.
[[nodiscard]] Ray ray_through(const CameraFrame& frame, double x, double y);

}  // namespace raydix
