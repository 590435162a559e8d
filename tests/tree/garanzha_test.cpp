// Work queues: the talk's example level by level, ranges against a recursion, and the queue's own
// promises.
#include "tree/garanzha.h"

#include <gtest/gtest.h>

#include <cstring>
#include <numeric>

#include "support/launched_tree.h"
#include "support/shuffled_launcher.h"
#include "support/support.h"

namespace raydix::test {
namespace {

const auto run_by = [](auto& launcher, auto& tree) {
    launch_garanzha(
        launcher, tree.in,
        tree.template scratch<GaranzhaScratch>(tree.in.count, tree.in.max_leaf, tree.level_limit),
        tree.links(), tree.levels());
};
const auto run_garanzha = [](auto& tree) {
    HostLauncher<> launcher;
    run_by(launcher, tree);
};

/// Ranks [begin, begin + count) of level l belong to nodes l edges below the root, and there are no
/// others.
template <class Key>
void expect_ranks_by_level(const LaunchedTree<Key>& tree) {
    std::uint32_t next = 0;
    for (std::uint32_t level = 0; level < tree.level_limit; ++level) {
        if (tree.level_count[level] == 0) continue;
        EXPECT_EQ(tree.level_begin[level], next);
        for (const std::uint32_t end = next + tree.level_count[level]; next < end; ++next) {
            std::uint32_t depth = 0;
            for (std::uint32_t slot = tree.parent_slot[next]; slot != 0;
                 slot = tree.parent_slot[rank_of_slot(slot)])
                ++depth;
            ASSERT_EQ(depth, level) << "rank " << next;
        }
    }
    EXPECT_EQ(next, tree.inner_count);
}

template <class Key>
void expect_garanzha_talk() {
    const std::vector<Key> keys = talk_keys<Key>();
    LaunchedTree<Key> tree(keys, 1);
    run_garanzha(tree);
    EXPECT_EQ(tree.ranges(), talk_ranges());
    const std::vector<std::uint32_t> first_levels(tree.level_count.begin(),
                                                  tree.level_count.begin() + 5);
    EXPECT_EQ(first_levels, (std::vector<std::uint32_t>{1, 2, 3, 1, 0}));
    EXPECT_EQ(std::accumulate(tree.level_count.begin(), tree.level_count.end(), 0u), 7u);
    expect_ranks_by_level(tree);
}

TEST(Garanzha, WorkedExample) {
    expect_garanzha_talk<std::uint32_t>();
    expect_garanzha_talk<std::uint64_t>();
}

TEST(Garanzha, RangesAreThoseOfTheRecursion) {
    expect_reference_ranges<std::uint32_t>(run_garanzha);
    expect_reference_ranges<std::uint64_t>(run_garanzha);
}

TEST(Garanzha, RanksOfALevelFollowOneAnother) {
    std::mt19937_64 random(4);
    for (const std::uint32_t max_leaf : {1u, 4u}) {
        const auto keys = random_keys<std::uint64_t>(random, 20'000, 1u << 13);
        LaunchedTree<std::uint64_t> tree(keys, max_leaf);
        run_garanzha(tree);
        expect_ranks_by_level(tree);
    }
}

TEST(Garanzha, NumbersFollowTheKeysInEveryOrderOfThreads) {
    std::mt19937_64 random(9);
    for (const std::uint32_t max_leaf : {1u, 4u}) {
        const auto keys = random_keys<std::uint32_t>(random, 1000 * thorough, 1u << 12);
        LaunchedTree<std::uint32_t> expected(keys, max_leaf);
        run_garanzha(expected);
        std::vector<std::uint32_t> first(expected.nodes.size(), 0);  // key of a slot's range
        for (std::uint32_t rank = expected.inner_count; rank-- > 0;) {
            const std::uint32_t pair = pair_slot(rank);
            for (const std::uint32_t slot : {pair, pair + 1})
                if (expected.nodes[slot].is_leaf()) first[slot] = expected.nodes[slot].first;
            first[expected.parent_slot[rank]] = first[pair];
        }
        for (std::uint32_t level = 0; expected.level_count[level] != 0; ++level) {
            const std::uint32_t begin = expected.level_begin[level];
            for (std::uint32_t rank = begin + 1; rank < begin + expected.level_count[level]; ++rank)
                ASSERT_LT(first[expected.parent_slot[rank - 1]], first[expected.parent_slot[rank]]);
        }
        for (std::uint64_t seed = 1; seed <= 20; ++seed) {
            ShuffledLauncher shuffled(seed);
            LaunchedTree<std::uint32_t> tree(keys, max_leaf);
            run_by(shuffled, tree);
            EXPECT_EQ(tree.parent_slot, expected.parent_slot) << "seed " << seed;
            EXPECT_EQ(tree.level_begin, expected.level_begin) << "seed " << seed;
            EXPECT_EQ(tree.level_count, expected.level_count) << "seed " << seed;
            EXPECT_EQ(std::memcmp(tree.nodes.data(), expected.nodes.data(),
                                  tree.nodes.size() * sizeof(BvhNode)),
                      0)
                << "seed " << seed;
        }
    }
}

TEST(Garanzha, TheDeepestTreeStaysWithinItsLevels) {
    // Each bit of the code cuts off one key; what is left at the end shares all bits.
    std::vector<std::uint32_t> keys(4, 0);
    for (int bit = 0; bit < 30; ++bit) keys.push_back(1u << bit);
    LaunchedTree<std::uint32_t> tree(keys, 1);
    run_garanzha(tree);
    EXPECT_EQ(tree.ranges(), reference_ranges(keys, 1));
    std::uint32_t used = 0;
    while (used < tree.level_limit && tree.level_count[used] != 0) ++used;
    EXPECT_EQ(used, 30u + 2);  // two levels tell four equal codes apart
    EXPECT_EQ(tree.level_limit, 30u + 6);
}

}  // namespace
}  // namespace raydix::test
