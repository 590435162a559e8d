// The invariants of a k-d tree, one step each. Safe on arrays that hold anything at all; time and
// memory are linear in the arrays that are there.
#pragma once

#include <raydix/kdtree.h>

#include "tree/validate.h"

namespace raydix {

/// The first invariant that does not hold, in the order below. With a mesh also: the tree's
/// primitives are bit for bit those of the mesh.
[[nodiscard]] Fault validate_kd(const KdTree& tree, const MeshView* mesh = nullptr);

// The steps; each relies on those before it.
[[nodiscard]] Fault validate_kd_counts(const KdTree& tree);
[[nodiscard]] Fault validate_kd_topology(const KdTree& tree);
[[nodiscard]] Fault validate_kd_primitives(const KdTree& tree);
[[nodiscard]] Fault validate_kd_splits(const KdTree& tree);
[[nodiscard]] Fault validate_kd_intervals(const KdTree& tree);
[[nodiscard]] Fault validate_kd_mesh(const KdTree& tree, const MeshView& mesh);

/// The box of the primitive at a position of the order.
[[nodiscard]] Aabb kd_primitive_box(const KdTree& tree, std::size_t position);

}  // namespace raydix
