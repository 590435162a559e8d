// One bottom-up pass: the talk's example, ranges against a recursion, boxes of the same pass, any
// order of climbers.
#include "tree/apetrei.h"

#include <gtest/gtest.h>

#include <numeric>

#include "support/launched_tree.h"

namespace raydix::test {
namespace {

const auto run_apetrei = [](auto& tree) {
    HostLauncher<> launcher;
    launch_apetrei(launcher, tree.in,
                   tree.template scratch<ApetreiScratch>(tree.in.count, tree.in.max_leaf),
                   NoLeafBox{}, tree.links(), &tree.max_depth);
    EXPECT_EQ(tree.nodes[0].lo.x, 7.0f);  // links only
};

/// Key i lies at i in x, and at other places in y.
struct BoxOfRun {
    Aabb operator()(std::uint32_t first, std::uint32_t count) const {
        Aabb box = empty_box();
        for (std::uint32_t k = first; k < first + count; ++k) {
            const Vec3 p{static_cast<float>(k), static_cast<float>(k * 7919 % 1000), -1};
            box = unite(box, {p, p});
        }
        return box;
    }
};

template <class Key>
void expect_apetrei_talk() {
    const std::vector<Key> keys = talk_keys<Key>();
    LaunchedTree<Key> tree(keys, 1);
    run_apetrei(tree);
    EXPECT_EQ(tree.ranges(), talk_ranges());
    EXPECT_EQ(tree.max_depth, 4u);
    // Ranks are splits: the root divides behind key 3, (0, 3) behind 1, (4, 7) behind 4.
    EXPECT_EQ(tree.nodes[0].first, pair_slot(3));
    EXPECT_EQ(tree.nodes[pair_slot(3)].first, pair_slot(1));
    EXPECT_EQ(tree.nodes[pair_slot(3) + 1].first, pair_slot(4));
}

TEST(Apetrei, WorkedExample) {
    expect_apetrei_talk<std::uint32_t>();
    expect_apetrei_talk<std::uint64_t>();
}

TEST(Apetrei, RangesAreThoseOfTheRecursion) {
    expect_reference_ranges<std::uint32_t>(run_apetrei);
    expect_reference_ranges<std::uint64_t>(run_apetrei);
}

TEST(Apetrei, OneKey) {
    const std::vector<std::uint32_t> keys{5};
    LaunchedTree<std::uint32_t> tree(keys, 1);
    run_apetrei(tree);
    EXPECT_EQ(tree.inner_count, 0u);
    EXPECT_EQ(tree.max_depth, 0u);
    EXPECT_EQ(tree.nodes[0].count, 1u);
}

/// Every node's box is that of its keys; returns the height.
template <class Key>
std::uint32_t expect_boxes(const LaunchedTree<Key>& tree, std::uint32_t slot,
                           std::uint32_t& begin) {
    const BvhNode& node = tree.nodes[slot];
    const std::uint32_t first = begin;
    std::uint32_t height = 0;
    if (node.is_leaf())
        begin += node.count;
    else
        for (const std::uint32_t child : {node.first, node.first + 1})
            height = std::max(height, 1 + expect_boxes(tree, child, begin));
    const Aabb wanted = BoxOfRun{}(first, begin - first);
    EXPECT_EQ(node.lo, wanted.lo) << "slot " << slot;
    EXPECT_EQ(node.hi, wanted.hi) << "slot " << slot;
    return height;
}

TEST(Apetrei, BoxesAndDepthComeWithTheSamePass) {
    std::mt19937_64 random(6);
    for (const std::uint32_t max_leaf : {1u, 4u, 255u}) {
        for (const std::size_t n : {1u, 2u, 3u, 250u, 6000u}) {
            const auto keys = random_keys<std::uint64_t>(random, n, 1u << 11);
            LaunchedTree<std::uint64_t> tree(keys, max_leaf);
            HostLauncher<> launcher;
            launch_apetrei(launcher, tree.in, tree.scratch<ApetreiScratch>(tree.in.count, max_leaf),
                           BoxOfRun{}, tree.links(), &tree.max_depth);
            std::uint32_t end = 0;
            EXPECT_EQ(expect_boxes(tree, 0, end), tree.max_depth);
            EXPECT_EQ(end, n);
        }
    }
}

TEST(Apetrei, AnyOrderOfClimbersGivesTheSameBits) {
    constexpr std::uint64_t seed = 17;
    std::mt19937_64 random(seed);
    const auto keys = random_keys<std::uint32_t>(random, 300, 100);
    LaunchedTree<std::uint32_t> first(keys, 2);
    for (int round = 0; round < 100; ++round) {
        SCOPED_TRACE("seed " + std::to_string(seed) + ", round " + std::to_string(round));
        LaunchedTree<std::uint32_t> tree(keys, 2);
        const auto scratch = tree.scratch<ApetreiScratch>(tree.in.count, 2u);
        const SortedKeys<std::uint32_t> sorted{keys.data(), tree.in.count};
        HostLauncher<> launcher;
        launcher.launch("mark", tree.in.count,
                        MarkKeptSplit<std::uint32_t, NoProbe>{sorted, 2, scratch.rank_of_split,
                                                              scratch.other_end});
        launcher.exclusive_scan("rank", scratch.rank_of_split, tree.in.count, &tree.inner_count);
        const ClimbFromLeaf<std::uint32_t, BoxOfRun, NoProbe> climb{
            sorted,     scratch.rank_of_split, scratch.other_end, scratch.heights,
            BoxOfRun{}, tree.links(),          &tree.max_depth};
        std::vector<std::uint32_t> order(keys.size());
        std::iota(order.begin(), order.end(), 0u);
        if (round > 0) std::ranges::shuffle(order, random);
        for (const std::uint32_t key : order) climb(key);
        std::uint32_t end = 0;
        ASSERT_EQ(expect_boxes(tree, 0, end), tree.max_depth);
        ASSERT_EQ(tree.ranges(), reference_ranges(keys, 2));
        if (round == 0) first = tree;
        ASSERT_EQ(tree.parent_slot, first.parent_slot);
        for (std::size_t slot = 0; slot < tree.nodes.size(); ++slot)
            ASSERT_EQ(tree.nodes[slot].first, first.nodes[slot].first);
    }
}

}  // namespace
}  // namespace raydix::test
