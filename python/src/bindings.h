// What each file of bindings adds to the module.
#pragma once

#include <nanobind/nanobind.h>

#include <string>

namespace raydix::python {

/// What raydix._arrays.path makes of a path: the system's own bytes, of any encoding.
[[nodiscard]] inline std::string path_of(const nanobind::bytes& path) {
    return {path.c_str(), path.size()};
}

/// The name of a file as Python has those of the system: bytes that are no UTF-8 stand as
/// surrogates.
[[nodiscard]] inline nanobind::object text_of(const std::string& name) {
    return nanobind::steal(
        PyUnicode_DecodeFSDefaultAndSize(name.data(), static_cast<Py_ssize_t>(name.size())));
}

void bind_scene(nanobind::module_& module);
void bind_points(nanobind::module_& module);
void bind_device(nanobind::module_& module);
void bind_pictures(nanobind::module_& module);
void bind_simulator(nanobind::module_& module);
void bind_trees(nanobind::module_& module);

}  // namespace raydix::python
