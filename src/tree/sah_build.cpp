#include "tree/sah_build.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "exec/parallel.h"
#include "tree/radix_tree.h"
#include "tree/sah_subtree.h"

namespace raydix {
namespace {

/// Subtrees of up to this many references are built by one thread each. Above the largest leaf, so
/// that no node above them becomes one.
constexpr std::uint32_t task_references = 8192;
static_assert(task_references > 255);
constexpr std::uint32_t block_references = 4096;

/// A node above the tasks, or a task, over places [begin, end) of the orders.
struct TopNode {
    std::uint32_t begin, end, depth;
    bool in_spare;
    std::uint32_t left = 0;    // its children are left and left + 1; 0: a task
    std::uint32_t middle = 0;  // of the lower side
    bool upper_is_left = false;
    SubtreeSum sum{};
    BvhNode node{};
    std::uint32_t rank = 0, first = 0;  // in the finished tree: of its own pair, of its references

    [[nodiscard]] std::uint32_t count() const { return end - begin; }
};

class SahRun {
public:
    SahRun(SahScratch& scratch, std::uint32_t max_leaf) : s_(scratch), max_leaf_(max_leaf) {}

    std::uint32_t run(Buffer<BvhNode>& nodes, Buffer<std::uint32_t>& order,
                      std::uint32_t& max_depth) {
        const auto n = static_cast<std::uint32_t>(s_.references.size());
        s_.sides.reset(n);
        if (n > task_references)
            for (auto& spare : s_.spare_orders) spare.reset(n);
        top_.push_back({0, n, 0, false});
        split_top();
        s_.local.reset(n);
        s_.order.reset(n);
        s_.nodes.reset(2 * std::size_t{n});
        build_tasks();
        sum_up();
        place(nodes, order);
        max_depth = top_[0].sum.height;
        return top_[0].sum.inner;
    }

private:
    [[nodiscard]] SweepLists lists_of(const TopNode& at) {
        auto& orders = at.in_spare ? s_.spare_orders : s_.orders;
        return {
            s_.references.data(),
            {orders[0].data() + at.begin, orders[1].data() + at.begin, orders[2].data() + at.begin},
            at.count()};
    }

    /// Level by level; all nodes of a level at once.
    void split_top() {
        for (std::size_t first = 0; first < top_.size();) {
            const std::size_t last = top_.size();
            for_each_index(
                last - first, [&](std::size_t i) { split(top_[first + i]); }, 1);
            for (; first < last; ++first) {
                const TopNode at = top_[first];
                if (at.middle == 0) continue;
                top_[first].left = static_cast<std::uint32_t>(top_.size());
                TopNode left{at.begin, at.middle, at.depth + 1, at.in_spare};
                TopNode right{at.middle, at.end, at.depth + 1, at.in_spare};
                if (at.upper_is_left) std::swap(left, right);
                top_.push_back(left);
                top_.push_back(right);
            }
        }
    }

    void split(TopNode& at) {
        if (at.count() <= task_references) return;
        const SweepLists lists = lists_of(at);
        SweepSplit split;
        split.left = at.count() / 2;
        if (at.depth < deepest_sah_split) split = find_sweep_split_parallel(lists);
        at.middle = at.begin + split.left;
        mark_sides(at, lists, split);
        at.in_spare = !at.in_spare;
        const SweepLists divided = lists_of(at);
        for (std::size_t axis = 0; axis < 3; ++axis)
            divide(lists.orders[axis], at.count(), split.left,
                   const_cast<std::uint32_t*>(divided.orders[axis]));
    }

    /// Side of each reference, and which side holds the smallest id; both: the lower one.
    void mark_sides(TopNode& at, const SweepLists& lists, const SweepSplit& split) {
        const std::size_t blocks = (lists.n + block_references - 1) / block_references;
        std::vector<std::array<std::uint32_t, 2>> least(blocks, {UINT32_MAX, UINT32_MAX});
        const std::uint32_t* chosen = lists.orders[split.axis];
        for_each_block(lists.n, block_references,
                       [&](std::size_t b, std::size_t begin, std::size_t end) {
                           for (std::size_t k = begin; k < end; ++k) {
                               const std::size_t side = k < split.left ? 0 : 1;
                               s_.sides[chosen[k]] = static_cast<std::uint8_t>(side);
                               const std::uint32_t id = s_.references[chosen[k]].primitive_id;
                               least[b][side] = std::min(least[b][side], id);
                           }
                       });
        std::array<std::uint32_t, 2> all{UINT32_MAX, UINT32_MAX};
        for (const auto& part : least)
            for (std::size_t side = 0; side < 2; ++side)
                all[side] = std::min(all[side], part[side]);
        at.upper_is_left = all[1] < all[0];
    }

    /// Stable, by sides.
    void divide(const std::uint32_t* from, std::uint32_t n, std::uint32_t left, std::uint32_t* to) {
        std::vector<std::uint32_t> lower((n + block_references - 1) / block_references);
        for_each_block(n, block_references, [&](std::size_t b, std::size_t begin, std::size_t end) {
            std::uint32_t uppers = 0;
            for (std::size_t k = begin; k < end; ++k) uppers += s_.sides[from[k]];
            lower[b] = static_cast<std::uint32_t>(end - begin) - uppers;
        });
        std::uint32_t before = 0;
        for (std::uint32_t& count : lower) {
            const std::uint32_t own = count;
            count = before;
            before += own;
        }
        for_each_block(n, block_references, [&](std::size_t b, std::size_t begin, std::size_t end) {
            std::array<std::uint32_t, 2> at{lower[b],
                                            left + static_cast<std::uint32_t>(begin) - lower[b]};
            for (std::size_t k = begin; k < end; ++k) to[at[s_.sides[from[k]]]++] = from[k];
        });
    }

    void build_tasks() {
        std::vector<std::uint32_t> tasks;
        for (std::uint32_t i = 0; i < top_.size(); ++i)
            if (top_[i].left == 0) tasks.push_back(i);
        for_each_range(tasks.size(), 1, [&](std::size_t begin, std::size_t end) {
            SubtreeBuild build(max_leaf_);
            for (std::size_t t = begin; t < end; ++t) {
                TopNode& task = top_[tasks[t]];
                task.sum =
                    build.run(lists_of(task), task.depth, s_.local.data(), out_of(task), task.node);
            }
        });
    }

    [[nodiscard]] SubtreeOut out_of(const TopNode& task) {
        return {s_.nodes.data() + 2 * std::size_t{task.begin}, s_.order.data() + task.begin};
    }

    /// Children stand behind their parents.
    void sum_up() {
        for (std::size_t i = top_.size(); i-- > 0;) {
            TopNode& at = top_[i];
            if (at.left == 0) continue;
            const TopNode &a = top_[at.left], &b = top_[at.left + 1];
            at.sum.inner = 1 + a.sum.inner + b.sum.inner;
            at.sum.references = a.sum.references + b.sum.references;
            at.sum.height = 1 + std::max(a.sum.height, b.sum.height);
            const Aabb box = unite({a.node.lo, a.node.hi}, {b.node.lo, b.node.hi});
            at.node = {box.lo, 0, box.hi, 0};
        }
    }

    /// Nodes in preorder: what tasks counted from 0 moves to its place.
    void place(Buffer<BvhNode>& nodes, Buffer<std::uint32_t>& order) {
        nodes.reset(2 * std::size_t{top_[0].sum.inner} + 2);
        order.reset(top_[0].sum.references);
        nodes[1] = {{0, 0, 0}, 0, {0, 0, 0}, 0};
        std::vector<std::uint32_t> tasks;
        for (std::uint32_t i = 0; i < top_.size(); ++i) {
            TopNode& at = top_[i];
            if (at.left == 0) {
                tasks.push_back(i);
                at.node.first += at.node.is_leaf() ? at.first : pair_slot(at.rank);
                continue;
            }
            at.node.first = pair_slot(at.rank);
            TopNode &a = top_[at.left], &b = top_[at.left + 1];
            a.rank = at.rank + 1;
            a.first = at.first;
            b.rank = a.rank + a.sum.inner;
            b.first = a.first + a.sum.references;
        }
        nodes[0] = top_[0].node;
        for (const TopNode& at : top_) {
            if (at.left == 0) continue;
            nodes[pair_slot(at.rank)] = top_[at.left].node;
            nodes[pair_slot(at.rank) + 1] = top_[at.left + 1].node;
        }
        for_each_index(
            tasks.size(), [&](std::size_t t) { place_task(top_[tasks[t]], nodes, order); }, 1);
    }

    void place_task(const TopNode& task, Buffer<BvhNode>& nodes, Buffer<std::uint32_t>& order) {
        const SubtreeOut out = out_of(task);
        BvhNode* to = nodes.data() + pair_slot(task.rank);
        for (std::size_t k = 0; k < 2 * std::size_t{task.sum.inner}; ++k) {
            to[k] = out.nodes[k];
            to[k].first += to[k].is_leaf() ? task.first : pair_slot(task.rank);
        }
        std::copy(out.order, out.order + task.sum.references, order.data() + task.first);
    }

    SahScratch& s_;
    std::uint32_t max_leaf_;
    std::vector<TopNode> top_;
};

}  // namespace

std::size_t SahScratch::capacity_bytes() const {
    std::size_t sum = references.capacity_bytes() + sides.capacity_bytes() +
                      local.capacity_bytes() + order.capacity_bytes() + nodes.capacity_bytes();
    for (std::size_t axis = 0; axis < 3; ++axis)
        sum += orders[axis].capacity_bytes() + spare_orders[axis].capacity_bytes();
    return sum;
}

std::uint32_t build_sah(SahScratch& scratch, std::uint32_t max_leaf, Buffer<BvhNode>& nodes,
                        Buffer<std::uint32_t>& order, std::uint32_t& max_depth) {
    return SahRun(scratch, max_leaf).run(nodes, order, max_depth);
}

}  // namespace raydix
