// A scene's geometries -> the trees that rays go through.
#pragma once

#include "engine/scene_state.h"

namespace raydix {

/// Trees of triangles that did not change since `state.tree` was made are kept. `state` stays as it
/// is. Throws InputError as BasicScene::commit says, and what options.progress throws.
[[nodiscard]] std::shared_ptr<const SceneTree> make_scene_tree(const SceneAccess::State& state,
                                                               const SceneOptions& options,
                                                               CommitReport& report);
[[nodiscard]] std::shared_ptr<const SceneTreeD> make_scene_tree(const SceneAccessD::State& state,
                                                                const SceneOptions& options,
                                                                CommitReport& report);

}  // namespace raydix
