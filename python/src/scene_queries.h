// How scenes are asked from Python without rays.
#pragma once

#include <nanobind/nanobind.h>

#include "scene_trees.h"

namespace raydix::python {

/// Closest points, touches, sweeps, inside and outside, overlaps.
template <class Scene>
void bind_queries(nanobind::class_<Scene>& scene);
extern template void bind_queries(nanobind::class_<SceneTrees>& scene);
extern template void bind_queries(nanobind::class_<SceneTreesD>& scene);

}  // namespace raydix::python
