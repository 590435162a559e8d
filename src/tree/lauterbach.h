// Lauterbach, Garland, Sengupta, Luebke and Manocha 2009, "Fast BVH Construction on GPUs", section
// 4: sorted keys [n] -> links of nodes and parent slots by split lists. Two neighbours are in
// different nodes on every level below their common prefix: they put down a split there. Splits
// sorted by level and position cut the keys into the intervals of each level. An interval is a node
// with two children if a split that is new on the level below lies in it, else with one, and those
// are removed. The levels are worked off in bands to bound the memory.
#pragma once

#include <cstdint>

#include "exec/host_launcher.h"  // SortArrays
#include "tree/lbvh_family.h"
#include "tree/lbvh_launches.h"

namespace raydix {

/// Levels (above, above + width] of the keys; level l is where the bit behind a prefix of l - 1
/// decides.
struct LevelBand {
    std::uint32_t above, width;

    /// The first level of the band on which a pair is apart that first is so on `split_level`.
    [[nodiscard]] RAYDIX_HD std::uint32_t first_level(std::uint32_t split_level) const {
        return split_level > above ? split_level : above + 1;
    }
    [[nodiscard]] RAYDIX_HD std::uint32_t split_count(std::uint32_t split_level) const {
        return split_level > above + width ? 0 : above + width + 1 - first_level(split_level);
    }
};

/// Keys with the bits of the position behind those of the code.
template <class Key, class Probe>
struct ExtendedKeys {
    SortedKeys<Key, Probe> keys;
    std::uint32_t index_bits;

    /// The first level on which keys i and i + 1 are in different nodes.
    [[nodiscard]] RAYDIX_HD std::uint32_t split_level(std::uint32_t i) const {
        const int prefix = keys.common_prefix(i, std::int64_t{i} + 1);
        // common_prefix takes positions as 32 bits, of which the upper ones are always equal.
        const int unused = prefix < CodeFormat<Key>::bits ? 0 : 32 - static_cast<int>(index_bits);
        return static_cast<std::uint32_t>(prefix - unused) + 1;
    }
};

/// The splits of a band, sorted by level and position; level 0 is the band's first here.
struct SplitLists {
    const std::uint8_t* level;      // [splits]
    const std::uint32_t* position;  // [splits], between this key and the next
    const std::uint32_t* count;     // [1]
    std::uint32_t* level_begin;     // [width]
    std::uint32_t* level_count;     // [width]
    std::uint32_t* nodes_before;    // [splits + 1]: flags of splits that divide a node, then sums
};

struct SplitInterval {
    std::uint32_t first, last;  // keys
};

/// The interval of the level above in which the k-th split of the band lies, if it is new: the
/// splits beside it on its own level are old then, because an interval has at most one new split.
template <class Probe>
RAYDIX_HD SplitInterval interval_around(const SplitLists& lists, std::uint32_t k,
                                        std::uint32_t level, std::uint32_t key_count) {
    const std::uint32_t begin = lists.level_begin[level], end = begin + lists.level_count[level];
    Probe::bytes(4 * sizeof(std::uint32_t));
    Probe::step();
    return {k > begin ? lists.position[k - 1] + 1 : 0,
            k + 1 < end ? lists.position[k + 1] : key_count - 1};
}

template <class Key, class Probe>
struct CountSplits {
    ExtendedKeys<Key, Probe> keys;
    LevelBand band;
    std::uint32_t* offsets;  // [n], out; 0 behind the last pair
    RAYDIX_HD void operator()(std::uint32_t i) const {
        const bool pair = i + 1 < keys.keys.count;
        offsets[i] = pair ? band.split_count(keys.split_level(i)) : 0;
        Probe::bytes(sizeof(std::uint32_t));
    }
};

template <class Key, class Probe>
struct EmitSplits {
    ExtendedKeys<Key, Probe> keys;
    LevelBand band;
    const std::uint32_t* offsets;
    std::uint8_t* level;      // [splits], out
    std::uint32_t* position;  // [splits], out
    RAYDIX_HD void operator()(std::uint32_t i) const {
        std::uint32_t at = offsets[i];
        Probe::bytes(sizeof(std::uint32_t));
        for (std::uint32_t l = band.first_level(keys.split_level(i)); l <= band.above + band.width;
             ++l, ++at) {
            level[at] = static_cast<std::uint8_t>(l - band.above - 1);
            position[at] = i;
            Probe::bytes(sizeof(std::uint8_t) + sizeof(std::uint32_t));
        }
    }
};

/// Where each level's splits begin.
template <class Probe>
struct FindSplitLevels {
    SplitLists lists;
    [[nodiscard]] RAYDIX_HD std::uint32_t first_at_least(std::uint32_t level) const {
        std::uint32_t low = 0, high = *lists.count;
        while (low < high) {
            const std::uint32_t middle = low + (high - low) / 2;
            Probe::bytes(1);
            Probe::step();
            if (lists.level[middle] < level)
                low = middle + 1;
            else
                high = middle;
        }
        return low;
    }
    RAYDIX_HD void operator()(std::uint32_t level) const {
        lists.level_begin[level] = first_at_least(level);
        lists.level_count[level] = first_at_least(level + 1) - lists.level_begin[level];
    }
};

/// The pass that removes nodes with one child: flags splits that are new on their level and lie in
/// an interval of more than max_leaf keys. Those nodes stay; their ranks are the sums of the flags.
template <class Key, class Probe>
struct KeepTwoChildren {
    ExtendedKeys<Key, Probe> keys;
    LevelBand band;
    std::uint32_t max_leaf;
    SplitLists lists;
    RAYDIX_HD void operator()(std::uint32_t k) const {
        const std::uint32_t level = lists.level[k], position = lists.position[k];
        Probe::bytes(1 + 2 * sizeof(std::uint32_t));
        Probe::step();
        const bool is_new = keys.split_level(position) == band.above + 1 + level;
        const SplitInterval node = interval_around<Probe>(lists, k, level, keys.keys.count);
        lists.nodes_before[k] = is_new && node.last - node.first >= max_leaf ? 1 : 0;
    }
};

/// Notes the nodes of each level of a band, whose ranks follow one another.
struct NoteLevelNodes {
    LevelBand band;
    SplitLists lists;
    std::uint32_t* rank_begin;  // [2], of this band and the next
    std::uint32_t* inner_count;
    TreeLevels levels;
    RAYDIX_HD void operator()(std::uint32_t level) const {
        const std::uint32_t first = lists.level_begin[level];
        const std::uint32_t before = lists.nodes_before[first];
        levels.begin[band.above + level] = rank_begin[0] + before;
        levels.count[band.above + level] =
            lists.nodes_before[first + lists.level_count[level]] - before;
        if (level == 0)
            *inner_count = rank_begin[1] = rank_begin[0] + lists.nodes_before[*lists.count];
    }
};

/// The intervals of one level that have two children become nodes. An interval that has one child
/// hands its slot on simply by keeping its first key.
template <class Probe>
struct LinkLevel {
    SplitLists lists;
    std::uint32_t level;  // in the band
    std::uint32_t key_count, max_leaf;
    const std::uint32_t* rank_begin;
    std::uint32_t* slot_of;  // [n]: first key of an interval -> the slot that its node will have
    TreeLinks out;

    RAYDIX_HD void child(std::uint32_t slot, std::uint32_t first, std::uint32_t last) const {
        if (last - first < max_leaf) {
            link_leaf(out.nodes[slot], first, last - first + 1);
            Probe::bytes(link_bytes);
        } else {
            slot_of[first] = slot;
            Probe::bytes(sizeof(std::uint32_t));
        }
    }
    RAYDIX_HD void operator()(std::uint32_t i) const {
        const std::uint32_t k = lists.level_begin[level] + i;
        const std::uint32_t before = lists.nodes_before[k];
        Probe::bytes(2 * sizeof(std::uint32_t));
        Probe::step();
        if (lists.nodes_before[k + 1] == before) return;
        const SplitInterval node = interval_around<Probe>(lists, k, level, key_count);
        const std::uint32_t rank = *rank_begin + before, slot = slot_of[node.first];
        link_inner(out.nodes[slot], rank);
        out.parent_slot[rank] = slot;
        Probe::bytes(3 * sizeof(std::uint32_t) + link_bytes);
        Probe::step();
        const std::uint32_t split = lists.position[k];
        child(pair_slot(rank), node.first, split);
        child(pair_slot(rank) + 1, split + 1, node.last);
    }
};

/// The root's interval holds all keys.
struct StartSplitLists {
    std::uint32_t* slot_of;
    std::uint32_t* rank_begin;
    BvhNode* nodes;
    RAYDIX_HD void operator()(std::uint32_t) const {
        slot_of[0] = 0;
        rank_begin[0] = 0;
        clear_padding(nodes);
    }
};

/// What a builder may take beside the keys and the tree: 64 bytes a primitive, and some for the
/// smallest.
[[nodiscard]] constexpr std::uint64_t lauterbach_memory_limit(std::uint32_t n) {
    return std::uint64_t{64} * n + 16384;
}

struct LauterbachScratch {
    std::uint32_t band_width;
    std::uint32_t* offsets;   // [n]: splits of a band before each pair
    std::uint32_t* slot_of;   // [n]
    std::uint8_t* level;      // [n * width]
    std::uint32_t* position;  // [n * width + 1]; once sorted away, nodes_before
    std::uint8_t* sorted_level;
    std::uint32_t* sorted_position;
    std::uint32_t *level_begin, *level_count;  // [width]
    std::uint32_t* rank_begin;                 // [levels + 1], of each band

    /// `levels`: of all bands. `width`: of the widest band; what lauterbach_band_width says.
    LauterbachScratch(Arena& arena, std::uint32_t n, std::uint32_t levels, std::uint32_t width)
        : band_width(width),
          offsets(arena.take<std::uint32_t>(n)),
          slot_of(arena.take<std::uint32_t>(n)),
          level(arena.take<std::uint8_t>(std::size_t{n} * width)),
          position(arena.take<std::uint32_t>(std::size_t{n} * width + 1)),
          sorted_level(arena.take<std::uint8_t>(std::size_t{n} * width)),
          sorted_position(arena.take<std::uint32_t>(std::size_t{n} * width)),
          level_begin(arena.take<std::uint32_t>(width)),
          level_count(arena.take<std::uint32_t>(width)),
          rank_begin(arena.take<std::uint32_t>(levels + 1)) {}
};

/// The widest band whose splits surely fit into `memory_limit` bytes of scratch, at most 16. Throws
/// InputError that names the bytes if not even one level does.
[[nodiscard]] std::uint32_t lauterbach_band_width(std::uint32_t n, std::uint32_t levels,
                                                  std::uint64_t memory_limit);

/// `levels` has room for lbvh_depth_bound levels and is filled by bits of the key: a parent stands
/// before its children, and levels without a node are empty.
template <class Launcher, class Key>
void launch_lauterbach(Launcher& launcher, const LbvhInput<Key>& in, const LauterbachScratch& s,
                       const TreeLinks& out, const TreeLevels& levels) {
    using Probe = typename Launcher::Probe;
    if (in.count <= in.max_leaf) {
        launcher.launch("lauterbach.only_leaf", 1, EmitOnlyLeaf{in.count, out});
        return;
    }
    const std::uint32_t pairs = in.count - 1;
    const std::uint32_t level_limit = lbvh_depth_bound(CodeFormat<Key>::bits, in.count);
    const ExtendedKeys<Key, Probe> keys{{in.keys, in.count}, level_limit - CodeFormat<Key>::bits};
    const std::uint32_t* split_count = s.offsets + pairs;
    const SplitLists lists{s.sorted_level, s.sorted_position, split_count,
                           s.level_begin,  s.level_count,     s.position};
    launcher.launch("lauterbach.start", 1, StartSplitLists{s.slot_of, s.rank_begin, out.nodes});
    std::uint32_t* rank_begin = s.rank_begin;
    for (std::uint32_t above = 0; above < level_limit; above += s.band_width, ++rank_begin) {
        const std::uint32_t left = level_limit - above;
        const LevelBand band{above, left < s.band_width ? left : s.band_width};
        launcher.launch("lauterbach.count", in.count,
                        CountSplits<Key, Probe>{keys, band, s.offsets});
        launcher.exclusive_scan("lauterbach.offsets", s.offsets, in.count, nullptr);
        launcher.launch("lauterbach.emit", pairs,
                        EmitSplits<Key, Probe>{keys, band, s.offsets, s.level, s.position});
        launcher.sort_pairs(
            "lauterbach.sort",
            SortArrays<std::uint8_t>{s.level, s.position, s.sorted_level, s.sorted_position},
            pairs * band.width, split_count, 4);
        launcher.launch("lauterbach.levels", band.width, FindSplitLevels<Probe>{lists});
        launcher.launch_counted("lauterbach.remove", split_count, pairs * band.width,
                                KeepTwoChildren<Key, Probe>{keys, band, in.max_leaf, lists});
        launcher.exclusive_scan_counted("lauterbach.rank", lists.nodes_before, split_count,
                                        pairs * band.width);
        launcher.launch("lauterbach.note", band.width,
                        NoteLevelNodes{band, lists, rank_begin, out.inner_count, levels});
        for (std::uint32_t level = 0; level < band.width; ++level) {
            if (!launcher.maybe_any(levels.count + above + level)) continue;
            launcher.launch_counted(
                "lauterbach.link", s.level_count + level, pairs,
                LinkLevel<Probe>{lists, level, in.count, in.max_leaf, rank_begin, s.slot_of, out});
        }
    }
}

}  // namespace raydix
