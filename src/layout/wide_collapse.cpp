#include "layout/wide_collapse.h"

#include <raydix/error.h>

#include <algorithm>
#include <limits>
#include <string>
#include <vector>

#include "base/math.h"
#include "exec/parallel.h"
#include "layout/leaf_copies.h"

namespace raydix {
namespace {

Aabb box_of(const BvhNode& node) { return {node.lo, node.hi}; }

/// Box of some primitives in leaf order, within that of the leaf which held them: a builder that
/// splits primitives made the leaf's box smaller than theirs.
Aabb part_box(const Bvh& bvh, const BvhNode& leaf, std::uint32_t first, std::uint32_t count) {
    Aabb box;
    switch (bvh.kind()) {
        case PrimitiveKind::triangles:
            box = BoxOfLeaf<LeafTriangle>{bvh.triangles().data()}(first, count);
            break;
        case PrimitiveKind::boxes:
            box = BoxOfLeaf<Aabb>{bvh.boxes().data()}(first, count);
            break;
        case PrimitiveKind::points:
            box = BoxOfLeaf<Vec3>{bvh.points().data()}(first, count);
            break;
    }
    return {max_of(box.lo, leaf.lo), min_of(box.hi, leaf.hi)};
}

/// The nodes of a tree, with leaves of more than `max_leaf` divided in halves of their order until
/// none is left; new pairs of children stand behind the old nodes.
class DividedLeaves {
public:
    DividedLeaves(const Bvh& bvh, std::uint32_t max_leaf) : nodes_(bvh.nodes()) {
        const auto too_large = [&](const BvhNode& n) { return n.count > max_leaf; };
        if (std::ranges::none_of(nodes_, too_large)) return;
        own_.assign(nodes_.begin(), nodes_.end());
        for (std::size_t slot = 0; slot < own_.size(); ++slot)  // new ones are met later on
            if (too_large(own_[slot])) divide(bvh, slot);
        nodes_ = own_;
    }
    [[nodiscard]] std::span<const BvhNode> nodes() const { return nodes_; }

private:
    void divide(const Bvh& bvh, std::size_t slot) {
        const BvhNode leaf = own_[slot];
        const std::uint32_t half = leaf.count - leaf.count / 2;
        const auto add = [&](std::uint32_t first, std::uint32_t count) {
            const Aabb box = part_box(bvh, leaf, first, count);
            own_.push_back({box.lo, first, box.hi, count});
        };
        own_[slot].first = static_cast<std::uint32_t>(own_.size());
        own_[slot].count = 0;
        add(leaf.first, half);
        add(leaf.first + half, leaf.count - half);
    }

    std::span<const BvhNode> nodes_;
    std::vector<BvhNode> own_;
};

/// What is best for the subtree of a binary inner node.
template <int width>
struct Plan {
    float cost[width - 1];  // [i - 1]: as at most i wide subtrees; areas are parts of the root's
    std::uint32_t choices;  // four bits per i: see choice()
    std::uint32_t first, last;  // its primitives [first, last); first > last: not in one run

    /// i = 1: 1 for a leaf, 0 for a wide node. i > 1: so many of the i subtrees go to the left
    /// child; 0: as for i - 1.
    [[nodiscard]] int choice(int i) const {
        return static_cast<int>(choices >> (4 * (i - 1)) & 15u);
    }
    void choose(int i, int what) { choices |= static_cast<std::uint32_t>(what) << (4 * (i - 1)); }
    [[nodiscard]] bool is_leaf() const { return choice(1) == 1; }
};

/// The j-th division of i subtrees among two children, from even ones to uneven ones: among equal
/// costs (flat scenes have no others) the tree stays shallow.
constexpr int left_part(int i, int j) { return j % 2 == 1 ? i / 2 + (j + 1) / 2 : i / 2 - j / 2; }

std::uint32_t blocks_of(std::uint32_t count, const WideOptions& options) {
    return (count + options.block - 1) / options.block;
}

std::uint32_t rank_of(const BvhNode& inner) { return (inner.first - 2) / 2; }

template <int width>
class Collapse {
public:
    Collapse(std::span<const BvhNode> nodes, const WideOptions& options)
        : nodes_(nodes), options_(options), plans_((nodes.size() - 2) / 2) {
        const double root = half_area(box_of(nodes[0]));
        per_area_ = root > 0 ? 1.0 / root : 0.0;
    }

    WideTree run() {
        order_by_levels();
        for (std::size_t level = level_begin_.size() - 1; level-- > 0;)
            for_each_range(level_begin_[level + 1] - level_begin_[level], 512,
                           [&](std::size_t begin, std::size_t end) {
                               for (std::size_t k = begin; k < end; ++k)
                                   make_plan(nodes_[by_level_[level_begin_[level] + k]]);
                           });
        WideTree tree;
        tree.width = width;
        tree.max_depth = place_nodes();
        tree.children.reset(roots_.size() * width);
        for_each_range(roots_.size(), 512, [&](std::size_t begin, std::size_t end) {
            for (std::size_t w = begin; w < end; ++w) emit(w, &tree.children[w * width]);
        });
        return tree;
    }

private:
    [[nodiscard]] float relative_area(const BvhNode& node) const {
        return static_cast<float>(std::max(half_area(box_of(node)), 0.0) * per_area_);
    }

    [[nodiscard]] float leaf_cost(float area, std::uint32_t count) const {
        return area * static_cast<float>(blocks_of(count, options_)) *
               static_cast<float>(options_.primitive_cost);
    }

    /// Slots of the inner nodes, parents before children: a rank says nothing about depth.
    void order_by_levels() {
        by_level_.reserve(plans_.size());
        level_begin_ = {0};
        if (!nodes_[0].is_leaf()) by_level_.push_back(0);
        for (std::size_t begin = 0; begin < by_level_.size();) {
            const std::size_t end = by_level_.size();
            level_begin_.push_back(end);
            for (; begin < end; ++begin) {
                const std::uint32_t pair = nodes_[by_level_[begin]].first;
                if (!nodes_[pair].is_leaf()) by_level_.push_back(pair);
                if (!nodes_[pair + 1].is_leaf()) by_level_.push_back(pair + 1);
            }
        }
    }

    struct ChildPlan {
        float cost[width - 1];
        std::uint32_t first, last;
    };
    [[nodiscard]] ChildPlan child_plan(const BvhNode& child) const {
        ChildPlan plan;
        if (child.is_leaf()) {
            const float cost = leaf_cost(relative_area(child), child.count);
            std::fill_n(plan.cost, width - 1, cost);
            plan.first = child.first;
            plan.last = child.first + child.count;
        } else {
            const Plan<width>& own = plans_[rank_of(child)];
            std::copy_n(own.cost, width - 1, plan.cost);
            plan.first = own.first;
            plan.last = own.last;
        }
        return plan;
    }

    void make_plan(const BvhNode& node) {
        const ChildPlan left = child_plan(nodes_[node.first]),
                        right = child_plan(nodes_[node.first + 1]);
        Plan<width>& plan = plans_[rank_of(node)];
        plan.choices = 0;
        join_runs(left, right, plan);
        float shared[width + 1];
        int part[width + 1];
        for (int i = 2; i <= width; ++i) {
            shared[i] = std::numeric_limits<float>::infinity();
            for (int j = 0; j < i - 1; ++j) {
                const int k = left_part(i, j);
                const float cost = left.cost[k - 1] + right.cost[i - k - 1];
                if (cost < shared[i]) {
                    shared[i] = cost;
                    part[i] = k;
                }
            }
        }
        const float area = relative_area(node);
        plan.choose(width, part[width]);
        // The root is a node in any case: nothing is saved by making it a leaf, its only child.
        const double node_cost = &node == &nodes_[0] ? 0.0 : options_.node_cost;
        plan.cost[0] = shared[width] + area * static_cast<float>(node_cost);
        if (plan.first <= plan.last && plan.last - plan.first <= options_.max_leaf) {
            const float as_leaf = leaf_cost(area, plan.last - plan.first);
            if (as_leaf <= plan.cost[0]) {
                plan.cost[0] = as_leaf;
                plan.choose(1, 1);
            }
        }
        for (int i = 2; i < width; ++i) {
            const bool divided = shared[i] <= plan.cost[i - 2];
            plan.cost[i - 1] = divided ? shared[i] : plan.cost[i - 2];
            if (divided) plan.choose(i, part[i]);
        }
    }

    static void join_runs(const ChildPlan& a, const ChildPlan& b, Plan<width>& plan) {
        plan.first = 1, plan.last = 0;
        if (a.first > a.last || b.first > b.last) return;
        if (a.last == b.first)
            plan.first = a.first, plan.last = b.last;
        else if (b.last == a.first)
            plan.first = b.first, plan.last = a.last;
    }

    [[nodiscard]] bool ends_here(const BvhNode& node) const {
        return node.is_leaf() || plans_[rank_of(node)].is_leaf();
    }

    /// Slots of the children of the wide node whose root is `slot`; returns how many.
    int choose_children(std::uint32_t slot, std::uint32_t* chosen) const {
        if (ends_here(nodes_[slot])) {  // the whole tree is one leaf
            chosen[0] = slot;
            return 1;
        }
        struct Forest {
            std::uint32_t slot;
            int trees;
        };
        Forest open[width];
        int count = 0, waiting = 0;
        const auto divide = [&](const BvhNode& node, int trees) {
            const int left = plans_[rank_of(node)].choice(trees);
            open[waiting++] = {node.first + 1, trees - left};
            open[waiting++] = {node.first, left};
        };
        divide(nodes_[slot], width);
        while (waiting > 0) {
            const Forest next = open[--waiting];
            const BvhNode& node = nodes_[next.slot];
            int trees = next.trees;
            if (!node.is_leaf())
                while (trees > 1 && plans_[rank_of(node)].choice(trees) == 0) --trees;
            if (node.is_leaf() || trees == 1)
                chosen[count++] = next.slot;
            else
                divide(node, trees);
        }
        return count;
    }

    /// Numbers the wide nodes level by level; returns how many levels there are.
    std::uint32_t place_nodes() {
        roots_ = {0};
        std::uint32_t levels = 0;
        for (std::size_t begin = 0; begin < roots_.size(); ++levels)
            for (const std::size_t end = roots_.size(); begin < end; ++begin) {
                base_.push_back(static_cast<std::uint32_t>(roots_.size()));
                std::uint32_t chosen[width];
                const int count = choose_children(roots_[begin], chosen);
                for (int k = 0; k < count; ++k)
                    if (!ends_here(nodes_[chosen[k]])) roots_.push_back(chosen[k]);
            }
        return levels;
    }

    void emit(std::size_t w, BvhNode* out) const {
        std::uint32_t chosen[width];
        const int count = choose_children(roots_[w], chosen);
        std::uint32_t next = base_[w];
        for (int k = 0; k < count; ++k) {
            const BvhNode& node = nodes_[chosen[k]];
            out[k] = node;
            if (node.is_leaf()) continue;
            const Plan<width>& plan = plans_[rank_of(node)];
            out[k].first = plan.is_leaf() ? plan.first : next++;
            out[k].count = plan.is_leaf() ? plan.last - plan.first : 0;
        }
        const Aabb none = empty_box();
        std::fill(out + count, out + width, BvhNode{none.lo, WideTree::no_child, none.hi, 0});
    }

    std::span<const BvhNode> nodes_;
    WideOptions options_;
    double per_area_ = 0;
    std::vector<Plan<width>> plans_;           // [inner nodes], by rank
    std::vector<std::uint32_t> by_level_;      // [inner nodes]
    std::vector<std::size_t> level_begin_;     // [levels + 1]
    std::vector<std::uint32_t> roots_, base_;  // [wide nodes]: slot; first inner child
};

}  // namespace

void check_wide_options(const WideOptions& options) {
    if (options.width != 4 && options.width != 8)
        throw InputError("wide trees have 4 or 8 children a node, not " +
                         std::to_string(options.width));
    if (options.block == 0) throw InputError("a block must hold one primitive at least");
    if (options.max_leaf == 0) throw InputError("a leaf must hold one primitive at least");
}

WideTree collapse_to_wide(const Bvh& bvh, const WideOptions& options) {
    check_wide_options(options);
    WideTree none;
    none.width = options.width;
    if (bvh.empty()) return none;
    const DividedLeaves divided(bvh, options.max_leaf);
    return options.width == 4 ? Collapse<4>(divided.nodes(), options).run()
                              : Collapse<8>(divided.nodes(), options).run();
}

double wide_cost(const WideTree& tree, const WideOptions& options) {
    double sum = 0, root_area = 0;
    for (std::uint32_t w = 0; w < tree.node_count(); ++w) {
        Aabb box = empty_box();
        for (const BvhNode& child : tree.node(w)) {
            if (WideTree::is_unused(child)) continue;
            box = unite(box, box_of(child));
            sum +=
                blocks_of(child.count, options) * options.primitive_cost * half_area(box_of(child));
        }
        if (w == 0) root_area = half_area(box);
        sum += options.node_cost * half_area(box);
    }
    return root_area > 0 ? sum / (root_area * options.node_cost) : 0.0;
}

}  // namespace raydix
