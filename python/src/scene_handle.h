// How the modules of the package hand a scene of the library to each other: its address in a
// capsule of this name. They are built together, so they know it by the same layout.
#pragma once

#include <type_traits>

namespace raydix::python {

template <class Scalar>
inline constexpr const char* scene_name =
    std::is_same_v<Scalar, float> ? "raydix.Scene" : "raydix.SceneD";

}  // namespace raydix::python
