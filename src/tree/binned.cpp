#include "tree/binned.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <vector>

#include "base/math.h"
#include "exec/parallel.h"
#include "tree/small_splits.h"

namespace raydix {
namespace {

/// Most primitives in a run.
constexpr std::size_t run_primitives = 16;
/// Runs do not cross multiples of this many places, so that blocks are cut at once.
constexpr std::size_t run_block = 1024;
static_assert(run_primitives <= 255, "lengths are bytes");
/// Subtrees of up to this many primitives are built over primitives, each by one thread: two
/// lists of them stay in a cache.
constexpr std::uint32_t task_primitives = 32768;
/// Deeper nodes are divided in the middle of their list, so that no stack overflows.
constexpr std::uint32_t deepest_split = 96;

/// Calls take(begin, end) for the runs of keys [begin, end), in order: halves of the radix tree
/// until they are small enough.
template <class Key, class Take>
void cut_runs(const Key* keys, std::size_t begin, std::size_t end, const Take& take) {
    while (end - begin > run_primitives) {
        std::size_t middle = begin + (end - begin) / 2;
        if (const Key differ = keys[begin] ^ keys[end - 1]; differ != 0) {
            const Key bit = std::bit_floor(differ);
            middle = static_cast<std::size_t>(
                std::partition_point(keys + begin, keys + end,
                                     [bit](Key key) { return (key & bit) == 0; }) -
                keys);
        }
        cut_runs(keys, begin, middle, take);
        begin = middle;
    }
    take(begin, end);
}

/// A subtree that is built by one thread, over lists that fit into a cache.
class SubtreeBuild {
public:
    SubtreeBuild(std::span<const std::uint32_t> ids, std::uint32_t max_leaf, ClusterNode* nodes,
                 int width)
        : ids_(ids), max_leaf_(max_leaf), nodes_(nodes), width_(width) {}

    /// `node_base` is the subtree's first place in the list of all primitives of the tree: a node
    /// whose left side ends there at m is node m - 1.
    ClusterPart run(std::span<SplitBox> list, SplitBox* spare, std::uint32_t node_base,
                    std::uint32_t depth) {
        if (list.size() <= small_boxes) return run_small(list, node_base);
        SplitBox* from = list.data();
        std::size_t left = list.size() / 2;
        if (depth < deepest_split) {
            const BinGrid grid(list);
            const bool wide = width_ >= 8;
            if (const auto split = find_split(list, grid, wide)) {
                divide_boxes(list, grid, *split, spare, split->left_boxes, wide);
                std::swap(from, spare);
                left = split->left_boxes;
            }
        }
        const auto middle = node_base + static_cast<std::uint32_t>(left);
        const ClusterPart a = run({from, left}, spare, node_base, depth + 1);
        const ClusterPart b =
            run({from + left, list.size() - left}, spare + left, middle, depth + 1);
        const ClusterNode& node = nodes_[middle - 1] = merge_clusters(a, b, max_leaf_);
        return {middle - 1, {node.lo, node.hi}, node.sum};
    }

private:
    ClusterPart run_small(std::span<const SplitBox> list, std::uint32_t node_base) {
        for (std::size_t k = 0; k < list.size(); ++k) {
            small_.set(k, list[k]);
            firsts_[k] = list[k].first;
        }
        return small_node((1u << list.size()) - 1, node_base);
    }

    ClusterPart small_node(LaneSet set, std::uint32_t node_base) {
        const int count = std::popcount(set);
        if (count == 1) return small_primitive(static_cast<std::size_t>(std::countr_zero(set)));
        const LaneSet left = count == 2 ? set & (0u - set) : split_small(small_, set, width_);
        const auto middle = node_base + static_cast<std::uint32_t>(std::popcount(left));
        const ClusterPart a = small_node(left, node_base);
        const ClusterPart b = small_node(set & ~left, middle);
        const ClusterNode& node = nodes_[middle - 1] = merge_clusters(a, b, max_leaf_);
        return {middle - 1, {node.lo, node.hi}, node.sum};
    }

    [[nodiscard]] ClusterPart small_primitive(std::size_t lane) const {
        const auto& at = small_.at;
        const Aabb bounds{{at[0][lane], at[1][lane], at[2][lane]},
                          {-at[3][lane], -at[4][lane], -at[5][lane]}};
        const std::uint32_t first = firsts_[lane];
        return {primitive_cluster | first, bounds, sum_of_primitive(ids_[first], bounds)};
    }

    std::span<const std::uint32_t> ids_;
    std::uint32_t max_leaf_;
    ClusterNode* nodes_;
    int width_;
    SmallBoxes small_{};
    std::array<std::uint32_t, small_boxes> firsts_{};
};

/// A node above the tasks, or a task, over runs [begin, end) of a list.
struct TopNode {
    std::uint32_t begin, end, base, primitives;  // base: primitives before it
    std::uint32_t depth;
    bool in_spare;           // which list
    std::uint32_t left = 0;  // its children are left and left + 1; 0: a task
    std::uint32_t left_runs = 0, left_primitives = 0;
    ClusterPart part{};
};

template <class Key>
class BinnedRun {
public:
    BinnedRun(std::span<const Key> keys, std::span<const std::uint32_t> ids, const BoxLanes& boxes,
              std::uint32_t max_leaf, Buffer<ClusterNode>& nodes, BinnedScratch& scratch, int width)
        : keys_(keys),
          ids_(ids),
          boxes_(boxes),
          max_leaf_(max_leaf),
          nodes_(nodes),
          scratch_(scratch),
          width_(width) {}

    ClusterRef run() {
        nodes_.reset(keys_.size() - 1);
        const std::uint32_t runs = make_runs();
        std::vector<TopNode> top{{0, runs, 0, static_cast<std::uint32_t>(keys_.size()), 0, false}};
        split_top(top);
        build_tasks(top);
        // Children stand behind their parents.
        for (std::size_t i = top.size(); i-- > 0;) {
            TopNode& at = top[i];
            if (at.left == 0) continue;
            const std::uint32_t node_index = top[at.left + 1].base - 1;
            const ClusterNode& node = nodes_[node_index] =
                merge_clusters(top[at.left].part, top[at.left + 1].part, max_leaf_);
            at.part = {node_index, {node.lo, node.hi}, node.sum};
        }
        return top[0].part.ref;
    }

private:
    std::uint32_t make_runs() {
        const std::size_t n = keys_.size(), blocks = (n + run_block - 1) / run_block;
        Buffer<std::uint32_t>& counts = scratch_.run_counts;
        counts.reset(blocks);
        scratch_.run_lengths.reset(n);
        std::uint8_t* lengths = scratch_.run_lengths.data();  // a block's runs at its first places
        for_each_block(n, run_block, [&](std::size_t b, std::size_t begin, std::size_t end) {
            std::uint8_t* out = lengths + begin;
            cut_runs(keys_.data(), begin, end, [&](std::size_t first, std::size_t last) {
                *out++ = static_cast<std::uint8_t>(last - first);
            });
            counts[b] = static_cast<std::uint32_t>(out - (lengths + begin));
        });
        std::uint32_t before = 0;
        for (std::size_t b = 0; b < blocks; ++b) {
            const std::uint32_t own = counts[b];
            counts[b] = before;
            before += own;
        }
        scratch_.runs.reset(before);
        scratch_.spare.reset(before);
        for_each_block(n, run_block, [&](std::size_t b, std::size_t begin, std::size_t end) {
            SplitBox* out = scratch_.runs.data() + counts[b];
            const std::uint8_t* length = lengths + begin;
            for (std::size_t first = begin; first < end; first += *length++) {
                Aabb box = empty_box();
                for (std::size_t k = first; k < first + *length; ++k)
                    box = unite(box, boxes_.get(static_cast<std::uint32_t>(k)));
                *out++ = SplitBox::of(box, static_cast<std::uint32_t>(first), *length);
            }
        });
        return before;
    }

    [[nodiscard]] SplitBox* list_of(const TopNode& node) {
        return (node.in_spare ? scratch_.spare : scratch_.runs).data() + node.begin;
    }

    /// Level by level; all nodes of a level at once.
    void split_top(std::vector<TopNode>& top) {
        for (std::size_t first = 0; first < top.size();) {
            const std::size_t last = top.size();
            for_each_index(
                last - first, [&](std::size_t i) { split(top[first + i]); }, 1);
            for (; first < last; ++first) {
                const TopNode at = top[first];
                if (at.left_runs == 0) continue;
                top[first].left = static_cast<std::uint32_t>(top.size());
                const std::uint32_t middle = at.begin + at.left_runs;
                top.push_back(
                    {at.begin, middle, at.base, at.left_primitives, at.depth + 1, at.in_spare});
                top.push_back({middle, at.end, at.base + at.left_primitives,
                               at.primitives - at.left_primitives, at.depth + 1, at.in_spare});
            }
        }
    }

    void split(TopNode& at) {
        if (at.primitives <= task_primitives) return;
        const std::span<const SplitBox> list(list_of(at), at.end - at.begin);
        const BinGrid grid(list);
        const bool wide = width_ >= 8;
        const auto split = at.depth < deepest_split ? find_split(list, grid, wide) : std::nullopt;
        if (split) {
            at.in_spare = !at.in_spare;
            divide_boxes(list, grid, *split, list_of(at), split->left_boxes, wide);
            at.left_runs = split->left_boxes;
            at.left_primitives = split->left_primitives;
        } else {
            at.left_runs = static_cast<std::uint32_t>(list.size() / 2);
            for (std::uint32_t k = 0; k < at.left_runs; ++k) at.left_primitives += list[k].count;
        }
    }

    /// The longest tasks first, each by whichever worker comes next.
    void build_tasks(std::vector<TopNode>& top) {
        std::vector<std::uint32_t> tasks;
        for (std::uint32_t i = 0; i < top.size(); ++i)
            if (top[i].left == 0) tasks.push_back(i);
        std::sort(tasks.begin(), tasks.end(), [&](std::uint32_t a, std::uint32_t b) {
            return top[a].primitives > top[b].primitives;
        });
        const std::size_t longest = top[tasks.front()].primitives;
        const std::size_t workers =
            std::min(tasks.size(), static_cast<std::size_t>(std::max(thread_count(), 1)));
        scratch_.lists.reset(2 * longest * workers);
        std::atomic<std::size_t> next = 0;
        const auto work = [&](std::size_t worker) {
            SplitBox* list = scratch_.lists.data() + 2 * longest * worker;
            SplitBox* spare = list + longest;
            SubtreeBuild build(ids_, max_leaf_, nodes_.data(), width_);
            for (std::size_t t = next++; t < tasks.size(); t = next++) {
                TopNode& task = top[tasks[t]];
                list_primitives(task, list);
                task.part = build.run({list, task.primitives}, spare, task.base, task.depth);
            }
        };
        for_each_index(workers, work, 1);
    }

    void list_primitives(const TopNode& task, SplitBox* out) {
        const SplitBox* runs = list_of(task);
        for (std::uint32_t r = 0; r < task.end - task.begin; ++r)
            for (std::uint32_t k = 0; k < runs[r].count; ++k) {
                const std::uint32_t place = runs[r].first + k;
                const Aabb box = boxes_.get(place);
                *out++ = SplitBox::of(box, place, 1);
            }
    }

    std::span<const Key> keys_;
    std::span<const std::uint32_t> ids_;
    const BoxLanes& boxes_;
    std::uint32_t max_leaf_;
    Buffer<ClusterNode>& nodes_;
    BinnedScratch& scratch_;
    int width_;
};

}  // namespace

template <class Key>
ClusterRef build_binned(std::span<const Key> keys, std::span<const std::uint32_t> ids,
                        const BoxLanes& boxes, std::uint32_t max_leaf, Buffer<ClusterNode>& nodes,
                        BinnedScratch& scratch, int width) {
    return BinnedRun<Key>(keys, ids, boxes, max_leaf, nodes, scratch, width).run();
}

template ClusterRef build_binned(std::span<const std::uint32_t>, std::span<const std::uint32_t>,
                                 const BoxLanes&, std::uint32_t, Buffer<ClusterNode>&,
                                 BinnedScratch&, int);
template ClusterRef build_binned(std::span<const std::uint64_t>, std::span<const std::uint32_t>,
                                 const BoxLanes&, std::uint32_t, Buffer<ClusterNode>&,
                                 BinnedScratch&, int);

}  // namespace raydix
