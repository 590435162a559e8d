// Statistics as Python has them: dicts with the names of the structs' fields.
#pragma once

#include <nanobind/nanobind.h>

#include <raydix/bvh.h>
#include <raydix/camera.h>
#include <raydix/check.h>
#include <raydix/mesh.h>
#include <raydix/scene.h>
#include <raydix/wide.h>

namespace raydix::python {

[[nodiscard]] nanobind::dict tree_figures(const TreeStats& stats);
[[nodiscard]] nanobind::dict wide_figures(const WideBvhStats& stats);
[[nodiscard]] nanobind::dict mesh_figures(const MeshInfo& info);
[[nodiscard]] nanobind::dict commit_figures(const CommitReport& report);
[[nodiscard]] nanobind::dict camera_figures(const Camera& camera);
[[nodiscard]] nanobind::dict stage_ms(const BuildMs& ms);
[[nodiscard]] nanobind::tuple corners(const Aabb& box);
[[nodiscard]] nanobind::tuple corners(const AabbD& box);

}  // namespace raydix::python
