// Statistics as Python has them: dicts with the names of the structs' fields.
#pragma once

#include <nanobind/nanobind.h>

#include <raydix/bvh.h>
#include <raydix/camera.h>
#include <raydix/check.h>
#include <raydix/mesh.h>
#include <raydix/scene.h>
#include <raydix/wide.h>

#include <string>
#include <tuple>

namespace raydix::python {

[[nodiscard]] nanobind::dict tree_figures(const TreeStats& stats);
[[nodiscard]] nanobind::dict wide_figures(const WideBvhStats& stats);
[[nodiscard]] nanobind::dict mesh_figures(const MeshInfo& info);
[[nodiscard]] nanobind::dict commit_figures(const CommitReport& report);
[[nodiscard]] nanobind::dict camera_figures(const Camera& camera);
/// The same in the order of raydix.Camera: position, target, up, vfov, name.
using Coordinates = std::tuple<float, float, float>;
using CameraFields = std::tuple<Coordinates, Coordinates, Coordinates, float, std::string>;
[[nodiscard]] Vec3 vec3(const Coordinates& c);
[[nodiscard]] Camera camera_of(const CameraFields& fields);
[[nodiscard]] nanobind::dict stage_ms(const BuildMs& ms);
[[nodiscard]] nanobind::tuple corners(const Aabb& box);
[[nodiscard]] nanobind::tuple corners(const AabbD& box);

}  // namespace raydix::python
