// Cameras: where pictures and primary rays start.
#pragma once

#include <raydix/types.h>

#include <filesystem>
#include <string>
#include <vector>

namespace raydix {

/// A pinhole camera. Right is cross(target - position, up). `vfov` is the vertical angle in
/// degrees, between 0 and 180.
template <class Scalar>
struct BasicCamera {
    std::string name;
    BasicVec3<Scalar> position{0, 0, 1};
    BasicVec3<Scalar> target{0, 0, 0};
    BasicVec3<Scalar> up{0, 1, 0};
    Scalar vfov = 45;
};
using Camera = BasicCamera<float>;
using CameraD = BasicCamera<double>;

/// What a cameras.json file holds (docs/scenes.md).
template <class Scalar>
struct BasicCameraSet {
    std::uint32_t width = 1024, height = 768;  // pixels
    float ao_radius = 0.0f;  // 0: not given, which means 5 % of the diagonal of the scene's box
    std::vector<BasicCamera<Scalar>> cameras;
};
using CameraSet = BasicCameraSet<float>;
using CameraSetD = BasicCameraSet<double>;

/// Reads an object {width?, height?, ao_radius?, cameras: [...]} or a bare list of cameras. Throws
/// InputError that names the file and what is at fault: the camera and its field, or the setting.
[[nodiscard]] CameraSet load_cameras(const std::filesystem::path& file);

/// Makes a camera that sees all of `bounds` in any picture at least as wide as it is high. It looks
/// toward -z, from a little to the right and above; y is up. Bounds that are empty or not finite
/// give the place and target of a default Camera. Throws InputError if vfov is not between 0 and
/// 180.
[[nodiscard]] Camera fit_camera(const Aabb& bounds, float vfov = 45.0f);
[[nodiscard]] CameraD fit_camera(const AabbD& bounds, double vfov = 45.0);

}  // namespace raydix
