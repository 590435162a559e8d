// The top of a SAH build: nodes above the tasks, which one thread each turns into subtrees, and how
// both are put together to one tree in preorder.
#pragma once

#include <raydix/buffer.h>
#include <raydix/bvh.h>

#include <cstdint>
#include <vector>

namespace raydix {

/// What a subtree came to.
struct SubtreeSum {
    std::uint32_t inner = 0, references = 0, height = 0;
    float cost = 0;  // SAH times the root's area
};

/// Where a subtree goes: pairs of children from `nodes` on, in preorder; links count from 0, pair r
/// at 2 r, and places of the order from 0.
struct SubtreeOut {
    BvhNode* nodes;        // [2 * (references - 1)]
    std::uint32_t* order;  // [references]
};

/// A node above the tasks, or a task. `begin`: the first of its references, hence where its
/// subtree is kept.
struct SahTopNode {
    std::uint32_t begin = 0;
    std::uint32_t left = 0;  // its children are left and left + 1; 0: a task
    SubtreeSum sum{};
    BvhNode node{};
    std::uint32_t rank = 0, first = 0;  // in the finished tree: of its own pair, of its references
};

/// Room of the subtrees, for all tasks together.
struct SubtreeStore {
    Buffer<BvhNode> nodes;
    Buffer<std::uint32_t> order;

    void reset(std::size_t references) {
        nodes.reset(2 * references);
        order.reset(references);
    }
    [[nodiscard]] SubtreeOut of(const SahTopNode& task) {
        return {nodes.data() + 2 * std::size_t{task.begin}, order.data() + task.begin};
    }
    [[nodiscard]] std::size_t capacity_bytes() const {
        return nodes.capacity_bytes() + order.capacity_bytes();
    }
};

/// top[0] is the root, children stand behind their parents, and the tasks are done. Fills nodes
/// [2 * inner + 2] and order; the whole tree's sum is then in top[0].
void place_subtrees(std::vector<SahTopNode>& top, SubtreeStore& store, Buffer<BvhNode>& nodes,
                    Buffer<std::uint32_t>& order);

}  // namespace raydix
