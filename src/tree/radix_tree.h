// Sorted codes -> inner nodes of the binary radix tree, each found without looking at any other
// (Karras 2012, section 3 and algorithm of figure 4). Inner node i covers a range of keys that
// begins or ends at key i.
#pragma once

#include <raydix/bvh.h>

#include <cstdint>

#include "base/bits.h"
#include "base/hd.h"
#include "base/probe.h"
#include "keys/morton.h"

namespace raydix {

/// Sorted keys, made unique by their position.
template <class Key, class Probe = NoProbe>
struct SortedKeys {
    const Key* keys;
    std::uint32_t count;

    /// Length of the common prefix of keys i and j (delta in the paper); -1 if j is outside.
    [[nodiscard]] RAYDIX_HD int common_prefix(std::int64_t i, std::int64_t j) const {
        if (j < 0 || j >= static_cast<std::int64_t>(count)) return -1;
        Probe::bytes(2 * sizeof(Key));
        Probe::step();
        return prefix_of(keys[i], keys[j], i, j);
    }
    /// The same for two keys at hand.
    [[nodiscard]] RAYDIX_HD static int prefix_of(Key a, Key b, std::int64_t i, std::int64_t j) {
        const Key differs = a ^ b;
        constexpr int unused_bits = static_cast<int>(8 * sizeof(Key)) - CodeFormat<Key>::bits;
        if (differs != 0) return leading_zeros(differs) - unused_bits;
        // Equal codes: the positions decide, as if they were written behind the code (paper,
        // duplicate keys).
        return CodeFormat<Key>::bits +
               leading_zeros(static_cast<std::uint32_t>(i) ^ static_cast<std::uint32_t>(j));
    }
};

/// Keys [first, last] below one inner node; the left child ends at `split`.
struct RadixRange {
    std::uint32_t first, last, split;
};

/// Which keys share more than so many bits with key i: as common_prefix, with one comparison in
/// place of counting zeros.
template <class Key, class Probe>
class SharesMore {
public:
    RAYDIX_HD SharesMore(const SortedKeys<Key, Probe>& keys, std::uint32_t i, int shared)
        : keys_(keys.keys), i_(i), shared_(shared), own_(keys.keys[i]) {
        constexpr int bits = CodeFormat<Key>::bits;
        least_difference_ = shared < bits ? Key{1} << (bits - 1 - shared) : Key{0};
    }
    /// j: one of the keys.
    [[nodiscard]] RAYDIX_HD bool operator()(std::uint32_t j) const {
        Probe::bytes(2 * sizeof(Key));
        Probe::step();
        const Key differs = own_ ^ keys_[j];
        if (differs != 0) return differs < least_difference_;
        return CodeFormat<Key>::bits + leading_zeros(i_ ^ j) > shared_;
    }

private:
    const Key* keys_;
    std::uint32_t i_;
    int shared_;
    Key own_;
    Key least_difference_;  // of two keys that share no more
};

/// The range of inner node i by galloping and two binary searches. Fewer than 2^31 keys.
template <class Key, class Probe>
RAYDIX_HD RadixRange find_range(const SortedKeys<Key, Probe>& keys, std::uint32_t node) {
    const std::int64_t i = node;
    const bool forward = keys.common_prefix(i, i + 1) > keys.common_prefix(i, i - 1);
    const int outside = keys.common_prefix(i, forward ? i - 1 : i + 1);  // delta_min in the paper
    const SharesMore<Key, Probe> inside(keys, node, outside);
    const std::uint32_t room = forward ? keys.count - 1 - node : node;
    const auto at = [&](std::uint32_t distance) {
        return forward ? node + distance : node - distance;
    };
    std::uint32_t bound = 2;
    while (bound <= room && inside(at(bound))) bound = bound < 1u << 29 ? 4 * bound : 1u << 31;
    std::uint32_t length = 0;
    for (std::uint32_t step = bound / 2; step > 0; step /= 2)
        if (length + step <= room && inside(at(length + step))) length += step;
    const std::uint32_t end = at(length);
    const std::uint32_t first = forward ? node : end, last = forward ? end : node;
    // The split is the last key that shares more with the first than the whole range does.
    const SharesMore<Key, Probe> left(keys, first, keys.common_prefix(first, last));
    std::uint32_t split = first, step = last - first;
    do {
        step = (step + 1) / 2;
        if (split + step < last && left(split + step)) split += step;
    } while (step > 1);
    return {first, last, split};
}

/// Node slots: the root in 0, padding in 1, then the pair of children of inner node r (r counts the
/// nodes that are kept when small subtrees become leaves) in 2r + 2 and 2r + 3.
RAYDIX_HD inline std::uint32_t pair_slot(std::uint32_t rank) { return 2 * rank + 2; }
RAYDIX_HD inline std::uint32_t rank_of_slot(std::uint32_t slot) { return (slot - 2) / 2; }

/// Which of the n - 1 radix nodes stay inner nodes, as bits, with the number of kept nodes before
/// each word.
struct KeptNodes {
    const std::uint64_t* bits;
    const std::uint32_t* before_word;

    [[nodiscard]] RAYDIX_HD std::uint32_t rank(std::uint32_t node) const {
        const std::uint64_t below = bits[node / 64] & ((std::uint64_t{1} << (node % 64)) - 1);
        return before_word[node / 64] + static_cast<std::uint32_t>(count_ones(below));
    }
};

/// Writes the children of one kept node and tells those that are inner where their own box belongs.
/// `Ranks` numbers the kept nodes.
template <class Ranks = KeptNodes, class Probe = NoProbe>
struct EmitRadixNode {
    Ranks kept;
    std::uint32_t max_leaf;
    BvhNode* nodes;              // [2 * inner + 2], out: links and counts; boxes come later
    std::uint32_t* parent_slot;  // [inner], out

    RAYDIX_HD void child(std::uint32_t slot, std::uint32_t first, std::uint32_t last,
                         std::uint32_t radix_node) const {
        const std::uint32_t count = last - first + 1;
        Probe::bytes(2 * sizeof(std::uint32_t));
        if (count <= max_leaf) {
            nodes[slot].first = first;
            nodes[slot].count = count;
        } else {
            const std::uint32_t rank = kept.rank(radix_node);
            nodes[slot].first = pair_slot(rank);
            nodes[slot].count = 0;
            parent_slot[rank] = slot;
            Probe::bytes(2 * sizeof(std::uint32_t));
            Probe::step();
        }
    }
    /// `rank` is the node's own. The left child's radix index is the split, the right one's the
    /// split + 1.
    RAYDIX_HD void operator()(std::uint32_t rank, const RadixRange& range) const {
        child(pair_slot(rank), range.first, range.split, range.split);
        child(pair_slot(rank) + 1, range.split + 1, range.last, range.split + 1);
    }
};

}  // namespace raydix
