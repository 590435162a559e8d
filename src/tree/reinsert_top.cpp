#include "tree/reinsert_top.h"

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include "exec/parallel.h"
#include "tree/radix_tree.h"

namespace raydix {
namespace {

constexpr std::size_t least_inner_nodes = 2;  // below, there is one tree

std::size_t top_size(std::size_t inner, const TopOptions& options) {
    return std::min(
        inner,
        std::max<std::size_t>(options.least,
                              static_cast<std::size_t>(options.part * static_cast<double>(inner))));
}

struct ClusterTop {
    const ClusterTree& tree;

    [[nodiscard]] ClusterRef root() const { return tree.root; }
    [[nodiscard]] bool is_leaf(ClusterRef ref) const {
        return is_primitive(ref) || tree.nodes[ref].sum.inner == 0;
    }
    [[nodiscard]] Aabb box(ClusterRef ref) const {
        if (is_primitive(ref)) return tree.primitives.get(ref & ~primitive_cluster);
        return {tree.nodes[ref].lo, tree.nodes[ref].hi};
    }
    [[nodiscard]] std::array<ClusterRef, 2> children(ClusterRef inner) const {
        return {tree.nodes[inner].left, tree.nodes[inner].right};
    }
    void prefetch(ClusterRef inner) const {
        for (const ClusterRef child : children(inner))
            if (!is_primitive(child)) __builtin_prefetch(&tree.nodes[child]);
    }
};

/// Slots of the inner nodes, parents before children.
std::vector<std::uint32_t> inner_from_root(const std::vector<BvhNode>& nodes) {
    std::vector<std::uint32_t> found;
    found.reserve(nodes.size() / 2);
    if (!nodes[0].is_leaf()) found.push_back(0);
    for (std::size_t next = 0; next < found.size(); ++next) {
        const std::uint32_t pair = nodes[found[next]].first;
        for (const std::uint32_t slot : {pair, pair + 1})
            if (!nodes[slot].is_leaf()) found.push_back(slot);
    }
    return found;
}

struct FinishedTop {
    const BvhNode* nodes;

    [[nodiscard]] static std::uint32_t root() { return 0; }
    [[nodiscard]] bool is_leaf(std::uint32_t slot) const { return nodes[slot].is_leaf(); }
    [[nodiscard]] Aabb box(std::uint32_t slot) const { return {nodes[slot].lo, nodes[slot].hi}; }
    [[nodiscard]] std::array<std::uint32_t, 2> children(std::uint32_t slot) const {
        return {nodes[slot].first, nodes[slot].first + 1};
    }
    void prefetch(std::uint32_t slot) const { __builtin_prefetch(&nodes[nodes[slot].first]); }
};

/// A node of the top on its way into the finished tree.
struct PlacedTop {
    std::uint32_t inner = 0, references = 0, least = 0;  // of all that is below
    std::uint32_t rank = 0, first = 0, depth = 0;        // in the new tree
    std::uint32_t slot = 0;
};

/// What was below the top's leaves is copied, subtree by subtree, each by one thread.
class FinishedPlacing {
public:
    FinishedPlacing(const TopTree& top, const BvhNode* nodes, const std::uint32_t* order)
        : top_(top), nodes_(nodes), order_(order), placed_(top.nodes.size()) {
        for (std::uint32_t slot = 0; slot < top.nodes.size(); ++slot)
            if (slot != 1 && top.nodes[slot].is_leaf()) leaves_.push_back(slot);
    }

    /// Returns the depth of the new tree.
    std::uint32_t run(Buffer<BvhNode>& nodes, Buffer<std::uint32_t>& order) {
        for_each_index(
            leaves_.size(), [&](std::size_t k) { sum_below(leaves_[k]); }, 16);
        const std::vector<std::uint32_t> from_root = inner_from_root(top_.nodes);
        for (std::size_t k = from_root.size(); k-- > 0;) sum_children(from_root[k]);
        nodes.reset(2 * std::size_t{placed_[0].inner} + 2);
        order.reset(placed_[0].references);
        out_nodes_ = nodes.data();
        out_order_ = order.data();
        out_nodes_[1] = {{0, 0, 0}, 0, {0, 0, 0}, 0};
        for (const std::uint32_t slot : from_root) place_children(slot);
        std::vector<std::uint32_t> deepest(leaves_.size());
        for_each_index(
            leaves_.size(), [&](std::size_t k) { deepest[k] = copy_below(leaves_[k]); }, 16);
        return *std::max_element(deepest.begin(), deepest.end());
    }

private:
    [[nodiscard]] std::uint32_t old_slot(std::uint32_t leaf) const {
        return top_.refs[top_.nodes[leaf].first];
    }

    void sum_below(std::uint32_t leaf) {
        PlacedTop sum;
        sum.least = UINT32_MAX;
        std::vector<std::uint32_t> waiting{old_slot(leaf)};
        while (!waiting.empty()) {
            const BvhNode& node = nodes_[waiting.back()];
            waiting.pop_back();
            if (node.is_leaf()) {
                sum.references += node.count;
                sum.least = std::min(sum.least, order_[node.first]);
            } else {
                ++sum.inner;
                waiting.push_back(node.first + 1);
                waiting.push_back(node.first);
            }
        }
        placed_[leaf] = sum;
    }
    void sum_children(std::uint32_t slot) {
        const std::uint32_t pair = top_.nodes[slot].first;
        const PlacedTop &a = placed_[pair], &b = placed_[pair + 1];
        placed_[slot].inner = 1 + a.inner + b.inner;
        placed_[slot].references = a.references + b.references;
        placed_[slot].least = std::min(a.least, b.least);
    }

    /// The left child is the side of the smallest primitive id.
    void place_children(std::uint32_t slot) {
        const PlacedTop at = placed_[slot];
        std::uint32_t left = top_.nodes[slot].first, right = left + 1;
        if (placed_[right].least < placed_[left].least) std::swap(left, right);
        PlacedTop &a = placed_[left], &b = placed_[right];
        a.rank = at.rank + 1;
        a.first = at.first;
        b.rank = a.rank + a.inner;
        b.first = at.first + a.references;
        a.depth = b.depth = at.depth + 1;
        a.slot = pair_slot(at.rank);
        b.slot = a.slot + 1;
        const BvhNode& node = top_.nodes[slot];
        out_nodes_[at.slot] = {node.lo, a.slot, node.hi, 0};
    }

    /// In preorder. Returns the depth of the deepest leaf.
    std::uint32_t copy_below(std::uint32_t leaf) {
        struct Waiting {
            std::uint32_t from, to, depth;
        };
        PlacedTop at = placed_[leaf];
        std::uint32_t deepest = 0;
        std::vector<Waiting> waiting{{old_slot(leaf), at.slot, at.depth}};
        while (!waiting.empty()) {
            const Waiting next = waiting.back();
            waiting.pop_back();
            BvhNode node = nodes_[next.from];
            if (node.is_leaf()) {
                std::copy_n(order_ + node.first, node.count, out_order_ + at.first);
                node.first = at.first;
                at.first += node.count;
                deepest = std::max(deepest, next.depth);
            } else {
                const std::uint32_t pair = node.first;
                node.first = pair_slot(at.rank++);
                waiting.push_back({pair + 1, node.first + 1, next.depth + 1});
                waiting.push_back({pair, node.first, next.depth + 1});
            }
            out_nodes_[next.to] = node;
        }
        return deepest;
    }

    const TopTree& top_;
    const BvhNode* nodes_;
    const std::uint32_t* order_;
    std::vector<PlacedTop> placed_;  // by slot of the top
    std::vector<std::uint32_t> leaves_;
    BvhNode* out_nodes_ = nullptr;
    std::uint32_t* out_order_ = nullptr;
};

}  // namespace

ClusterRef reinsert_clusters(const ClusterTree& tree, ClusterNode* clusters, std::uint32_t max_leaf,
                             const TopOptions& options, TopScratch& scratch) {
    const ClusterTop view{tree};
    if (is_primitive(tree.root) || tree.nodes[tree.root].sum.inner < least_inner_nodes)
        return tree.root;
    TopTree& top = scratch.top;
    TopCut(view, top).run(top_size(tree.nodes[tree.root].sum.inner, options));
    if (reinsert_nodes(top.nodes, options.reinsertion, scratch.reinsertion).moves == 0)
        return tree.root;

    // Children before parents, into the places that the top's clusters had.
    std::sort(top.inner.begin(), top.inner.end());
    const std::vector<std::uint32_t> order = inner_from_root(top.nodes);
    std::vector<ClusterRef> refs(top.nodes.size());
    const auto part = [&](std::uint32_t slot) -> ClusterPart {
        const BvhNode& node = top.nodes[slot];
        const ClusterRef ref = node.is_leaf() ? top.refs[node.first] : refs[slot];
        const Aabb box{node.lo, node.hi};
        if (!is_primitive(ref)) return {ref, box, clusters[ref].sum};
        return {ref, box, sum_of_primitive(tree.ids[ref & ~primitive_cluster], box)};
    };
    for (std::size_t k = 0; k < order.size(); ++k) {
        const std::uint32_t slot = order[order.size() - 1 - k], pair = top.nodes[slot].first;
        clusters[top.inner[k]] = merge_clusters(part(pair), part(pair + 1), max_leaf);
        refs[slot] = top.inner[k];
    }
    return refs[0];
}

bool reinsert_finished(Buffer<BvhNode>& nodes, Buffer<std::uint32_t>& order,
                       std::uint32_t& max_depth, const TopOptions& options, TopScratch& scratch) {
    TopTree& top = scratch.top;
    const FinishedTop view{nodes.data()};
    if (nodes.size() / 2 - 1 < least_inner_nodes) return false;
    TopCut(view, top).run(top_size(nodes.size() / 2 - 1, options));
    if (reinsert_nodes(top.nodes, options.reinsertion, scratch.reinsertion).moves == 0)
        return false;
    std::swap(nodes, scratch.nodes);
    std::swap(order, scratch.order);
    max_depth = FinishedPlacing(top, scratch.nodes.data(), scratch.order.data()).run(nodes, order);
    return true;
}

}  // namespace raydix
