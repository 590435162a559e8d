// The meshes and shapes of a scene apart from its instances.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "engine/scene_state.h"

namespace raydix {

/// By ascending id. Scenes often hold many instances beside few of these, so that what a commit
/// asks of them should not look at all geometries.
template <class Scalar>
using OwnGeometries = std::vector<
    std::pair<std::uint32_t, const typename BasicSceneInternals<Scalar>::State::Geometry*>>;

}  // namespace raydix
