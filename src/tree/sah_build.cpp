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

/// References [begin, begin + count) of the orders, with room for `spare` more behind them, which
/// are to be made from the places [free_places, free_places + spare).
struct Side {
    std::uint32_t begin = 0, count = 0, spare = 0, free_places = 0;
};

/// A node above the tasks, or a task.
struct TopNode : Side {
    std::uint32_t depth = 0;
    bool in_spare = false;        // which orders
    std::uint32_t left = 0;       // its children are left and left + 1; 0: a task
    std::array<Side, 2> sides{};  // lower, upper; none: a task
    bool upper_is_left = false;
    SubtreeSum sum{};
    BvhNode node{};
    std::uint32_t rank = 0, first = 0;  // in the finished tree: of its own pair, of its references
};

class SahRun {
public:
    SahRun(const SahInput& input, SahScratch& scratch) : in_(input), s_(scratch) {}

    std::uint32_t run(Buffer<BvhNode>& nodes, Buffer<std::uint32_t>& order,
                      std::uint32_t& max_depth) {
        const std::size_t room = std::size_t{in_.references} + in_.spare;
        s_.sides.reset(room);
        if (in_.references > task_references)
            for (auto& spare : s_.spare_orders) spare.reset(room);
        if (in_.cutter != nullptr) rules_ = {in_.cutter, least_overlap * root_area()};
        TopNode root;
        static_cast<Side&>(root) = {0, in_.references, in_.spare, in_.references};
        top_.push_back(root);
        split_top();
        s_.local.reset(room);
        s_.order.reset(room);
        s_.nodes.reset(2 * room);
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
            at.count};
    }

    [[nodiscard]] float root_area() const {
        GrowingBox box;
        for (std::uint32_t k = 0; k < in_.references; ++k) box.add(s_.references[k]);
        return box.area();
    }

    /// Level by level; all nodes of a level at once.
    void split_top() {
        for (std::size_t first = 0; first < top_.size();) {
            const std::size_t last = top_.size();
            for_each_index(
                last - first, [&](std::size_t i) { split(top_[first + i]); }, 1);
            for (; first < last; ++first) {
                const TopNode at = top_[first];
                if (at.sides[0].count == 0) continue;
                top_[first].left = static_cast<std::uint32_t>(top_.size());
                for (const std::size_t side : {0, 1}) {
                    TopNode child;
                    static_cast<Side&>(child) = at.sides[at.upper_is_left ? 1 - side : side];
                    child.depth = at.depth + 1;
                    child.in_spare = at.in_spare;
                    top_.push_back(child);
                }
            }
        }
    }

    void split(TopNode& at) {
        if (at.count <= task_references) return;
        const SweepLists lists = lists_of(at);
        SweepSplit split;
        split.left = at.count / 2;
        if (at.depth < deepest_sah_split) {
            split = find_sweep_split_parallel(lists);
            SpatialSides sides;
            if (choose_spatial_split(rules_, lists.references, {lists.orders[split.axis], at.count},
                                     split, at.spare, sides))
                return split_by_plane(at, lists, split.axis, sides);
        }
        mark_sides(at, lists, split);
        make_sides(at, split.left, at.count - split.left);
        at.in_spare = !at.in_spare;
        for (std::size_t axis = 0; axis < 3; ++axis)
            divide(lists.orders[axis], at.count, orders_to(at, axis, 0), orders_to(at, axis, 1));
    }

    /// Room for what each side holds and may add, one behind the other.
    static void make_sides(TopNode& at, std::uint32_t lower, std::uint32_t upper) {
        const std::uint32_t used = lower + upper - at.count, spare = at.spare - used;
        const std::uint32_t spare_lower = share_of(spare, lower, lower + upper);
        at.sides[0] = {at.begin, lower, spare_lower, at.free_places + used};
        at.sides[1] = {at.begin + lower + spare_lower, upper, spare - spare_lower,
                       at.free_places + used + spare_lower};
    }
    [[nodiscard]] std::uint32_t* orders_to(const TopNode& at, std::size_t axis, std::size_t side) {
        return (at.in_spare ? s_.spare_orders : s_.orders)[axis].data() + at.sides[side].begin;
    }

    void split_by_plane(TopNode& at, const SweepLists& lists, std::uint32_t axis_of_sides,
                        const SpatialSides& sides) {
        SideLists side_lists;
        side_lists.cut(s_.references.data(), {lists.orders[axis_of_sides], at.count}, sides,
                       at.free_places, s_.sides.data());
        at.upper_is_left = side_lists.right_is_least();
        make_sides(at, sides.left_count, sides.right_count);
        at.in_spare = !at.in_spare;
        for (std::uint32_t axis = 0; axis < 3; ++axis)
            for (const auto side : {SpatialSides::left, SpatialSides::right})
                side_lists.list(lists.references, {lists.orders[axis], at.count}, s_.sides.data(),
                                side, axis, orders_to(at, axis, side));
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
            SubtreeBuild build(in_.max_leaf, rules_);
            for (std::size_t t = begin; t < end; ++t) {
                TopNode& task = top_[tasks[t]];
                task.sum = build.run(lists_of(task), task.spare, task.depth, s_.local.data(),
                                     out_of(task), task.node);
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

    const SahInput& in_;
    SahScratch& s_;
    SpatialRules rules_;
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

std::uint32_t build_sah(const SahInput& input, SahScratch& scratch, Buffer<BvhNode>& nodes,
                        Buffer<std::uint32_t>& order, std::uint32_t& max_depth) {
    return SahRun(input, scratch).run(nodes, order, max_depth);
}

}  // namespace raydix
