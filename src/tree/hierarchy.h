// Sorted codes [n] -> links of the node array and parent slots, by any builder of the LBVH family.
// Boxes are fitted after.
#pragma once

#include <raydix/buffer.h>
#include <raydix/bvh.h>

#include <cstdint>
#include <span>

#include "tree/lbvh_launches.h"

namespace raydix {

/// Memory that a builder keeps from one build to the next.
struct HierarchyScratch {
    Buffer<std::uint8_t> prefixes;
    Buffer<std::uint64_t> kept_bits;
    Buffer<std::uint32_t> kept_before;
    Buffer<std::uint32_t> parent_slot;  // [inner]: where the box of each inner node is kept
    Buffer<std::byte> memory;           // of builders that run as launches (exec/arena.h)
    Buffer<std::uint32_t> level_memory;
    TreeLevels levels{};  // of builders that go level by level; else without limit
};

/// True if boxes are fitted level by level: as the options say, or as the builder's source does.
[[nodiscard]] constexpr bool fits_by_levels(const BuildOptions& options) {
    if (options.fit != Fit::as_published) return options.fit == Fit::levels;
    return options.builder == Builder::lauterbach || options.builder == Builder::garanzha;
}

/// Room for so many levels in `scratch.level_memory`.
[[nodiscard]] TreeLevels make_levels(std::uint32_t limit, HierarchyScratch& scratch);

/// keys: sorted, at least one. Fills nodes [2 * inner + 2] but for the boxes, and
/// scratch.parent_slot [inner]; returns the number of inner nodes. Subtrees of up to max_leaf keys
/// become leaves.
template <class Key>
std::uint32_t build_hierarchy(Builder builder, std::span<const Key> keys, int max_leaf,
                              Buffer<BvhNode>& nodes, HierarchyScratch& scratch);

extern template std::uint32_t build_hierarchy(Builder, std::span<const std::uint32_t>, int,
                                              Buffer<BvhNode>&, HierarchyScratch&);
extern template std::uint32_t build_hierarchy(Builder, std::span<const std::uint64_t>, int,
                                              Buffer<BvhNode>&, HierarchyScratch&);

}  // namespace raydix
