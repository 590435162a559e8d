// Cameras: where pictures and primary rays start.
#pragma once

#include <raydix/types.h>

#include <filesystem>
#include <string>
#include <vector>

namespace raydix {

/// A pinhole camera. right = cross(target - position, up); `vfov` is the vertical angle in degrees.
struct Camera {
    std::string name;
    Vec3 position{0, 0, 1};
    Vec3 target{0, 0, 0};
    Vec3 up{0, 1, 0};
    float vfov = 45.0f;
};

/// What a cameras.json holds.
struct CameraSet {
    std::uint32_t width = 1024, height = 768;
    float ao_radius = 0.0f;  // 0: not given, use 5 % of the box diagonal
    std::vector<Camera> cameras;
};

/// Reads an object {width, height, ao_radius?, cameras: [...]} or a bare list of cameras.
/// Throws InputError that names the file, the camera and the field.
[[nodiscard]] CameraSet load_cameras(const std::filesystem::path& file);

/// One camera that sees all of `bounds`, for scenes that bring none.
[[nodiscard]] Camera fit_camera(const Aabb& bounds, float vfov = 45.0f);

}  // namespace raydix
