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
template <class Scalar>
[[nodiscard]] nanobind::dict mesh_figures(const BasicMeshInfo<Scalar>& info);
extern template nanobind::dict mesh_figures(const MeshInfo& info);
extern template nanobind::dict mesh_figures(const MeshInfoD& info);
[[nodiscard]] nanobind::dict commit_figures(const CommitReport& report);
[[nodiscard]] nanobind::dict camera_figures(const Camera& camera);
[[nodiscard]] nanobind::dict camera_figures(const CameraD& camera);
/// The same in the order of raydix.Camera: position, target, up, vfov, name.
template <class Scalar>
using Coordinates = std::tuple<Scalar, Scalar, Scalar>;
template <class Scalar>
using CameraFields =
    std::tuple<Coordinates<Scalar>, Coordinates<Scalar>, Coordinates<Scalar>, Scalar, std::string>;
[[nodiscard]] inline Vec3 point_of(const Coordinates<float>& c) {
    return {std::get<0>(c), std::get<1>(c), std::get<2>(c)};
}
[[nodiscard]] inline Vec3d point_of(const Coordinates<double>& c) {
    return {std::get<0>(c), std::get<1>(c), std::get<2>(c)};
}
/// A UserWarning of what Model::cameras_fault says, if it says anything. With the interpreter's
/// lock.
void warn_of_cameras(const std::string& fault);
[[nodiscard]] Camera camera_of(const CameraFields<float>& fields);
[[nodiscard]] CameraD camera_of(const CameraFields<double>& fields);
[[nodiscard]] nanobind::dict stage_ms(const BuildMs& ms);
[[nodiscard]] nanobind::tuple corners(const Aabb& box);
[[nodiscard]] nanobind::tuple corners(const AabbD& box);

}  // namespace raydix::python
