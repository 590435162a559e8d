// Parallel locally-ordered clustering: primitives in Morton order are clusters; in each round every
// cluster looks for its nearest neighbour a few places left and right, and those that chose each
// other merge (Meister and Bittner 2018; the search that computes each pair once follows Benthin et
// al. 2022, "PLOC++").
#pragma once

#include <raydix/buffer.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "tree/box_lanes.h"
#include "tree/cluster.h"

namespace raydix {

struct PlocOptions {
    /// Places to search on each side, up to max_radius. More costs time in proportion and hardly
    /// changes SAH (docs/algorithms/ploc.md).
    std::uint32_t radius = 8;
};

/// A list of clusters in Morton order.
struct ClusterList {
    BoxLanes boxes;
    Buffer<ClusterRef> refs;
};

/// Memory kept from one build to the next.
struct PlocScratch {
    BoxLanes primitives;               // [n], the caller fills them in Morton order
    std::array<ClusterList, 2> lists;  // of one round and the next
    Buffer<ClusterNode> nodes;         // [n - 1] after a build
    Buffer<std::int8_t> partners;
    Buffer<std::uint32_t> block_sums;

    [[nodiscard]] std::size_t capacity_bytes() const;
};

/// scratch.primitives [n], n >= 1, and their ids [n] in Morton order -> scratch.nodes [n - 1],
/// children before parents. Returns the root, which is a primitive if n = 1. Lists go to `spare` as
/// far as there is room, which nobody else may use meanwhile: memory that has been touched before
/// is cheaper than memory that has not.
ClusterRef build_ploc(std::span<const std::uint32_t> ids, std::uint32_t max_leaf,
                      PlocScratch& scratch, std::span<std::byte> spare,
                      const PlocOptions& options = {});

}  // namespace raydix
