// Reinsertion as the last step of a build: the top of the tree is cut off, improved
// (reinsertion.h), and put back over what was below it. For trees that are clusters still, and for
// finished ones.
#pragma once

#include <raydix/buffer.h>
#include <raydix/bvh.h>

#include <cstdint>

#include "tree/place_clusters.h"
#include "tree/reinsertion.h"
#include "tree/top_tree.h"

namespace raydix {

struct TopOptions {
    ReinsertionOptions reinsertion{};
    double part = 1.0 / 32;      // of all inner nodes that are the top; costs time in proportion
    std::uint32_t least = 2048;  // inner nodes of the top, if there are so many
};

/// As builds do it: who asks for few rounds gets a smaller top, too.
[[nodiscard]] inline TopOptions top_options(int rounds) {
    TopOptions options;
    options.reinsertion.rounds = rounds;
    constexpr int whole = 4;
    if (rounds < whole) {
        options.part *= static_cast<double>(rounds) / whole;
        options.least = options.least / whole * static_cast<std::uint32_t>(rounds);
    }
    return options;
}

/// Memory kept from one build to the next.
struct TopScratch {
    TopTree top;
    ReinsertionScratch reinsertion;
    Buffer<BvhNode> nodes;        // the arrays of the tree before; their memory
    Buffer<std::uint32_t> order;  // serves the next build

    /// Of the buffers: what memory_count() knows of.
    [[nodiscard]] std::size_t capacity_bytes() const {
        return reinsertion.capacity_bytes() + nodes.capacity_bytes() + order.capacity_bytes();
    }
};

/// `clusters` are tree.nodes; some of them change. Returns the new root. What would become a leaf
/// of the binary tree stays together.
ClusterRef reinsert_clusters(const ClusterTree& tree, ClusterNode* clusters, std::uint32_t max_leaf,
                             const TopOptions& options, TopScratch& scratch);

/// nodes [2 * inner + 2] and order of a finished tree, at least one leaf -> those of a better one
/// with the same leaves, nodes in preorder. Returns whether anything has changed.
bool reinsert_finished(Buffer<BvhNode>& nodes, Buffer<std::uint32_t>& order,
                       std::uint32_t& max_depth, const TopOptions& options, TopScratch& scratch);

}  // namespace raydix
