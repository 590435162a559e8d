#include "tree/sah_build.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "exec/parallel.h"
#include "tree/sah_subtree.h"

namespace raydix {
namespace {

/// Subtrees of up to this many references are built by one thread each. Above the largest leaf, so
/// that no node above them becomes one.
constexpr std::uint32_t task_references = 8192;
static_assert(task_references > 255);
constexpr std::uint32_t block_references = 4096;

/// References [begin, begin + count) of the orders of a node above the tasks, or of a task.
struct TopList {
    std::uint32_t begin = 0, count = 0, depth = 0;
    bool in_spare = false;    // which orders
    std::uint32_t lower = 0;  // how many go to the lower side; 0: a task
    bool upper_is_left = false;
};

class SahRun {
public:
    SahRun(const SahInput& input, SahScratch& scratch) : in_(input), s_(scratch) {}

    std::uint32_t run(Buffer<BvhNode>& nodes, Buffer<std::uint32_t>& order,
                      std::uint32_t& max_depth) {
        const std::size_t n = in_.references;
        s_.sides.reset(n);
        if (n > task_references)
            for (auto& spare : s_.spare_orders) spare.reset(n);
        top_.push_back({});
        lists_.push_back({0, in_.references});
        split_top();
        s_.local.reset(n);
        s_.subtrees.reset(n);
        build_tasks();
        place_subtrees(top_, s_.subtrees, nodes, order);
        max_depth = top_[0].sum.height;
        return top_[0].sum.inner;
    }

private:
    [[nodiscard]] SweepLists lists_of(const TopList& at) {
        auto& orders = at.in_spare ? s_.spare_orders : s_.orders;
        return {
            s_.references.data(),
            {orders[0].data() + at.begin, orders[1].data() + at.begin, orders[2].data() + at.begin},
            at.count};
    }

    /// Level by level; all nodes of a level at once.
    void split_top() {
        for (std::size_t first = 0; first < top_.size();) {
            const std::size_t last = top_.size();
            for_each_index(
                last - first, [&](std::size_t i) { split(lists_[first + i]); }, 1);
            for (; first < last; ++first) {
                const TopList at = lists_[first];
                if (at.lower == 0) continue;
                top_[first].left = static_cast<std::uint32_t>(top_.size());
                std::array<TopList, 2> sides;
                sides[0] = {at.begin, at.lower, at.depth + 1, at.in_spare};
                sides[1] = {at.begin + at.lower, at.count - at.lower, at.depth + 1, at.in_spare};
                if (at.upper_is_left) std::swap(sides[0], sides[1]);
                for (const TopList& side : sides) {
                    SahTopNode node;
                    node.begin = side.begin;
                    top_.push_back(node);
                    lists_.push_back(side);
                }
            }
        }
    }

    void split(TopList& at) {
        if (at.count <= task_references) return;
        const SweepLists lists = lists_of(at);
        SweepSplit split;
        split.left = at.count / 2;
        if (at.depth < deepest_sah_split) split = find_sweep_split_parallel(lists);
        mark_sides(at, lists, split);
        at.lower = split.left;
        at.in_spare = !at.in_spare;
        auto& orders = at.in_spare ? s_.spare_orders : s_.orders;
        for (std::size_t axis = 0; axis < 3; ++axis) {
            std::uint32_t* to = orders[axis].data() + at.begin;
            divide(lists.orders[axis], at.count, to, to + split.left);
        }
    }

    /// Side of each reference, and which side holds the smallest id; both: the lower one.
    void mark_sides(TopList& at, const SweepLists& lists, const SweepSplit& split) {
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
    void divide(const std::uint32_t* from, std::uint32_t n, std::uint32_t* to_lower,
                std::uint32_t* to_upper) {
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
            const std::size_t uppers = begin - lower[b];
            std::array<std::uint32_t*, 2> to{to_lower + lower[b], to_upper + uppers};
            for (std::size_t k = begin; k < end; ++k) *to[s_.sides[from[k]]]++ = from[k];
        });
    }

    void build_tasks() {
        std::vector<std::uint32_t> tasks;
        for (std::uint32_t i = 0; i < top_.size(); ++i)
            if (top_[i].left == 0) tasks.push_back(i);
        for_each_range(tasks.size(), 1, [&](std::size_t begin, std::size_t end) {
            SubtreeBuild build(in_.max_leaf);
            for (std::size_t t = begin; t < end; ++t) {
                SahTopNode& task = top_[tasks[t]];
                const TopList& list = lists_[tasks[t]];
                task.sum = build.run(lists_of(list), list.depth, s_.local.data(),
                                     s_.subtrees.of(task), task.node);
            }
        });
    }

    const SahInput& in_;
    SahScratch& s_;
    std::vector<SahTopNode> top_;
    std::vector<TopList> lists_;  // of top_
};

}  // namespace

std::size_t SahScratch::capacity_bytes() const {
    std::size_t sum = references.capacity_bytes() + sides.capacity_bytes() +
                      local.capacity_bytes() + subtrees.capacity_bytes();
    for (std::size_t axis = 0; axis < 3; ++axis)
        sum += orders[axis].capacity_bytes() + spare_orders[axis].capacity_bytes();
    return sum;
}

std::uint32_t build_sah(const SahInput& input, SahScratch& scratch, Buffer<BvhNode>& nodes,
                        Buffer<std::uint32_t>& order, std::uint32_t& max_depth) {
    return SahRun(input, scratch).run(nodes, order, max_depth);
}

}  // namespace raydix
