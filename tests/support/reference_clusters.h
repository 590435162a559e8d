// Locally-ordered clustering straight from its definition: serial, slow and short. What the
// parallel builders make is compared with it.
#pragma once

#include <raydix/bvh.h>

#include <span>

namespace raydix::test {

/// Meister and Bittner's rounds over one list, radius 8, with the rules of docs/algorithms/ploc.md.
/// Node numbers differ from a builder's; everything that tree_hash and check_same look at must not.
Bvh reference_ploc(std::span<const Aabb> boxes, const BuildOptions& options);

/// The same rounds at every node of the radix tree with more than 16 primitives, over the lists of
/// its children, until 16 clusters are left (docs/algorithms/hploc.md).
Bvh reference_hploc(std::span<const Aabb> boxes, const BuildOptions& options);

/// Binned SAH from the top over primitives alone, one bin after the other
/// (docs/algorithms/binned.md). The builder's tree is the same up to 32768 primitives; above, its
/// first planes are found over runs of neighbours.
Bvh reference_binned(std::span<const Aabb> boxes, const BuildOptions& options);

}  // namespace raydix::test
