// How scenes are made and changed from Python.
#pragma once

#include <nanobind/nanobind.h>

#include "scene_trees.h"

namespace raydix::python {

void bind_changes(nanobind::class_<SceneTrees>& scene);
/// In double there is one mesh, which can move.
void bind_changes(nanobind::class_<SceneTreesD>& scene);

}  // namespace raydix::python
