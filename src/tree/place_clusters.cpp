#include "tree/place_clusters.h"

#include <algorithm>
#include <array>
#include <vector>

#include "base/prefetch.h"
#include "exec/parallel.h"
#include "tree/radix_tree.h"

namespace raydix {
namespace {

/// Subtrees of up to this many inner nodes are one task.
constexpr std::uint32_t task_nodes = 4096;

/// An inner node that is to be written: its rank in preorder and the first place of its primitives.
struct Placed {
    ClusterRef ref;
    std::uint32_t rank, first;
};

class Placing {
public:
    Placing(const ClusterTree& tree, BvhNode* nodes, std::uint32_t* order)
        : tree_(tree), nodes_(nodes), order_(order) {}

    void run(const Placed& root) {
        const std::vector<Placed> tasks = place_top(root);
        for_each_index(
            tasks.size(), [&](std::size_t i) { place_subtree(tasks[i]); }, 1);
    }

    /// Writes one node that is a leaf.
    void leaf(BvhNode& out, ClusterRef ref, std::uint32_t first) {
        if (is_primitive(ref)) {
            const std::uint32_t place = ref & ~primitive_cluster;
            const Aabb box = tree_.primitives.get(place);
            out = {box.lo, first, box.hi, 1};
            order_[first] = tree_.ids[place];
            return;
        }
        const ClusterNode& node = tree_.nodes[ref];
        out = {node.lo, first, node.hi, node.sum.count};
        list_primitives(ref, order_ + first);
    }

private:
    /// All inner nodes of large subtrees; returns the small ones below them.
    std::vector<Placed> place_top(const Placed& root) {
        std::vector<Placed> waiting{root}, tasks;
        while (!waiting.empty()) {
            const Placed at = waiting.back();
            waiting.pop_back();
            if (tree_.nodes[at.ref].sum.inner <= task_nodes)
                tasks.push_back(at);
            else
                place(at, waiting);
        }
        return tasks;
    }

    /// Level by level, so that what a node asks for ahead has come when it is its turn.
    void place_subtree(const Placed& top) {
        std::vector<Placed> waiting{top};
        waiting.reserve(tree_.nodes[top.ref].sum.inner);
        for (std::size_t next = 0; next < waiting.size(); ++next) {
            const Placed at = waiting[next];
            place(at, waiting);
        }
    }

    /// Writes the two children of an inner node; those that are inner nodes have theirs yet to
    /// come.
    void place(const Placed& at, std::vector<Placed>& waiting) {
        const ClusterNode& node = tree_.nodes[at.ref];
        BvhNode* pair = nodes_ + pair_slot(at.rank);
        const Placed left{node.left, at.rank + 1, at.first};
        Placed right{node.right, at.rank + 1, at.first + 1};
        if (!is_primitive(left.ref)) {
            const ClusterSum& sum = tree_.nodes[left.ref].sum;
            right.rank += sum.inner;
            right.first = at.first + sum.count;
        }
        child(pair[1], right, waiting);
        child(pair[0], left, waiting);
    }

    void child(BvhNode& out, const Placed& at, std::vector<Placed>& waiting) {
        if (is_primitive(at.ref) || tree_.nodes[at.ref].sum.inner == 0)
            return leaf(out, at.ref, at.first);
        const ClusterNode& node = tree_.nodes[at.ref];
        out = {node.lo, pair_slot(at.rank), node.hi, 0};
        prefetch(node.left);
        prefetch(node.right);
        waiting.push_back(at);
    }

    RAYDIX_PREFETCHING void prefetch(ClusterRef ref) const {
        if (!is_primitive(ref)) __builtin_prefetch(&tree_.nodes[ref]);
    }

    void list_primitives(ClusterRef top, std::uint32_t* out) {
        // At most 255 primitives are below a leaf, so no more clusters can wait.
        std::array<ClusterRef, 256> waiting;
        std::size_t waiting_count = 0, listed = 0;
        waiting[waiting_count++] = top;
        while (waiting_count != 0) {
            const ClusterRef ref = waiting[--waiting_count];
            if (is_primitive(ref)) {
                out[listed++] = tree_.ids[ref & ~primitive_cluster];
            } else {
                waiting[waiting_count++] = tree_.nodes[ref].right;
                waiting[waiting_count++] = tree_.nodes[ref].left;
            }
        }
        sort_ids(out, listed);
    }

    /// Most leaves hold a few ids that are nearly in order.
    static void sort_ids(std::uint32_t* ids, std::size_t count) {
        if (count > 16) return std::sort(ids, ids + count);
        for (std::size_t k = 1; k < count; ++k) {
            const std::uint32_t id = ids[k];
            std::size_t at = k;
            for (; at > 0 && ids[at - 1] > id; --at) ids[at] = ids[at - 1];
            ids[at] = id;
        }
    }

    const ClusterTree& tree_;
    BvhNode* nodes_;
    std::uint32_t* order_;
};

}  // namespace

std::uint32_t place_clusters(const ClusterTree& tree, Buffer<BvhNode>& nodes,
                             Buffer<std::uint32_t>& order, std::uint32_t& max_depth) {
    const Vec3 zero{0, 0, 0};
    const bool one = is_primitive(tree.root);
    const std::uint32_t inner = one ? 0 : tree.nodes[tree.root].sum.inner;
    max_depth = one ? 0 : tree.nodes[tree.root].sum.height;
    order.reset(tree.ids.size());
    nodes.reset(2 * std::size_t{inner} + 2);
    nodes[1] = BvhNode{zero, 0, zero, 0};
    Placing placing(tree, nodes.data(), order.data());
    if (inner == 0) {
        placing.leaf(nodes[0], tree.root, 0);
    } else {
        const ClusterNode& root = tree.nodes[tree.root];
        nodes[0] = {root.lo, pair_slot(0), root.hi, 0};
        placing.run({tree.root, 0, 0});
    }
    return inner;
}

}  // namespace raydix
