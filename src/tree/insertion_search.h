// Where in a finished tree would a node stand best? Branch and bound from the node's own place
// upwards and from there down into what lies beside the way (Meister and Bittner 2018, "Parallel
// Reinsertion for Bounding Volume Hierarchy Optimization", section 4.1). Nodes of any Bvh, with the
// slot above each pair of children -> the best place and what it gains.
#pragma once

#include <raydix/bvh.h>

#include <cstdint>
#include <utility>
#include <vector>

#include "base/math.h"
#include "tree/cluster.h"

namespace raydix {

/// The node at `from` becomes the sibling of the node at `to`. The areas of inner nodes then sum to
/// `gain` less.
struct Insertion {
    static constexpr std::uint32_t nowhere = 1;  // the slot that no tree uses

    std::uint32_t from = 0, to = nowhere;
    std::uint32_t top = 0;  // the way down to `to` begins here; 0: `to` lies above `from`
    float gain = 0;
};

/// A tree whose nodes can be taken out and put in elsewhere. Pair k is the slots 2k and 2k + 1.
struct LinkedTree {
    BvhNode* nodes;          // [2 * inner + 2]
    std::uint32_t* parents;  // [inner + 1]: the slot of the node over pair k; 0 is unused

    [[nodiscard]] Aabb box(std::uint32_t slot) const { return {nodes[slot].lo, nodes[slot].hi}; }
    [[nodiscard]] std::uint32_t parent(std::uint32_t slot) const { return parents[slot / 2]; }
    /// Tells the children of the node at `slot` where it is.
    void adopt(std::uint32_t slot) const {
        if (!nodes[slot].is_leaf()) parents[nodes[slot].first / 2] = slot;
    }

    /// The sibling goes up; what stands at the new place becomes the sibling. Boxes from `to` and
    /// from `top` upwards are then to be fitted.
    void insert(Insertion& move) const {
        const std::uint32_t pair = move.from & ~1u, sibling = move.from ^ 1;
        const std::uint32_t above = parent(move.from);
        nodes[above] = nodes[sibling];
        nodes[sibling] = nodes[move.to];
        make_inner(move.to, pair);
        for (const std::uint32_t slot : {above, sibling, move.to}) adopt(slot);
        move.top = above;  // from here on: the slot over which it stood
    }
    /// The links are those before insert(); the same boxes are to be fitted.
    void take_back(const Insertion& move) const {
        const std::uint32_t pair = move.from & ~1u, sibling = move.from ^ 1;
        nodes[move.to] = nodes[sibling];
        nodes[sibling] = nodes[move.top];
        make_inner(move.top, pair);
        for (const std::uint32_t slot : {move.to, sibling, move.top}) adopt(slot);
    }

    void make_inner(std::uint32_t slot, std::uint32_t pair) const {
        nodes[slot].first = pair;
        nodes[slot].count = 0;
    }
};

class InsertionSearch {
public:
    /// Looks at no more than `most_visits` pairs for each node and takes the best place seen.
    InsertionSearch(const LinkedTree& tree, std::uint32_t most_visits)
        : tree_(tree), most_visits_(most_visits) {}

    /// For the node at `from`, which is not the root.
    [[nodiscard]] Insertion find(std::uint32_t from) {
        box_ = tree_.box(from);
        area_ = cluster_area(box_);
        std::uint32_t at = tree_.parent(from);
        // What would be left of the node at `at`, and what has been saved up to there.
        Aabb left = tree_.box(from ^ 1);
        const float above = cluster_area(tree_.box(at));
        saved_ = above;
        best_ = {from, Insertion::nowhere, 0, least_gain * above};
        visits_left_ = most_visits_;
        top_ = from ^ 1;
        descend(top_, above - cluster_area(left));
        while (at != 0 && visits_left_ != 0) {
            --visits_left_;
            const std::uint32_t other = at ^ 1, up = tree_.parent(at);
            top_ = other;
            consider(other);
            const Aabb whole = tree_.box(up);
            const float whole_area = cluster_area(whole);
            left = unite(left, tree_.box(other));
            const float left_area = cluster_area(left);
            saved_ += whole_area - left_area;
            if (saved_ - whole_area > best_.gain) best_ = {from, up, 0, saved_ - whole_area};
            // Nothing more is saved further up, and there is no cheaper place than a box within.
            if (left_area == whole_area && saved_ - area_ <= best_.gain) break;
            at = up;
        }
        return best_;
    }

private:
    /// Of the area above a node: what rounding may pretend is not worth a move.
    static constexpr float least_gain = 1e-5f;

    struct Waiting {
        std::uint32_t slot;  // of an inner node whose children are to be looked at
        float growth;        // of all nodes from the top down to this one
    };

    /// The place beside a top, and those below it.
    void consider(std::uint32_t top) {
        if (saved_ - area_ <= best_.gain) return;
        const float growth = look(top, 0);
        if (growth >= 0) descend(top, growth);
    }

    /// Considers the place beside `slot`. Returns the growth of everything down to it, or -1 if no
    /// place below can be better.
    float look(std::uint32_t slot, float growth) {
        const Aabb box = tree_.box(slot);
        const float united = cluster_area(unite(box, box_));
        const float gain = saved_ - growth - united;
        if (gain > best_.gain) best_ = {best_.from, slot, top_, gain};
        if (tree_.nodes[slot].is_leaf()) return -1;
        const float below = growth + (united - cluster_area(box));
        return saved_ - below - area_ > best_.gain ? below : -1;
    }

    void descend(std::uint32_t slot, float growth) {
        if (tree_.nodes[slot].is_leaf()) return;
        waiting_.clear();
        waiting_.push_back({slot, growth});
        while (!waiting_.empty() && visits_left_ != 0) {
            const Waiting next = waiting_.back();
            waiting_.pop_back();
            if (saved_ - next.growth - area_ <= best_.gain) continue;
            --visits_left_;
            const std::uint32_t pair = tree_.nodes[next.slot].first;
            float a = look(pair, next.growth), b = look(pair + 1, next.growth);
            std::uint32_t first = pair, second = pair + 1;
            if (b >= 0 && (a < 0 || b < a)) {
                std::swap(a, b);
                std::swap(first, second);
            }
            // The lesser growth goes first: it is on top.
            if (b >= 0) push(second, b);
            if (a >= 0) push(first, a);
        }
    }
    void push(std::uint32_t slot, float growth) {
        __builtin_prefetch(&tree_.nodes[tree_.nodes[slot].first]);
        waiting_.push_back({slot, growth});
    }

    LinkedTree tree_;
    std::uint32_t most_visits_, visits_left_ = 0;
    Aabb box_{};
    float area_ = 0, saved_ = 0;
    std::uint32_t top_ = 0;
    Insertion best_;
    std::vector<Waiting> waiting_;
};

}  // namespace raydix
