// Cameras of scenes, rays from them, and pictures, from Python.
#pragma once

#include <nanobind/nanobind.h>

#include "scene_trees.h"

namespace raydix::python {

template <class Scene>
void bind_views(nanobind::class_<Scene>& scene);
extern template void bind_views(nanobind::class_<SceneTrees>& scene);
extern template void bind_views(nanobind::class_<SceneTreesD>& scene);

}  // namespace raydix::python
