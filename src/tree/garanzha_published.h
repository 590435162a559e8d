// Garanzha 2011 with the counter of its source, beside ours in garanzha.h: a task finds its split
// and takes places for its children in the next queue from one counter a level. Ranks within a
// level are in the order of arrival; the tree is the same.
#pragma once

#include <cstdint>

#include "base/atomic.h"
#include "tree/lbvh_launches.h"

namespace raydix {

struct QueuedRange {
    std::uint32_t first, last;  // keys
};

struct GaranzhaQueueScratch {
    QueuedRange* queue;  // [inner_node_limit]
    GaranzhaQueueScratch(Arena& arena, std::uint32_t n, std::uint32_t max_leaf)
        : queue(arena.take<QueuedRange>(inner_node_limit(n, max_leaf))) {}
};

/// The first task is the whole range; all other levels are empty.
struct StartCountedQueue {
    std::uint32_t key_count;
    QueuedRange* queue;
    TreeLinks out;
    TreeLevels levels;
    RAYDIX_HD void operator()(std::uint32_t level) const {
        levels.count[level] = level == 0 ? 1 : 0;
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
struct SplitQueuedTask {
    SortedKeys<Key, Probe> keys;
    std::uint32_t max_leaf;
    QueuedRange* queue;
    TreeLinks out;
    TreeLevels levels;
    std::uint32_t level;

    RAYDIX_HD void operator()(std::uint32_t i) const {
        const std::uint32_t begin = levels.begin[level], end = begin + levels.count[level];
        const std::uint32_t rank = begin + i;
        const QueuedRange range = queue[rank];
        Probe::bytes(sizeof(QueuedRange));
        Probe::step();
        const std::uint32_t split = find_split(keys, range.first, range.last);
        const bool split_left = split - range.first >= max_leaf;
        const bool split_right = range.last - split > max_leaf;
        const auto more = static_cast<std::uint32_t>(split_left) + split_right;
        std::uint32_t place = end;  // the next level's queue begins where this one ends
        if (more != 0) {
            place += claim(levels.count[level + 1], more);
            Probe::bytes(sizeof(std::uint32_t));
            Probe::step();
        }
        child(pair_slot(rank), {range.first, split}, split_left, place);
        child(pair_slot(rank) + 1, {split + 1, range.last}, split_right, place + split_left);
        if (i != 0) return;
        levels.begin[level + 1] = end;
        *out.inner_count = end;  // the last level that has tasks has the last word
    }

private:
    RAYDIX_HD void child(std::uint32_t slot, QueuedRange range, bool splits,
                         std::uint32_t rank) const {
        Probe::bytes(link_bytes);
        if (!splits) {
            link_leaf(out.nodes[slot], range.first, range.last - range.first + 1);
            return;
        }
        link_inner(out.nodes[slot], rank);
        out.parent_slot[rank] = slot;
        queue[rank] = range;
        Probe::bytes(sizeof(std::uint32_t) + sizeof(QueuedRange));
    }
};

/// in.count > in.max_leaf. `levels` has room for lbvh_depth_bound levels and is filled.
template <class Launcher, class Key>
void launch_garanzha_published(Launcher& launcher, const LbvhInput<Key>& in,
                               const GaranzhaQueueScratch& scratch, const TreeLinks& out,
                               const TreeLevels& levels) {
    using Probe = typename Launcher::Probe;
    launcher.launch("garanzha.start", levels.limit + 1,
                    StartCountedQueue{in.count, scratch.queue, out, levels});
    const std::uint32_t limit = inner_node_limit(in.count, in.max_leaf);
    for (std::uint32_t level = 0; level < levels.limit; ++level) {
        if (!launcher.maybe_any(levels.count + level)) break;
        launcher.launch_counted(
            "garanzha.queue", levels.count + level, level_size_limit(level, limit),
            SplitQueuedTask<Key, Probe>{
                {in.keys, in.count}, in.max_leaf, scratch.queue, out, levels, level});
    }
}

}  // namespace raydix
