// The invariants of a wide tree. Safe on arrays that hold anything at all: the reader of .rdx files
// hands over what a stranger wrote. Time and memory are linear in the arrays and the meshes.
#pragma once

#include <raydix/mesh.h>
#include <raydix/wide.h>

#include <span>

#include "layout/wide_bvh.h"
#include "tree/validate.h"

namespace raydix {

/// "SECTION: reason" if `arrays` are no tree of width 8 around the triangles of `meshes`, which
/// follow each other: SECTION is one of trees, nodes, blocks, corners. Of `arrays` it reads the
/// buffers, the bounds and stats.compact. The meshes' indices are in range. Fills `stats` but for
/// sah, widening and times.
///
/// Each node but the first is the child of one that comes before it. Leaves lie within a block and
/// share no lane. Their corners are bit for bit those of the mesh (-0 as +0). The tree holds every
/// triangle that is in range and has an area, and no other. A child's box contains what is below
/// it: its triangles, unless some of the tree's are in several leaves in parts.
[[nodiscard]] Fault wide_fault(const WideBvh::Arrays& arrays, std::span<const MeshView> meshes,
                               WideBvhStats& stats);

}  // namespace raydix
