// Extents of a scene's parts -> a wide tree over them.
#pragma once

#include <cstdint>
#include <span>

#include "engine/scene_tree.h"

namespace raydix {

/// `parts`: those that the tree holds, not empty and in the range of coordinates; extents [all
/// parts].
void build_part_tree(std::span<const std::uint32_t> parts, std::span<const Extent> extents,
                     Quality quality, PartTree& out);

}  // namespace raydix
