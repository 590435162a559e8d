// Primitives at new places -> leaf copies and boxes of all nodes of a tree that keeps its links.
// One pass: each thread takes whole subtrees, copies what is in their leaves and unites boxes on
// the way back up, while both are in its cache; the few nodes above them come last.
#pragma once

#include <raydix/bvh.h>

#include <cstdint>
#include <vector>

#include "base/check.h"
#include "base/prefetch.h"
#include "exec/parallel.h"
#include "layout/leaf_order.h"
#include "tree/fit.h"

namespace raydix {

/// The top of a tree, cut into subtrees that are about as many as wanted.
struct TreeParts {
    std::vector<std::uint32_t> above;     // slots of inner nodes, parents first
    std::vector<std::uint32_t> subtrees;  // slots
};

inline TreeParts cut_tree(const BvhNode* nodes, std::size_t wanted) {
    TreeParts parts;
    std::vector<std::uint32_t> level{0}, next;
    while (!level.empty() && parts.subtrees.size() + level.size() < wanted) {
        next.clear();
        for (const std::uint32_t slot : level) {
            if (nodes[slot].is_leaf()) {
                parts.subtrees.push_back(slot);
                continue;
            }
            parts.above.push_back(slot);
            next.push_back(nodes[slot].first);
            next.push_back(nodes[slot].first + 1);
        }
        std::swap(level, next);
    }
    parts.subtrees.insert(parts.subtrees.end(), level.begin(), level.end());
    return parts;
}

/// Copies a primitive whose coordinates are known to be in range; returns its box.
inline Box3 copy_with_box(const TriangleSource& source, std::uint32_t i, LeafTriangle& copy) {
    const Float3 a = load_corner(source, i, 0), b = load_corner(source, i, 1),
                 c = load_corner(source, i, 2);
    a.store(copy.v0);
    b.store(copy.v1);
    c.store(copy.v2);
    return {min_of(min_of(a, b), c), max_of(max_of(a, b), c)};
}
template <class Source, class Copy>
Box3 copy_with_box(const Source& source, std::uint32_t i, Copy& copy) {
    copy = copy_primitive(source, i);
    return copy_box(copy);
}

/// What a pass found.
struct RefitSum {
    double cost = 0;                         // half areas of nodes times their costs
    std::uint32_t first_bad = no_primitive;  // the lowest id that is too small
};

template <class Source, class Copy>
class RefitWalk {
public:
    RefitWalk(const Source& source, std::span<const std::uint32_t> order, BvhNode* nodes,
              Copy* copies, std::uint32_t max_depth)
        : source_(source), order_(order), nodes_(nodes), copies_(copies), max_depth_(max_depth) {}

    /// The tree must not be empty.
    RefitSum run() const {
        constexpr std::size_t subtrees_wanted = 1024;
        const TreeParts parts = cut_tree(nodes_, subtrees_wanted);
        std::vector<RefitSum> sums(parts.subtrees.size());
        // What takes memory comes before the first change, so that a tree is never fitted in part.
        if (stack_size() <= most_waiting) {
            for_each_range(parts.subtrees.size(), 1, [&](std::size_t begin, std::size_t end) {
                Waiting stack[most_waiting];
                for (std::size_t k = begin; k < end; ++k) fit(parts.subtrees[k], stack, sums[k]);
            });
        } else {
            std::vector<Waiting> stack(stack_size());
            for (std::size_t k = 0; k < sums.size(); ++k)
                fit(parts.subtrees[k], stack.data(), sums[k]);
        }
        RefitSum sum;
        for (const RefitSum& part : sums) {
            sum.cost += part.cost;
            sum.first_bad = std::min(sum.first_bad, part.first_bad);
        }
        for (auto slot = parts.above.rbegin(); slot != parts.above.rend(); ++slot)
            unite_children(nodes_[*slot], sum);
        return sum;
    }

private:
    /// A node on the way down; `done`: its children's boxes are there, at the second visit.
    struct Waiting {
        std::uint32_t slot;
        bool done;
    };

    static constexpr std::size_t most_waiting = 512;  // on a thread's own stack
    /// A node that waits for its children, and one of these, a level.
    [[nodiscard]] std::size_t stack_size() const { return 2 * std::size_t{max_depth_} + 1; }

    void fit(std::uint32_t root, Waiting* stack, RefitSum& sum) const {
        std::size_t size = 0;
        stack[size++] = {root, false};
        while (size != 0) {
            Waiting& at = stack[size - 1];
            BvhNode& node = nodes_[at.slot];
            if (node.is_leaf()) {
                fit_leaf(node, sum);
                --size;
            } else if (at.done) {
                unite_children(node, sum);
                --size;
            } else {
                at.done = true;
                BvhNode* pair = nodes_ + node.first;
                // Leaves from left to right, at once where nothing waits before them.
                if (!pair[0].is_leaf()) {
                    stack[size++] = {node.first + 1, false};
                    stack[size++] = {node.first, false};
                    continue;
                }
                fit_leaf(pair[0], sum);
                if (pair[1].is_leaf())
                    fit_leaf(pair[1], sum);
                else
                    stack[size++] = {node.first + 1, false};
            }
        }
    }

    void fit_leaf(BvhNode& leaf, RefitSum& sum) const {
        Box3 box = Box3::load(empty_box());
        for (std::uint32_t k = leaf.first; k < leaf.first + leaf.count; ++k) {
            prefetch(k);
            const Box3 own = copy_with_box(source_, order_[k], copies_[k]);
            if (!any_at_least(own.hi - own.lo, Float3::all(min_diagonal)) &&
                !diagonal_in_range(own.box()))
                sum.first_bad = std::min(sum.first_bad, order_[k]);
            box = unite(box, own);
        }
        set_box(leaf, box.box());
        sum.cost += leaf.count * half_area(box_of(leaf));
    }
    void unite_children(BvhNode& node, RefitSum& sum) const {
        const BvhNode* pair = nodes_ + node.first;
        set_box(node, unite(box_of(pair[0]), box_of(pair[1])));
        sum.cost += half_area(box_of(node));
    }
    /// Leaves come in ascending order of positions.
    RAYDIX_PREFETCHING void prefetch(std::uint32_t k) const {
        constexpr std::uint32_t indices_ahead = 32, corners_ahead = 16;
        if (k + indices_ahead >= order_.size()) return;
        prefetch_indices(source_, order_[k + indices_ahead]);
        prefetch_corners(source_, order_[k + corners_ahead]);
    }

    const Source& source_;
    std::span<const std::uint32_t> order_;
    BvhNode* nodes_;
    Copy* copies_;
    std::uint32_t max_depth_;
};

}  // namespace raydix
