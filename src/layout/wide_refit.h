// A wide tree around triangles that have moved: nodes and leaves stay, boxes are fitted again.
#pragma once

#include <raydix/mesh.h>
#include <raydix/wide.h>

#include <atomic>
#include <cstdint>
#include <memory>
#include <vector>

#include "exec/recycler.h"
#include "layout/wide_bvh.h"

namespace raydix {

/// Refits trees with the links of one tree. What links alone tell is found once; the memory of a
/// tree that it made goes to a later one when nobody holds the first any more.
class WideRefitter {
public:
    /// Null where the tree cannot be refitted: it is compact, or empty, or holds parts of
    /// triangles.
    [[nodiscard]] static std::shared_ptr<WideRefitter> of(const WideBvh& tree);

    /// `tree` around the triangles of `mesh`: that of the constructor, or one refitted from it. Its
    /// stats().sah is that of the tree as it is now. Null where the tree cannot be kept: there is
    /// another number of triangles; one of the tree is not finite, out of range or without area
    /// now; or one that was left out could be hit now. The same bits for every thread count. The
    /// indices must be within the vertices. One call at a time.
    [[nodiscard]] std::shared_ptr<const WideBvh> refit(const WideBvh& tree, const MeshView& mesh);

private:
    friend class WideRefit;

    /// Nodes that are fitted one after the other, from the last to the first; those of `above_` and
    /// blocks with leaves of several runs apart.
    static constexpr std::size_t nodes_of_a_run = 256;
    /// A block, the triangle of each lane, and its leaf's slot among those of all nodes. Lanes of
    /// no leaf have no_slot, and the triangle of one that has.
    struct LeafBlock {
        std::uint32_t block;
        std::uint32_t prim[block_lanes];
        std::uint32_t slot[block_lanes];
    };
    static constexpr std::uint32_t no_slot = ~std::uint32_t{0};

    /// False where the tree cannot be refitted.
    bool look_at_nodes(const WideBvh::Arrays& tree);
    bool look_at_leaves(const WideBvh::Arrays& tree);
    void put_blocks_in_runs(const WideBvh::Arrays& tree);
    [[nodiscard]] std::size_t runs() const {
        return (parent_.size() + nodes_of_a_run - 1) / nodes_of_a_run;
    }

    std::vector<std::uint32_t> parent_;  // [nodes]: the slot that the node is the child of
    std::vector<std::uint8_t> waits_;    // [nodes]: for nodes of other runs
    std::vector<std::uint32_t> above_;   // those, children first
    std::vector<LeafBlock> leaves_;      // [blocks]: those that no run has for itself, then by runs
    std::vector<std::size_t> first_;     // [runs + 1] in leaves_
    std::vector<std::uint32_t> others_;  // triangles that are in no leaf
    std::atomic<bool> has_loose_vertices_ = false;  // the vertices' box was not that of triangles
    Recycler<WideBvh> memory_;
};

}  // namespace raydix
