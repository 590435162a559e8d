// The invariants of a tree. Safe on arrays that hold anything at all: the reader of .rdx files
// hands over what a stranger wrote. Time and memory are linear in the arrays that are there.
#pragma once

#include <raydix/bvh.h>
#include <raydix/mesh.h>

#include <optional>
#include <string>

namespace raydix {

/// What is wrong, as "PART: reason" with PART one of info, nodes, order, primitives, triangles.
/// None: all is well.
using Fault = std::optional<std::string>;

/// A tree has fewer primitives than this (contract.md 1).
inline constexpr std::uint64_t primitive_limit = std::uint64_t{1} << 31;

/// Whether leaves may hold parts of primitives: trees of `split` and `sbvh` over triangles, and
/// over the boxes of triangles in double.
[[nodiscard]] inline bool may_split_primitives(const Bvh& bvh) {
    const bool cut = bvh.kind() == PrimitiveKind::triangles ||
                     (bvh.kind() == PrimitiveKind::boxes && bvh.has_split_primitives());
    return cut &&
           (bvh.options().builder == Builder::split || bvh.options().builder == Builder::sbvh);
}

/// The first invariant that does not hold. With a mesh also: its vertex indices are in range, and
/// the tree's primitives are bit for bit those of the mesh (a tree of boxes has no counterpart
/// there).
[[nodiscard]] Fault validate(const Bvh& bvh, const MeshView* mesh = nullptr);

// The steps of `validate`, in its order; each relies on those before it.
[[nodiscard]] Fault validate_counts(const Bvh& bvh);
[[nodiscard]] Fault validate_mesh_counts(const Bvh& bvh, const MeshView& mesh);
[[nodiscard]] Fault validate_topology(const Bvh& bvh);
[[nodiscard]] Fault validate_order(const Bvh& bvh);
[[nodiscard]] Fault validate_primitives(const Bvh& bvh);
[[nodiscard]] Fault validate_boxes(const Bvh& bvh);
/// Of trees with parts of triangles: the leaves' boxes cover each triangle.
[[nodiscard]] Fault validate_cover(const Bvh& bvh);
/// Of trees that still divide sorted codes: the codes of refitted ones are gone.
[[nodiscard]] Fault validate_codes(const Bvh& bvh);
[[nodiscard]] Fault validate_against_mesh(const Bvh& bvh, const MeshView& mesh);

/// The box of the primitive at a position of the order.
[[nodiscard]] Aabb primitive_box(const Bvh& bvh, std::size_t position);

}  // namespace raydix
