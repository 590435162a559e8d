// What each file of bindings adds to the module.
#pragma once

#include <nanobind/nanobind.h>

namespace raydix::python {

void bind_scene(nanobind::module_& module);
void bind_points(nanobind::module_& module);
void bind_device(nanobind::module_& module);
void bind_pictures(nanobind::module_& module);
void bind_simulator(nanobind::module_& module);
void bind_trees(nanobind::module_& module);

}  // namespace raydix::python
