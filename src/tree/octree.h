// Sorted Morton codes [n] -> octree nodes in level order (Karras 2012, section 5). No recursion and
// no insertion:
//   mark, compact     the codes, cut to max_level and without duplicates
//   radix             the binary radix tree over them, each inner node found by itself
//   count             a radix node whose prefix reaches levels that its parent's does not is a
//   chain of octree
//                     nodes: floor(delta / 3) - floor(delta(parent) / 3), fewer where max_leaf
//                     stops
//   scan              where each chain is written
//   chains, by_level  a stable sort by level gives the final numbers
//   fill, parents, children   the nodes
// Counts stay in the launcher's memory, that of the points as well. `count_octree` ends with the
// number of nodes, so that the caller can make room; `emit_octree` writes them.
#pragma once

#include <raydix/octree.h>

#include <cstdint>

#include "base/hd.h"
#include "base/probe.h"
#include "exec/arena.h"
#include "exec/host_launcher.h"
#include "keys/morton.h"
#include "tree/radix_tree.h"

namespace raydix {

/// When a node is divided.
struct OctreeRule {
    int max_level;
    std::uint32_t max_leaf;
};

/// First and last unique code below an inner radix node.
struct CodeRange {
    std::uint32_t first, last;
};

/// The radix tree over the unique codes, and the chains of its nodes. Its nodes have slots: leaf p
/// is 2p, inner node i is 2i + 1. A node's slot lies within its range of codes, so of two that do
/// not overlap the left one has the lower slot, and chains in slot order are in code order on every
/// level.
template <class Key, class Probe = NoProbe>
struct RadixChains {
    static constexpr int key_levels = CodeFormat<Key>::axis_bits;

    Key* codes;              // [n], unique ones first; bits below max_level are 0
    std::uint32_t* starts;   // [n + 1] the first point of each unique code, then their number
    std::uint32_t* parents;  // [2n] slot -> inner radix node, no_node for the root
    CodeRange* ranges;       // [n] inner node -> its codes
    std::uint8_t* levels;    // [n] inner node -> floor(delta / 3)
    std::uint32_t*
        offsets;  // [2n] slot -> its first place among all chains, or their lengths before the scan
    std::uint32_t* unique_count;  // [1]
    std::uint32_t* node_count;    // [1]
    OctreeRule rule;

    [[nodiscard]] RAYDIX_HD bool is_radix_node(std::uint32_t slot) const {
        return slot / 2 + slot % 2 < *unique_count;
    }
    [[nodiscard]] RAYDIX_HD CodeRange codes_of(std::uint32_t slot) const {
        if (slot % 2 == 0) return {slot / 2, slot / 2};
        Probe::bytes(sizeof(CodeRange));
        return ranges[slot / 2];
    }
    [[nodiscard]] RAYDIX_HD std::uint32_t point_count(std::uint32_t slot) const {
        const CodeRange range = codes_of(slot);
        Probe::bytes(2 * sizeof(std::uint32_t));
        return starts[range.last + 1] - starts[range.first];
    }
    /// The deepest level whose cells hold all of the node's codes together.
    [[nodiscard]] RAYDIX_HD int level(std::uint32_t slot) const {
        if (slot % 2 == 0) return rule.max_level;
        Probe::bytes(1);
        return levels[slot / 2];
    }
    /// The slot of the parent, no_node for the root's.
    [[nodiscard]] RAYDIX_HD std::uint32_t parent_slot(std::uint32_t slot) const {
        Probe::bytes(sizeof(std::uint32_t));
        Probe::step();
        const std::uint32_t parent = parents[slot];
        return parent == no_node ? no_node : 2 * parent + 1;
    }
    /// Where the chain of a node begins if it has one. The root's begins at level 0: one node more.
    [[nodiscard]] RAYDIX_HD int first_level(std::uint32_t slot) const {
        const std::uint32_t parent = parent_slot(slot);
        return parent == no_node ? 0 : level(parent) + 1;
    }
    /// The nearest ancestor that has a chain; its last node is the parent of this one's first.
    /// Within one level there are three bits, so the climb is at most three steps. Not for the
    /// root.
    [[nodiscard]] RAYDIX_HD std::uint32_t chain_above(std::uint32_t slot) const {
        std::uint32_t above = parent_slot(slot);
        while (first_level(above) > level(above)) above = parent_slot(above);
        return above;
    }
};

/// 1 for the first point of each code that differs above the cut.
template <class Key, class Probe>
struct MarkUniqueCodes {
    const Key* sorted_codes;  // [n]
    Key kept_bits;
    std::uint32_t* marks;  // [n]

    RAYDIX_HD void operator()(std::uint32_t i) const {
        Probe::bytes(2 * sizeof(Key) + sizeof(std::uint32_t));
        marks[i] = i == 0 || ((sorted_codes[i] ^ sorted_codes[i - 1]) & kept_bits) != 0 ? 1 : 0;
    }
};

template <class Key, class Probe>
struct CompactCodes {
    const Key* sorted_codes;           // [n]
    const std::uint32_t* point_count;  // [1]
    Key kept_bits;
    const std::uint32_t* ranks;  // [n + 1], the marks after their scan
    RadixChains<Key, Probe> radix;

    RAYDIX_HD void operator()(std::uint32_t i) const {
        Probe::bytes(sizeof(Key) + sizeof(std::uint32_t));
        const Key code = sorted_codes[i] & kept_bits;
        const bool is_first = i == 0 || code != (sorted_codes[i - 1] & kept_bits);
        if (is_first) {
            Probe::bytes(sizeof(Key) + sizeof(std::uint32_t));
            radix.codes[ranks[i]] = code;
            radix.starts[ranks[i]] = i;
        }
        if (i + 1 != *point_count) return;
        *radix.unique_count = ranks[i + 1];
        radix.starts[ranks[i + 1]] = i + 1;
    }
};

/// No unique codes, should there be no points.
template <class Probe>
struct StartOctree {
    std::uint32_t* unique_count;
    RAYDIX_HD void operator()(std::uint32_t) const {
        Probe::bytes(sizeof(std::uint32_t));
        *unique_count = 0;
    }
};

/// One inner radix node: its range, its level, and its children's way up.
template <class Key, class Probe>
struct LinkRadixNode {
    RadixChains<Key, Probe> radix;

    RAYDIX_HD void operator()(std::uint32_t i) const {
        const std::uint32_t count = *radix.unique_count;
        if (i == 0) radix.parents[count > 1 ? 1 : 0] = no_node;
        if (i + 1 >= count) return;
        const SortedKeys<Key, Probe> keys{radix.codes, count};
        const RadixRange range = find_range(keys, i);
        radix.ranges[i] = {range.first, range.last};
        radix.levels[i] =
            static_cast<std::uint8_t>(keys.common_prefix(range.first, range.last) / 3);
        radix.parents[2 * range.split + (range.split == range.first ? 0 : 1)] = i;
        radix.parents[2 * (range.split + 1) + (range.split + 1 == range.last ? 0 : 1)] = i;
        Probe::bytes(sizeof(CodeRange) + 1 + 2 * sizeof(std::uint32_t));
    }
};

/// How many octree nodes a radix node stands for. All nodes of a chain hold the same points: if
/// they are too many for a leaf, each is there; else only the first may be, as a leaf below a node
/// that has too many.
template <class Key, class Probe>
struct CountChain {
    RadixChains<Key, Probe> radix;

    [[nodiscard]] RAYDIX_HD std::uint32_t length(std::uint32_t slot) const {
        if (!radix.is_radix_node(slot)) return 0;
        const int first = radix.first_level(slot), levels = radix.level(slot) + 1 - first;
        if (levels == 0) return 0;
        if (radix.point_count(slot) > radix.rule.max_leaf)
            return static_cast<std::uint32_t>(levels);
        const bool is_root = first == 0;
        const bool has_place =
            is_root || radix.point_count(radix.chain_above(slot)) > radix.rule.max_leaf;
        return has_place ? 1 : 0;
    }
    RAYDIX_HD void operator()(std::uint32_t slot) const {
        Probe::bytes(sizeof(std::uint32_t));
        radix.offsets[slot] = length(slot);
    }
};

/// The nodes while they are brought into their order. A node is known by its chain's slot and its
/// level.
struct ChainOrder {
    std::uint32_t* levels;         // [capacity] in slot order
    std::uint32_t* slots;          // [capacity]
    std::uint32_t* sorted_levels;  // [capacity] in level order
    std::uint32_t* sorted_slots;   // [capacity]
    std::uint32_t* numbers;        // [capacity] place in slot order -> node
    std::uint32_t capacity;
};

template <class Key, class Probe>
struct WriteChain {
    RadixChains<Key, Probe> radix;
    ChainOrder order;

    RAYDIX_HD void operator()(std::uint32_t slot) const {
        if (!radix.is_radix_node(slot) || *radix.node_count > order.capacity) return;
        Probe::bytes(2 * sizeof(std::uint32_t));
        const std::uint32_t begin = radix.offsets[slot], end = radix.offsets[slot + 1];
        if (begin == end) return;
        const auto first = static_cast<std::uint32_t>(radix.first_level(slot));
        for (std::uint32_t place = begin; place < end; ++place) {
            Probe::bytes(2 * sizeof(std::uint32_t));
            order.levels[place] = first + (place - begin);
            order.slots[place] = slot;
        }
    }
};

/// The nodes' own data, and their numbers for those who look for their parent.
template <class Key, class Probe>
struct FillNode {
    RadixChains<Key, Probe> radix;
    ChainOrder order;
    OctreeNode* nodes;

    RAYDIX_HD void operator()(std::uint32_t node) const {
        if (*radix.node_count > order.capacity) return;
        Probe::bytes(5 * sizeof(std::uint32_t) + sizeof(Key) + sizeof(OctreeNode));
        const std::uint32_t slot = order.sorted_slots[node], level = order.sorted_levels[node];
        const auto first = static_cast<std::uint32_t>(radix.first_level(slot));
        order.numbers[radix.offsets[slot] + (level - first)] = node;
        const CodeRange range = radix.codes_of(slot);
        const int below = 3 * (RadixChains<Key, Probe>::key_levels - static_cast<int>(level));
        OctreeNode& out = nodes[node];
        out.code = radix.codes[range.first] >> below;
        out.parent = no_node;
        out.first_child = no_node;
        out.first_point = radix.starts[range.first];
        out.point_count = radix.starts[range.last + 1] - out.first_point;
        out.child_mask = 0;
        out.level = level;
    }
};

template <class Key, class Probe>
struct LinkToParent {
    RadixChains<Key, Probe> radix;
    ChainOrder order;
    OctreeNode* nodes;

    RAYDIX_HD void operator()(std::uint32_t node) const {
        if (*radix.node_count > order.capacity || node == 0) return;
        const std::uint32_t slot = order.sorted_slots[node], level = order.sorted_levels[node];
        const auto first = static_cast<std::uint32_t>(radix.first_level(slot));
        const std::uint32_t place = level > first ? radix.offsets[slot] + (level - first) - 1
                                                  : radix.offsets[radix.chain_above(slot) + 1] - 1;
        Probe::bytes(5 * sizeof(std::uint32_t));
        Probe::step();
        nodes[node].parent = order.numbers[place];
    }
};

/// In level order the children of a node follow each other: the first one tells the parent of all.
template <class Probe>
struct LinkToChildren {
    const std::uint32_t* node_count;
    std::uint32_t capacity;
    OctreeNode* nodes;

    RAYDIX_HD void operator()(std::uint32_t node) const {
        const std::uint32_t count = *node_count;
        if (count > capacity || node == 0) return;
        const std::uint32_t parent = nodes[node].parent;
        Probe::bytes(2 * sizeof(std::uint32_t));
        if (nodes[node - 1].parent == parent) return;
        std::uint32_t mask = 0;
        for (std::uint32_t i = node; i < count && nodes[i].parent == parent; ++i) {
            Probe::bytes(sizeof(std::uint32_t) + sizeof(std::uint64_t));
            mask |= 1u << (nodes[i].code & 7u);
        }
        Probe::bytes(2 * sizeof(std::uint32_t));
        nodes[parent].child_mask = mask;
        nodes[parent].first_child = node;
    }
};

/// Writes down where each level begins. [max_level + 2] entries, zero before.
template <class Probe>
struct MarkLevels {
    const std::uint32_t* node_count;
    std::uint32_t capacity;
    const OctreeNode* nodes;
    std::uint32_t* level_begin;  // [levels + 1], the rest repeats the last
    std::uint32_t entries;

    RAYDIX_HD void operator()(std::uint32_t node) const {
        const std::uint32_t count = *node_count;
        if (count > capacity) return;
        Probe::bytes(2 * sizeof(std::uint32_t));
        if (node == 0 || nodes[node].level != nodes[node - 1].level)
            level_begin[nodes[node].level] = node;
        if (node + 1 == count)
            for (std::uint32_t k = nodes[node].level + 1; k < entries; ++k) level_begin[k] = count;
    }
};

/// Memory of `count_octree` for n points.
template <class Key, class Probe = NoProbe>
RadixChains<Key, Probe> take_radix_chains(Arena& arena, std::uint32_t n, OctreeRule rule) {
    RadixChains<Key, Probe> radix{};
    radix.codes = arena.take<Key>(n);
    radix.starts = arena.take<std::uint32_t>(std::size_t{n} + 1);
    radix.parents = arena.take<std::uint32_t>(2 * std::size_t{n});
    radix.ranges = arena.take<CodeRange>(n);
    radix.levels = arena.take<std::uint8_t>(n);
    radix.offsets = arena.take<std::uint32_t>(2 * std::size_t{n});  // the marks: n + 1 <= 2 n
    radix.unique_count = arena.take<std::uint32_t>(1);
    radix.node_count = arena.take<std::uint32_t>(1);
    radix.rule = rule;
    return radix;
}

/// Memory of `emit_octree` for up to `capacity` nodes.
inline ChainOrder take_chain_order(Arena& arena, std::uint32_t capacity) {
    ChainOrder order{};
    order.levels = arena.take<std::uint32_t>(capacity);
    order.slots = arena.take<std::uint32_t>(capacity);
    order.sorted_levels = arena.take<std::uint32_t>(capacity);
    order.sorted_slots = arena.take<std::uint32_t>(capacity);
    order.numbers = arena.take<std::uint32_t>(capacity);
    order.capacity = capacity;
    return order;
}

/// sorted_codes [n], n > 0, of which the first *point_count count -> chains and *radix.node_count.
template <class Launcher, class Key>
void count_octree(Launcher& launcher, const Key* sorted_codes, const std::uint32_t* point_count,
                  std::uint32_t n, const RadixChains<Key, typename Launcher::Probe>& radix) {
    using Probe = typename Launcher::Probe;
    // Bits below max_level are cut off; at level 0 that is all of them.
    const int cut = 3 * (CodeFormat<Key>::axis_bits - radix.rule.max_level);
    const Key kept_bits = static_cast<Key>(~Key{0} >> cut << cut);
    std::uint32_t* marks = radix.offsets;  // free until the chains are counted
    launcher.launch("octree.start", 1, StartOctree<Probe>{radix.unique_count});
    launcher.launch_counted("octree.mark", point_count, n,
                            MarkUniqueCodes<Key, Probe>{sorted_codes, kept_bits, marks});
    launcher.exclusive_scan_counted("octree.mark.scan", marks, point_count, n);
    launcher.launch_counted(
        "octree.compact", point_count, n,
        CompactCodes<Key, Probe>{sorted_codes, point_count, kept_bits, marks, radix});
    launcher.launch_counted("octree.radix", radix.unique_count, n,
                            LinkRadixNode<Key, Probe>{radix});
    launcher.launch("octree.count", 2 * n, CountChain<Key, Probe>{radix});
    launcher.exclusive_scan("octree.count.scan", radix.offsets, 2 * n, radix.node_count);
}

/// After count_octree: nodes [capacity] and level_begin [max_level + 2]. If *radix.node_count
/// exceeds the capacity, neither is written.
template <class Launcher, class Key>
void emit_octree(Launcher& launcher, std::uint32_t n,
                 const RadixChains<Key, typename Launcher::Probe>& radix, const ChainOrder& order,
                 OctreeNode* nodes, std::uint32_t* level_begin) {
    using Probe = typename Launcher::Probe;
    constexpr int level_bits = 5;  // 21 < 2^5
    const std::uint32_t* count = radix.node_count;
    const std::uint32_t capacity = order.capacity;
    launcher.launch("octree.chains", 2 * n - 1, WriteChain<Key, Probe>{radix, order});
    launcher.sort_pairs("octree.by_level",
                        SortArrays<std::uint32_t>{order.levels, order.slots, order.sorted_levels,
                                                  order.sorted_slots},
                        capacity, count, level_bits);
    launcher.launch_counted("octree.fill", count, capacity,
                            FillNode<Key, Probe>{radix, order, nodes});
    launcher.launch_counted("octree.parents", count, capacity,
                            LinkToParent<Key, Probe>{radix, order, nodes});
    launcher.launch_counted("octree.children", count, capacity,
                            LinkToChildren<Probe>{count, capacity, nodes});
    const auto entries = static_cast<std::uint32_t>(radix.rule.max_level) + 2;
    launcher.launch_counted("octree.levels", count, capacity,
                            MarkLevels<Probe>{count, capacity, nodes, level_begin, entries});
}

}  // namespace raydix
