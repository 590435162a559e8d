// Whether a tree is what it claims to be.
#pragma once

#include <raydix/bvh.h>

#include <string>

namespace raydix {

/// What a check found.
struct CheckReport {
    bool ok = true;
    std::string
        broken;  // the first invariant that does not hold, with node and values; empty if ok
    std::uint64_t nodes = 0;       // inner + leaves
    std::uint64_t primitives = 0;  // in leaves
};

/// Checks every invariant of a tree:
/// - options are such as a build takes, and counts fit the arrays;
/// - slots of nodes are in range and used once, so that there is no cycle; slot 1 is zero;
/// - leaves hold at most max_leaf primitives and follow each other in the order;
/// - the depth is exact;
/// - each primitive is in range (docs/contract.md 1), without -0, and in exactly one leaf;
/// - every box is the tight union of what it holds.
/// A leaf of `split` and `sbvh` may hold parts of triangles. There a triangle is in one leaf or
/// more, and the boxes of its leaves cover it.
///
/// Trees of the LBVH family without reinsertion also have a depth within TreeStats::depth_bound,
/// and no inner node whose primitives a leaf could hold. Unless they were refitted, their codes
/// ascend and each inner node divides them where they first differ.
[[nodiscard]] CheckReport check(const Bvh& bvh);

/// The same, and compares with the mesh that the tree was built from. Its indices are in range. The
/// triangles or points in leaves are those of the mesh, bit for bit, -0 read as +0. None is left
/// out without a reason. Of a tree of boxes only the indices of the mesh are checked.
[[nodiscard]] CheckReport check(const Bvh& bvh, const MeshView& mesh);

/// Compares two trees that pass `check`: kind, bits, max_leaf, counts, depth, topology, boxes,
/// order and primitives of leaves. Slots of nodes may differ. `broken` names the first difference;
/// nodes and primitives are those of `a`.
[[nodiscard]] CheckReport check_same(const Bvh& a, const Bvh& b);

}  // namespace raydix
