// A builder of the LBVH family run as launches over plain keys, and what its links must be: ranges
// by a recursion that shares nothing with the builders but the meaning of a code.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "exec/host_launcher.h"
#include "tree/lbvh_family.h"
#include "tree/lbvh_launches.h"

namespace raydix::test {

/// An inner node: keys [first, last], divided behind `split`, `depth` edges below the root.
struct NodeRange {
    std::uint32_t first, last, split, depth;
    friend auto operator<=>(const NodeRange&, const NodeRange&) = default;
    friend std::ostream& operator<<(std::ostream& out, const NodeRange& r) {
        return out << "(" << r.first << ", " << r.last << ") split " << r.split << " depth "
                   << r.depth;
    }
};

/// Arrays that a builder's launches write.
template <class Key>
class LaunchedTree {
public:
    LaunchedTree(const std::vector<Key>& keys, std::uint32_t max_leaf)
        : in{keys.data(), static_cast<std::uint32_t>(keys.size()), max_leaf},
          limit(inner_node_limit(in.count, max_leaf)),
          level_limit(lbvh_depth_bound(CodeFormat<Key>::bits, in.count)),
          nodes(2 * std::size_t{limit} + 2, BvhNode{{7, 7, 7}, ~0u, {7, 7, 7}, ~0u}),
          parent_slot(limit, ~0u),
          level_begin(level_limit + 1, ~0u),
          level_count(level_limit + 1) {}

    TreeLinks links() { return {nodes.data(), parent_slot.data(), &inner_count}; }
    TreeLevels levels() { return {level_begin.data(), level_count.data(), level_limit, nullptr}; }

    template <class Scratch, class... Sizes>
    Scratch scratch(Sizes... sizes) {
        memory.resize(scratch_bytes<Scratch>(sizes...));
        Arena arena(memory.data(), memory.size());
        return Scratch{arena, sizes...};
    }

    /// The inner nodes, sorted. Fails the test if the links are not those of a tree over all keys.
    std::vector<NodeRange> ranges() const {
        std::vector<NodeRange> found;
        EXPECT_EQ(walk(0, 0, found), in.count);
        EXPECT_EQ(found.size(), inner_count);
        std::ranges::sort(found);
        return found;
    }

    LbvhInput<Key> in;
    std::uint32_t limit, level_limit, inner_count = ~0u, max_depth = ~0u;
    std::vector<BvhNode> nodes;
    std::vector<std::uint32_t> parent_slot, level_begin, level_count;
    std::vector<std::byte> memory;

private:
    /// The keys below a slot begin where the last leaf ended; returns where they end.
    std::uint32_t walk(std::uint32_t slot, std::uint32_t depth, std::vector<NodeRange>& found,
                       std::uint32_t begin = 0) const {
        const BvhNode& node = nodes.at(slot);
        if (node.is_leaf()) {
            EXPECT_EQ(node.first, begin) << "leaf in slot " << slot;
            EXPECT_LE(node.count, in.max_leaf);
            return node.first + node.count;
        }
        if (found.size() == inner_count || node.first % 2 != 0 || node.first < 2) {
            ADD_FAILURE() << "slot " << slot << " does not lead to a pair of children of its own";
            return begin;
        }
        EXPECT_EQ(parent_slot.at(rank_of_slot(node.first)), slot);
        const std::size_t mine = found.size();
        found.push_back({begin, 0, 0, depth});
        const std::uint32_t middle = walk(node.first, depth + 1, found, begin);
        const std::uint32_t end = walk(node.first + 1, depth + 1, found, middle);
        found[mine].split = middle - 1;
        found[mine].last = end - 1;
        return end;
    }
};

/// By recursion: a range divides where the highest bit that its keys do not share turns to 1;
/// positions stand behind the codes.
template <class Key>
void reference_ranges(const std::vector<Key>& keys, std::uint32_t max_leaf, std::uint32_t first,
                      std::uint32_t last, std::uint32_t depth, std::vector<NodeRange>& found) {
    if (last - first < max_leaf) return;
    const bool equal = keys[first] == keys[last];
    const auto key = [&](std::uint32_t i) { return equal ? std::uint64_t{i} : keys[i]; };
    std::uint64_t bit = std::uint64_t{1} << 63;
    while (((key(first) ^ key(last)) & bit) == 0) bit >>= 1;
    std::uint32_t split = first;
    while ((key(split + 1) & bit) == 0) ++split;
    found.push_back({first, last, split, depth});
    reference_ranges(keys, max_leaf, first, split, depth + 1, found);
    reference_ranges(keys, max_leaf, split + 1, last, depth + 1, found);
}
template <class Key>
std::vector<NodeRange> reference_ranges(const std::vector<Key>& keys, std::uint32_t max_leaf) {
    std::vector<NodeRange> found;
    reference_ranges(keys, max_leaf, 0, static_cast<std::uint32_t>(keys.size()) - 1, 0, found);
    std::ranges::sort(found);
    return found;
}

/// Eight keys of five bits, the worked example of Karras's talk; the bits stand at the top of a
/// code.
template <class Key>
std::vector<Key> talk_keys() {
    std::vector<Key> keys;
    for (const unsigned key :
         {0b00001u, 0b00010u, 0b00100u, 0b00101u, 0b10011u, 0b11000u, 0b11001u, 0b11110u})
        keys.push_back(Key{key} << (CodeFormat<Key>::bits - 5));
    return keys;
}
/// Its inner nodes, from the talk.
inline std::vector<NodeRange> talk_ranges() {
    return {{0, 1, 0, 2}, {0, 3, 1, 1}, {0, 7, 3, 0}, {2, 3, 2, 2},
            {4, 7, 4, 1}, {5, 6, 5, 3}, {5, 7, 6, 2}};
}

/// Sorted keys: `values` different ones at most, the fewer the more equal codes.
template <class Key>
std::vector<Key> random_keys(std::mt19937_64& random, std::size_t n, std::uint64_t values) {
    constexpr std::uint64_t codes = std::uint64_t{1} << CodeFormat<Key>::bits;
    const std::uint64_t stride = codes / values;
    std::vector<Key> keys(n);
    for (Key& key : keys) key = static_cast<Key>(random() % values * stride);
    std::ranges::sort(keys);
    return keys;
}

/// `launch(tree)` runs the builder; its links are compared with the recursion's, for many kinds of
/// keys.
template <class Key, class Launch>
void expect_reference_ranges(const Launch& launch) {
    constexpr std::uint64_t seed = 21;
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    constexpr std::uint64_t codes = std::uint64_t{1} << CodeFormat<Key>::bits;
    for (const std::size_t n : {2u, 3u, 4u, 5u, 9u, 64u, 65u, 700u}) {
        for (const std::uint64_t values : {std::uint64_t{1}, std::uint64_t{3}, std::uint64_t{64},
                                           std::uint64_t{1} << 18, codes}) {
            const std::vector<Key> keys = random_keys<Key>(random, n, values);
            for (const std::uint32_t max_leaf : {1u, 2u, 3u, 4u, 8u, 100u, 255u}) {
                SCOPED_TRACE(std::to_string(n) + " keys of " + std::to_string(values) +
                             " values, max_leaf " + std::to_string(max_leaf));
                LaunchedTree<Key> tree(keys, max_leaf);
                launch(tree);
                ASSERT_EQ(tree.ranges(), reference_ranges(keys, max_leaf));
                EXPECT_EQ(tree.nodes[1].first, 0u);
                EXPECT_EQ(tree.nodes[1].count, 0u);
            }
        }
    }
}

}  // namespace raydix::test
