// How scenes are made and changed from Python.
#pragma once

#include <nanobind/nanobind.h>

#include "scene_trees.h"

namespace raydix::python {

template <class Scene>
void bind_changes(nanobind::class_<Scene>& scene);
extern template void bind_changes(nanobind::class_<SceneTrees>& scene);
extern template void bind_changes(nanobind::class_<SceneTreesD>& scene);
/// .rdx files.
template <class Scene>
void bind_saving(nanobind::class_<Scene>& scene);
extern template void bind_saving(nanobind::class_<SceneTrees>& scene);
extern template void bind_saving(nanobind::class_<SceneTreesD>& scene);
/// Other files, which are read in float32.
void bind_files(nanobind::class_<SceneTrees>& scene);
/// Spheres, capsules and points of one radius.
template <class Scene>
void bind_shapes(nanobind::class_<Scene>& scene);
extern template void bind_shapes(nanobind::class_<SceneTrees>& scene);
extern template void bind_shapes(nanobind::class_<SceneTreesD>& scene);

}  // namespace raydix::python
