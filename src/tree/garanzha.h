// Garanzha, Pantaleoni and McAllister 2011, "Simpler and Faster HLBVH with Work Queues", its
// top-level SAH off: sorted keys [n] -> links of nodes and parent slots, level by level. A task is
// a node slot and its range of keys; the tasks of a level split their ranges and append those
// children that must be split again.
#pragma once

#include <cstdint>

#include "base/atomic.h"
#include "tree/lbvh_family.h"
#include "tree/lbvh_launches.h"

namespace raydix {

/// Keys [first, last] of a task. Its node's slot is parent_slot of its rank, and its rank is its
/// place in the queue: the queues of all levels lie one behind the other.
struct TaskRange {
    std::uint32_t first, last;
};

/// The first task is the whole range; all other levels are empty. So is the first if all keys fit
/// into one leaf, which a GPU's host may not know.
struct StartQueue {
    std::uint32_t key_count, max_leaf;
    TaskRange* queue;
    TreeLinks out;
    TreeLevels levels;
    RAYDIX_HD void operator()(std::uint32_t level) const {
        levels.count[level] = level == 0 && key_count > max_leaf ? 1 : 0;
        if (level != 0) return;
        levels.begin[0] = 0;
        queue[0] = {0, key_count - 1};
        link_inner(out.nodes[0], 0);
        clear_padding(out.nodes);
        out.parent_slot[0] = 0;
    }
};

/// One task of `level`.
template <class Key, class Probe>
struct SplitTask {
    SortedKeys<Key, Probe> keys;
    std::uint32_t max_leaf;
    TaskRange* queue;
    TreeLinks out;
    TreeLevels levels;
    std::uint32_t level;

    /// The last key that shares more with the first than the last one does.
    [[nodiscard]] RAYDIX_HD std::uint32_t find_split(TaskRange range) const {
        const int shared = keys.common_prefix(range.first, range.last);
        std::uint32_t low = range.first, high = range.last;
        while (high - low > 1) {
            const std::uint32_t middle = low + (high - low) / 2;
            if (keys.common_prefix(range.first, middle) > shared)
                low = middle;
            else
                high = middle;
        }
        return low;
    }

    RAYDIX_HD void child(std::uint32_t slot, TaskRange range, bool splits,
                         std::uint32_t rank) const {
        Probe::bytes(link_bytes);
        if (splits) {
            link_inner(out.nodes[slot], rank);
            out.parent_slot[rank] = slot;
            queue[rank] = range;
            Probe::bytes(sizeof(std::uint32_t) + sizeof(TaskRange));
        } else {
            link_leaf(out.nodes[slot], range.first, range.last - range.first + 1);
        }
    }

    RAYDIX_HD void operator()(std::uint32_t i) const {
        const std::uint32_t begin = levels.begin[level], end = begin + levels.count[level];
        const std::uint32_t rank = begin + i;
        const TaskRange range = queue[rank];
        Probe::bytes(sizeof(TaskRange));
        Probe::step();
        const std::uint32_t split = find_split(range);
        const TaskRange left{range.first, split}, right{split + 1, range.last};
        const bool split_left = left.last - left.first >= max_leaf;
        const bool split_right = right.last - right.first >= max_leaf;
        const auto more = static_cast<std::uint32_t>(split_left) + split_right;
        std::uint32_t place = end;  // the next level's queue begins where this one ends
        if (more != 0) {
            place += claim(levels.count[level + 1], more);
            Probe::bytes(sizeof(std::uint32_t));
            Probe::step();
        }
        child(pair_slot(rank), left, split_left, place);
        child(pair_slot(rank) + 1, right, split_right, place + split_left);
        if (i == 0) {
            levels.begin[level + 1] = end;
            *out.inner_count = end;  // the last level that has tasks has the last word
        }
    }
};

struct GaranzhaScratch {
    TaskRange* queue;  // [inner_node_limit]
    GaranzhaScratch(Arena& arena, std::uint32_t n, std::uint32_t max_leaf)
        : queue(arena.take<TaskRange>(inner_node_limit(n, max_leaf))) {}
};

/// `levels` has room for lbvh_depth_bound levels and is filled: the levels of the tree. Ranks
/// within a level depend on the order in which tasks run.
template <class Launcher, class Key>
void launch_garanzha(Launcher& launcher, const LbvhInput<Key>& in, const GaranzhaScratch& scratch,
                     const TreeLinks& out, const TreeLevels& levels) {
    using Probe = typename Launcher::Probe;
    if (in.count <= in.max_leaf) {
        launcher.launch("garanzha.only_leaf", 1, EmitOnlyLeaf{in.count, out});
        return;
    }
    const SortedKeys<Key, Probe> keys{in.keys, in.count};
    launcher.launch("garanzha.start", levels.limit + 1,
                    StartQueue{in.count, in.max_leaf, scratch.queue, out, levels});
    const std::uint32_t limit = inner_node_limit(in.count, in.max_leaf);
    for (std::uint32_t level = 0; level < levels.limit; ++level) {
        if (!launcher.maybe_any(levels.count + level)) break;
        launcher.launch_counted(
            "garanzha.level", levels.count + level, level_size_limit(level, limit),
            SplitTask<Key, Probe>{keys, in.max_leaf, scratch.queue, out, levels, level});
    }
}

}  // namespace raydix
