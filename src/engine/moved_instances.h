// Commits after which a few instances stand elsewhere, in the tree of the commit before.
#pragma once

#include "engine/scene_state.h"

namespace raydix {

/// Where nothing but the transforms and masks of few instances changed since the last commit, and
/// nobody else holds its tree: changes that tree into the one that make_scene_tree would give, in a
/// time that goes with the instances that moved. False, and all is as before, where that cannot be.
/// Throws InputError: `threads` out of range; and what options.progress throws.
[[nodiscard]] bool take_moves(SceneInternals::State& state, const SceneOptions& options,
                              CommitReport& report);
/// In double trees over parts are built by each commit.
[[nodiscard]] inline bool take_moves(SceneInternalsD::State&, const SceneOptions&, CommitReport&) {
    return false;
}

}  // namespace raydix
