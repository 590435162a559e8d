// Karras 2012 on the CPU. Sorted codes [n] -> links of the node array and parent slots; boxes are
// fitted after.
#pragma once

#include <raydix/buffer.h>
#include <raydix/bvh.h>

#include <cstdint>
#include <span>

#include "tree/hierarchy.h"

namespace raydix {

/// keys: sorted, at least one. Fills nodes [2 * inner + 2] but for the boxes; returns the number of
/// inner nodes. One work item per radix node; no pass is sequential. Subtrees of up to max_leaf
/// keys become leaves.
template <class Key>
std::uint32_t build_karras(std::span<const Key> keys, int max_leaf, Buffer<BvhNode>& nodes,
                           HierarchyScratch& scratch);

extern template std::uint32_t build_karras(std::span<const std::uint32_t>, int, Buffer<BvhNode>&,
                                           HierarchyScratch&);
extern template std::uint32_t build_karras(std::span<const std::uint64_t>, int, Buffer<BvhNode>&,
                                           HierarchyScratch&);

}  // namespace raydix
