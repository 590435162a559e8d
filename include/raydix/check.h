// Is this tree what it claims to be?
#pragma once

#include <raydix/bvh.h>

#include <string>

namespace raydix {

struct CheckReport {
    bool ok = true;
    std::string
        broken;  // the first invariant that does not hold, with node and values; empty if ok
    std::uint64_t nodes = 0;
    std::uint64_t primitives = 0;
};

/// Every invariant: slots in range and used once (so no cycle), each primitive in exactly one leaf,
/// leaves within max_leaf and in order, every box the tight union of what it holds, exact depth,
/// padding zero. Trees of the LBVH family also: depth within its bound, no inner node that a leaf
/// could have held, and, unless they were refitted, codes that ascend and split where they first
/// differ.
[[nodiscard]] CheckReport check(const Bvh& bvh);

/// The same, and the leaf triangles are bit for bit those of `mesh`, or the leaf points its
/// vertices.
[[nodiscard]] CheckReport check(const Bvh& bvh, const MeshView& mesh);

/// Compares two valid trees in full: kind, bits, max_leaf, topology, boxes, order, leaf primitives;
/// node numbers may differ. Names the first difference.
[[nodiscard]] CheckReport check_same(const Bvh& a, const Bvh& b);

}  // namespace raydix
