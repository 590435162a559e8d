// Top-down build with spatial splits: references -> nodes in preorder and leaf order. Stich,
// Friedrich, Dietrich 2009, "Spatial Splits in Bounding Volume Hierarchies".
#pragma once

#include <raydix/buffer.h>
#include <raydix/bvh.h>

#include <cstdint>

#include "tree/sah_top.h"
#include "tree/sbvh_divide.h"

namespace raydix {

/// Memory kept from one build to the next.
struct SbvhScratch {
    Buffer<SplitBox> references, spare;
    SubtreeStore subtrees;

    [[nodiscard]] std::size_t capacity_bytes() const {
        return references.capacity_bytes() + spare.capacity_bytes() + subtrees.capacity_bytes();
    }
};

/// References that `n` triangles may have beyond one each; fewer than 2^31 in all.
[[nodiscard]] std::uint32_t spatial_spare(std::uint32_t n, const SpatialOptions& options);

struct SbvhInput {
    const ReferenceCutter& cutter;
    std::uint32_t references;  // n >= 1
    std::uint32_t max_leaf;
    SpatialOptions options{};
};

/// scratch.references [n + spatial_spare], of which n are there, ascending by id. Fills nodes
/// [2 * inner + 2] and order, ids within a leaf ascending and each at most once. Returns the number
/// of inner nodes. `width` as for build_binned.
std::uint32_t build_sbvh(const SbvhInput& input, SbvhScratch& scratch, Buffer<BvhNode>& nodes,
                         Buffer<std::uint32_t>& order, std::uint32_t& max_depth,
                         int width = split_width());

}  // namespace raydix
