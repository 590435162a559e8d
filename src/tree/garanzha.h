// Garanzha, Pantaleoni and McAllister 2011, "Simpler and Faster HLBVH with Work Queues", its
// top-level SAH off: sorted keys [n] -> links of nodes and parent slots, level by level. A task is
// a node and its range of keys; the children of a level's tasks that must be split again are the
// tasks of the next one. Where the source hands out places in the next queue by a counter, they
// come from a prefix sum here: no thread waits for another, and the queue is in key order.
#pragma once

#include <cstdint>

#include "tree/lbvh_family.h"
#include "tree/lbvh_launches.h"

namespace raydix {

/// A task: keys [first, last], divided behind `split`. The slot of its node is parent_slot of its
/// rank, and its rank is its place in the queue: the queues of all levels lie one behind the other.
using Task = RadixRange;

/// Most tasks on one level: their ranges do not overlap, and each holds more than max_leaf keys.
[[nodiscard]] constexpr std::uint32_t garanzha_width(std::uint32_t n, std::uint32_t max_leaf) {
    return n / (max_leaf + 1);
}

struct GaranzhaScratch {
    Task* queue;                // [inner_node_limit]
    std::uint32_t* children;    // [level_limit + 1]: twice the tasks of a level
    std::uint32_t *even, *odd;  // [garanzha_width + 1], of the levels in turn: how many children of
                                // each task are tasks, then how many those of the tasks before it
    GaranzhaScratch(Arena& arena, std::uint32_t n, std::uint32_t max_leaf,
                    std::uint32_t level_limit)
        : queue(arena.take<Task>(inner_node_limit(n, max_leaf))),
          children(arena.take<std::uint32_t>(std::size_t{level_limit} + 1)),
          even(arena.take<std::uint32_t>(std::size_t{garanzha_width(n, max_leaf)} + 1)),
          odd(arena.take<std::uint32_t>(std::size_t{garanzha_width(n, max_leaf)} + 1)) {}

    [[nodiscard]] std::uint32_t* places(std::uint32_t level) const {
        return level % 2 == 0 ? even : odd;
    }
};

template <class Key, class Probe>
RAYDIX_HD Task make_task(const SortedKeys<Key, Probe>& keys, std::uint32_t first,
                         std::uint32_t last) {
    return {first, last, find_split(keys, first, last)};
}

/// How many children of a task must be split again.
RAYDIX_HD inline std::uint32_t tasks_below(const Task& task, std::uint32_t max_leaf) {
    return static_cast<std::uint32_t>(task.split - task.first >= max_leaf) +
           static_cast<std::uint32_t>(task.last - task.split > max_leaf);
}

/// The first task is the whole range; all other levels are empty. So is the first if all keys fit
/// into one leaf, which a GPU's host may not know.
template <class Key, class Probe>
struct StartQueue {
    const Key* sorted_keys;
    std::uint32_t key_count, max_leaf;
    GaranzhaScratch scratch;
    TreeLinks out;
    TreeLevels levels;
    RAYDIX_HD void operator()(std::uint32_t level) const {
        const std::uint32_t tasks = level == 0 && key_count > max_leaf ? 1 : 0;
        levels.count[level] = tasks;
        scratch.children[level] = 2 * tasks;
        if (tasks == 0) return;
        const SortedKeys<Key, Probe> keys{sorted_keys, key_count};
        const Task root = make_task(keys, 0, key_count - 1);
        levels.begin[0] = 0;
        scratch.queue[0] = root;
        scratch.even[0] = 0;
        scratch.even[1] = tasks_below(root, max_leaf);
        link_inner(out.nodes[0], 0);
        clear_padding(out.nodes);
        out.parent_slot[0] = 0;
    }
};

/// One child of a task of `level`: the left one of task t is 2 t, the right one 2 t + 1.
template <class Key, class Probe>
struct SplitTask {
    SortedKeys<Key, Probe> keys;
    std::uint32_t max_leaf;
    Task* queue;
    std::uint32_t* children;
    const std::uint32_t* places;  // [tasks + 1]
    std::uint32_t* next;          // [tasks of the next level], out
    TreeLinks out;
    TreeLevels levels;
    std::uint32_t level;

    RAYDIX_HD void operator()(std::uint32_t i) const {
        const std::uint32_t t = i / 2, begin = levels.begin[level], tasks = levels.count[level];
        const std::uint32_t end = begin + tasks;  // where the next level's queue begins
        const Task task = queue[begin + t];
        std::uint32_t place = places[t];
        Probe::bytes(sizeof(Task) + sizeof(place));
        Probe::step();
        const bool right = i % 2 != 0;
        const std::uint32_t first = right ? task.split + 1 : task.first;
        const std::uint32_t last = right ? task.last : task.split;
        const std::uint32_t slot = pair_slot(begin + t) + (right ? 1 : 0);
        if (last - first < max_leaf) {
            link_leaf(out.nodes[slot], first, last - first + 1);
        } else {
            if (right && task.split - task.first >= max_leaf) ++place;
            append(slot, end, place, make_task(keys, first, last));
        }
        Probe::bytes(link_bytes);
        if (i != 0) return;
        levels.begin[level + 1] = end;
        levels.count[level + 1] = places[tasks];
        children[level + 1] = 2 * places[tasks];
        *out.inner_count = end;  // the last level that has tasks has the last word
    }

private:
    RAYDIX_HD void append(std::uint32_t slot, std::uint32_t end, std::uint32_t place,
                          const Task& task) const {
        const std::uint32_t rank = end + place;
        link_inner(out.nodes[slot], rank);
        out.parent_slot[rank] = slot;
        queue[rank] = task;
        next[place] = tasks_below(task, max_leaf);
        Probe::bytes(2 * sizeof(std::uint32_t) + sizeof(Task));
    }
};

/// `levels` has room for lbvh_depth_bound levels and is filled: the levels of the tree, the nodes
/// of each in key order.
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
                    StartQueue<Key, Probe>{in.keys, in.count, in.max_leaf, scratch, out, levels});
    const std::uint32_t width = garanzha_width(in.count, in.max_leaf);
    for (std::uint32_t level = 0; level < levels.limit; ++level) {
        if (!launcher.maybe_any(levels.count + level)) break;
        if (level != 0)
            launcher.exclusive_scan_counted("garanzha.places", scratch.places(level),
                                            levels.count + level, level_size_limit(level, width));
        launcher.launch_counted(
            "garanzha.level", scratch.children + level, 2 * level_size_limit(level, width),
            SplitTask<Key, Probe>{keys, in.max_leaf, scratch.queue, scratch.children,
                                  scratch.places(level), scratch.places(level + 1), out, levels,
                                  level});
    }
}

}  // namespace raydix
