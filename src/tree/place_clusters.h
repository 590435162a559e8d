// A cluster tree -> the arrays of a Bvh: nodes in preorder, leaves as ranges of the primitive
// order. Nothing depends on where the builder kept its clusters.
#pragma once

#include <raydix/buffer.h>
#include <raydix/bvh.h>

#include <cstdint>
#include <span>

#include "tree/box_lanes.h"
#include "tree/cluster.h"

namespace raydix {

/// A finished cluster tree over n primitives.
struct ClusterTree {
    const ClusterNode* nodes;
    ClusterRef root;
    const BoxLanes& primitives;          // [n] in Morton order
    std::span<const std::uint32_t> ids;  // [n] in Morton order
};

/// Fills nodes [2 * inner + 2] and order [n], ids within a leaf ascending. Returns the number of
/// inner nodes.
std::uint32_t place_clusters(const ClusterTree& tree, Buffer<BvhNode>& nodes,
                             Buffer<std::uint32_t>& order, std::uint32_t& max_depth);

}  // namespace raydix
