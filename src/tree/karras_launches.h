// Karras 2012 as launches, for any backend: sorted keys [n] -> links of nodes and parent slots. One
// work item per radix node in each of two launches, a prefix sum between them, and no node waits
// for another (section 3). karras.cpp has the same for one machine only, with bytes in place of
// keys.
#pragma once

#include <cstdint>

#include "tree/climb_warps.h"
#include "tree/device_key_count.h"
#include "tree/lbvh_launches.h"

namespace raydix {

/// Which radix nodes hold more than max_leaf keys. Node i covers keys from i on in the direction of
/// the neighbour that it shares more with, as far as they share more with it than the neighbour on
/// the other side does.
template <class Key, class Probe>
struct MarkKeptNode {
    SortedKeys<Key, Probe> keys;
    std::uint32_t max_leaf;
    std::uint32_t* kept;  // [n], out: 1 for those; 0 for the place behind the last node

    RAYDIX_HD void operator()(std::uint32_t node) const {
        Probe::bytes(sizeof(std::uint32_t));
        const std::int64_t i = node;
        if (node + 1 == keys.count) {
            kept[node] = 0;
            return;
        }
        const int before = keys.common_prefix(i, i - 1), behind = keys.common_prefix(i, i + 1);
        const int outside = behind > before ? before : behind;  // delta_min in the paper
        const std::int64_t reach = max_leaf;
        const std::int64_t other = behind > before ? i + reach : i - reach;
        kept[node] = keys.common_prefix(i, other) > outside ? 1 : 0;
    }
};

/// Ranks of radix nodes out of the prefix sum.
struct ScannedRanks {
    const std::uint32_t* before;  // [n]: kept nodes before each
    [[nodiscard]] RAYDIX_HD std::uint32_t rank(std::uint32_t node) const { return before[node]; }
    [[nodiscard]] RAYDIX_HD bool kept(std::uint32_t node) const {
        return before[node + 1] != before[node];
    }
};

/// Finds the range of a kept node and links its children.
template <class Key, class Probe>
struct EmitKeptNode {
    SortedKeys<Key, Probe> keys;
    EmitRadixNode<ScannedRanks, Probe> emit;

    RAYDIX_HD void operator()(std::uint32_t node) const {
        Probe::bytes(2 * sizeof(std::uint32_t));
        Probe::step();
        if (node == 0) {
            link_inner(emit.nodes[0], 0);
            clear_padding(emit.nodes);
            emit.parent_slot[0] = 0;
        }
        if (emit.kept.kept(node)) emit(emit.kept.rank(node), find_range(keys, node));
    }
};

struct KarrasScratch {
    std::uint32_t* kept;  // [n]: flags, then ranks
    KarrasScratch(Arena& arena, std::uint32_t n) : kept(arena.take<std::uint32_t>(n)) {}
};

template <class Launcher, class Key>
void launch_karras(Launcher& launcher, const LbvhInput<Key>& in, const KarrasScratch& scratch,
                   const TreeLinks& out) {
    using Probe = typename Launcher::Probe;
    if (in.count <= in.max_leaf) {
        launcher.launch("karras.only_leaf", 1, EmitOnlyLeaf{in.count, out});
        return;
    }
    const SortedKeys<Key, Probe> keys{in.keys, in.count};
    launcher.launch("karras.mark", in.count,
                    MarkKeptNode<Key, Probe>{keys, in.max_leaf, scratch.kept});
    launcher.exclusive_scan("karras.rank", scratch.kept, in.count, out.inner_count);
    launcher.launch(
        "karras.emit", in.count - 1,
        EmitKeptNode<Key, Probe>{keys, {{scratch.kept}, in.max_leaf, out.nodes, out.parent_slot}});
}

/// MarkKeptNode where boxes are fitted by ClimbWarps.
template <class Key>
struct MarkKeptSlot {
    const Key* keys;
    std::uint32_t max_leaf;
    std::uint32_t* kept;  // [n], out
    ParentSlots slots;

    RAYDIX_HD void operator()(std::uint32_t node) const {
        slots.of_leaf[node] = ParentSlots::no_leaf;
        MarkKeptNode<Key, NoProbe>{{keys, *slots.key_count}, max_leaf, kept}(node);
    }
};

/// EmitKeptNode where ClimbWarps writes the nodes: finds the range of a kept node, and tells its
/// children where they belong.
template <class Key>
struct EmitKeptSlots {
    const Key* keys;
    std::uint32_t max_leaf;
    ParentSlots slots;
    std::uint32_t* inner_count;  // [1], out where all are kept

    RAYDIX_HD void child(std::uint32_t slot, std::uint32_t first, std::uint32_t last,
                         std::uint32_t radix_node) const {
        const std::uint32_t count = last - first + 1;
        if (count > max_leaf) {
            slots.of_inner[slots.kept_before(radix_node)] = slot;
            return;
        }
        slots.of_leaf[first] = slot;
        if (slots.kept != nullptr) slots.leaf_count[first] = static_cast<std::uint8_t>(count);
    }
    RAYDIX_HD void operator()(std::uint32_t node) const {
        const SortedKeys<Key> sorted{keys, *slots.key_count};
        if (node == 0) {
            slots.of_inner[0] = 0;
            if (slots.kept == nullptr) *inner_count = sorted.count - 1;
        }
        const std::uint32_t rank = slots.kept_before(node);
        if (slots.kept != nullptr && slots.kept[node + 1] == rank) return;
        slots.meeting[rank] = 0;
        const RadixRange range = find_range(sorted, node);
        child(pair_slot(rank), range.first, range.split, range.split);
        child(pair_slot(rank) + 1, range.split + 1, range.last, range.split + 1);
    }
};

/// Karras 2012 for a fit by ClimbWarps: more than max_leaf keys -> slots of parents. Where every
/// key is a leaf nothing is marked or counted, and slots.kept is null.
template <class Launcher, class Key>
void launch_karras_slots(Launcher& launcher, const LbvhInput<Key>& in, const KeyCounts* counts,
                         const ParentSlots& slots, std::uint32_t* kept,
                         std::uint32_t* inner_count) {
    CountedKeys<Launcher> counted(launcher, in.count, counts);
    if (in.max_leaf > 1) {
        launcher.launch_counted("karras.mark", counted.exact(), in.count,
                                MarkKeptSlot<Key>{in.keys, in.max_leaf, kept, slots});
        counted.exclusive_scan("karras.rank", kept, in.count, inner_count);
    }
    launcher.launch_counted("karras.emit", counted.pairs(), in.count - 1,
                            EmitKeptSlots<Key>{in.keys, in.max_leaf, slots, inner_count});
}

}  // namespace raydix
