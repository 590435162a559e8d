// A finished tree -> a better one over the same leaves: in rounds, the nodes of the largest areas
// are taken out, each with all that is below it, and put in where the tree's area grows least
// (Bittner, Hapala, Havran 2013, "Fast insertion-based optimization of bounding volume
// hierarchies"; all nodes of a round at once as in Meister and Bittner 2018, "Parallel Reinsertion
// for Bounding Volume Hierarchy Optimization").
#pragma once

#include <raydix/buffer.h>
#include <raydix/bvh.h>

#include <cstdint>
#include <span>
#include <vector>

#include "tree/insertion_search.h"

namespace raydix {

struct ReinsertionOptions {
    int rounds = 1;
    double part = 0.4;          // of all nodes that a round tries to move, those of largest area
    double least_gain = 0.001;  // of the summed area: a round that gains less is the last one
    std::uint32_t most_visits = 2048;  // pairs that the search for one place looks at
};

/// Memory kept from one build to the next.
struct ReinsertionScratch {
    Buffer<std::uint32_t> parents;  // [inner + 1]
    Buffer<std::uint64_t> claims;   // [2 * inner + 2]
    Buffer<std::uint32_t> waiting;  // [inner + 1]: children to be fitted first, and marks
    Buffer<std::uint32_t> candidates, block_sums;
    Buffer<Insertion> found;
    std::vector<std::uint32_t> area_bins;

    [[nodiscard]] std::size_t capacity_bytes() const;
};

struct ReinsertionResult {
    int rounds = 0;           // that gained something
    std::uint64_t moves = 0;  // in all of them
};

/// nodes [2 * inner + 2], boxes fitted and finite. Leaves keep what they hold; which slot a node
/// has, which child is the left one and the order of leaves are left in disorder. The sum of the
/// inner nodes' areas, in double, never grows. The same for every thread count.
ReinsertionResult reinsert_nodes(std::span<BvhNode> nodes, const ReinsertionOptions& options,
                                 ReinsertionScratch& scratch);

}  // namespace raydix
