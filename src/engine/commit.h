// A scene's geometries -> the trees that rays go through.
#pragma once

#include "engine/scene_state.h"

namespace raydix {

/// Instances of instances are placed in the outermost scene up to so many parts.
inline constexpr std::size_t usually_placed = std::size_t{1} << 15;

/// Trees of triangles that did not change since `state.tree` was made are kept; where nothing
/// changed at all that tree comes back. `state` stays as it is. Throws InputError as
/// BasicScene::commit says, and what options.progress throws.
[[nodiscard]] std::shared_ptr<const SceneTree> make_scene_tree(
    const SceneInternals::State& state, const SceneOptions& options, CommitReport& report,
    std::size_t most_placed = usually_placed);
[[nodiscard]] std::shared_ptr<const SceneTreeD> make_scene_tree(
    const SceneInternalsD::State& state, const SceneOptions& options, CommitReport& report,
    std::size_t most_placed = usually_placed);

}  // namespace raydix
