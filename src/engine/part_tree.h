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

/// The nodes of `old` around where the parts are now. False, and `out` has no meaning, if it holds
/// other parts, or if its cost would be more than `limit` times that at its build.
[[nodiscard]] bool refit_part_tree(const PartTree& old, std::span<const std::uint32_t> parts,
                                   std::span<const Extent> extents, double limit, PartTree& out);

}  // namespace raydix
