// How the modules of the package hand a scene of the library to each other: a function in a capsule
// of this name. They are built together, so they know it by the same layout.
#pragma once

#include <raydix/scene.h>

#include <functional>
#include <memory>
#include <type_traits>

namespace raydix::python {

template <class Scalar>
inline constexpr const char* scene_name =
    std::is_same_v<Scalar, float> ? "raydix.Scene" : "raydix.SceneD";

/// A scene as its last commit left it.
template <class Scalar>
struct LentScene {
    const BasicScene<Scalar>* scene;
    /// What meshes lie in that the scene and instances of it look at.
    std::shared_ptr<const void> arrays;
    /// While it lives, changes of the scene and of those that it places wait. The thread that
    /// called lets it go.
    std::shared_ptr<const void> locks;
};

/// Called without the interpreter's lock. Keeps the scene.
template <class Scalar>
using LendScene = std::function<LentScene<Scalar>()>;

}  // namespace raydix::python
