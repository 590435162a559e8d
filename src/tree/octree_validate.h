// The invariants of an octree. Safe on arrays that hold anything at all; time and memory are linear
// in them.
#pragma once

#include <raydix/octree.h>

#include "tree/validate.h"

namespace raydix {

/// The first invariant that does not hold. With a mesh also: bounds, points and the number left out
/// are its own.
[[nodiscard]] Fault validate(const Octree& octree, const MeshView* mesh = nullptr);

// The steps of `validate`, in its order; each relies on those before it.
[[nodiscard]] Fault validate_counts(const Octree& octree);
[[nodiscard]] Fault validate_levels(const Octree& octree);
[[nodiscard]] Fault validate_children(const Octree& octree);
[[nodiscard]] Fault validate_division(const Octree& octree);
[[nodiscard]] Fault validate_order(const Octree& octree);
[[nodiscard]] Fault validate_cells(const Octree& octree);
[[nodiscard]] Fault validate_against_mesh(const Octree& octree, const MeshView& mesh);

}  // namespace raydix
