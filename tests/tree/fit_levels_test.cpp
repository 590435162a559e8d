// Boxes level by level: trees that no builder of the LBVH family makes, levels from the root, and
// the same boxes as in one atomic pass.
#include "tree/fit_levels.h"

#include <gtest/gtest.h>

#include <iostream>
#include <random>
#include <vector>

#include "exec/host_launcher.h"

namespace raydix::test {
namespace {

/// Primitive i lies at (i, 7919 i mod 101, -i).
struct BoxOfRun {
    Aabb operator()(std::uint32_t first, std::uint32_t count) const {
        Aabb box = empty_box();
        for (std::uint32_t k = first; k < first + count; ++k) {
            const auto x = static_cast<float>(k);
            const Vec3 p{x, static_cast<float>(k * 7919 % 101), -x};
            box = unite(box, {p, p});
        }
        return box;
    }
};

/// A tree over `leaf_count` leaves of one to three primitives; `left_share` says how many leaves of
/// a node of so many go to its left. Ranks are shuffled: no order among them may be relied on.
struct RandomTree {
    std::vector<BvhNode> nodes;
    std::vector<std::uint32_t> parent_slot, per_level;
    std::vector<std::uint32_t> free_ranks;
    std::uint32_t depth = 0, primitives = 0;

    template <class LeftShare>
    RandomTree(std::mt19937_64& random, std::uint32_t leaf_count, const LeftShare& left_share)
        : nodes(2 * std::size_t{leaf_count}), parent_slot(leaf_count - 1) {
        for (std::uint32_t rank = 0; rank + 1 < leaf_count; ++rank) free_ranks.push_back(rank);
        std::ranges::shuffle(free_ranks, random);
        const Vec3 nonsense{9e9f, -9e9f, 1};
        for (BvhNode& node : nodes) node = {nonsense, 0, nonsense, 0};
        grow(random, 0, leaf_count, 0, left_share);
    }

    template <class LeftShare>
    void grow(std::mt19937_64& random, std::uint32_t slot, std::uint32_t leaf_count,
              std::uint32_t level, const LeftShare& left_share) {
        depth = std::max(depth, level);
        if (leaf_count == 1) {
            const auto count = static_cast<std::uint32_t>(1 + random() % 3);
            link_leaf(nodes[slot], primitives, count);
            primitives += count;
            return;
        }
        per_level.resize(std::max<std::size_t>(per_level.size(), level + 1));
        ++per_level[level];
        const std::uint32_t rank = free_ranks.back(), left = left_share(leaf_count);
        free_ranks.pop_back();
        link_inner(nodes[slot], rank);
        parent_slot[rank] = slot;
        grow(random, pair_slot(rank), left, level + 1, left_share);
        grow(random, pair_slot(rank) + 1, leaf_count - left, level + 1, left_share);
    }
    [[nodiscard]] std::uint32_t inner() const {
        return static_cast<std::uint32_t>(parent_slot.size());
    }
};

/// Fits level by level, checks the levels, and returns the depth.
std::uint32_t fit(RandomTree& tree) {
    const std::uint32_t inner = tree.inner(), limit = tree.depth + 3;
    std::vector<std::uint32_t> ranks(inner), begin(limit + 1), count(limit + 1);
    HostLauncher<> launcher;
    const TreeLevels levels =
        launch_find_levels(launcher, tree.nodes.data(), inner, ranks.data(),
                           TreeLevels{begin.data(), count.data(), limit, nullptr});
    std::vector<std::uint32_t> found(count);
    while (!found.empty() && found.back() == 0) found.pop_back();
    EXPECT_EQ(found, tree.per_level);
    std::vector<std::uint16_t> heights(inner);
    Arena arena(heights.data(), 1 << 30);
    std::uint32_t depth = ~0u;
    launch_fit_levels(launcher, BoxOfRun{}, tree.nodes.data(), tree.parent_slot.data(), inner,
                      levels, FitLevelsScratch(arena, inner), &depth);
    return depth;
}

void expect_boxes(const RandomTree& tree, std::uint32_t slot, std::uint32_t& end) {
    const BvhNode& node = tree.nodes[slot];
    const std::uint32_t begin = end;
    if (node.is_leaf()) {
        end += node.count;
    } else {
        expect_boxes(tree, node.first, end);
        expect_boxes(tree, node.first + 1, end);
    }
    const Aabb wanted = BoxOfRun{}(begin, end - begin);
    ASSERT_EQ(node.lo, wanted.lo) << "slot " << slot;
    ASSERT_EQ(node.hi, wanted.hi) << "slot " << slot;
}

template <class LeftShare>
void expect_fit(std::uint32_t leaf_count, const LeftShare& left_share) {
    constexpr std::uint64_t seed = 31;
    SCOPED_TRACE("seed " + std::to_string(seed) + ", leaves " + std::to_string(leaf_count));
    std::mt19937_64 random(seed);
    RandomTree tree(random, leaf_count, left_share);
    RandomTree twin = tree;
    EXPECT_EQ(fit(tree), tree.depth);
    std::uint32_t end = 0;
    expect_boxes(tree, 0, end);
    EXPECT_EQ(end, tree.primitives);
    if (tree.depth > 250) return;  // more than the atomic pass's byte per node can tell
    std::uint32_t inner = twin.inner(), depth = ~0u;
    std::vector<std::uint8_t> meeting(inner, 77);
    HostLauncher<> launcher;
    launch_fit_atomic(launcher, BoxOfRun{}, twin.nodes.data(), twin.parent_slot.data(), &inner,
                      inner, meeting.data(), &depth);
    EXPECT_EQ(depth, tree.depth);
    for (std::size_t slot = 0; slot < tree.nodes.size(); ++slot) {
        EXPECT_EQ(tree.nodes[slot].lo, twin.nodes[slot].lo) << "slot " << slot;
        EXPECT_EQ(tree.nodes[slot].hi, twin.nodes[slot].hi) << "slot " << slot;
    }
}

TEST(FitLevels, BalancedTrees) {
    for (const std::uint32_t leaves : {2u, 3u, 8u, 1000u})
        expect_fit(leaves, [](std::uint32_t n) { return n / 2; });
}

TEST(FitLevels, LopsidedTrees) {
    for (const std::uint32_t leaves : {2u, 3u, 200u}) {
        expect_fit(leaves, [](std::uint32_t) { return 1u; });
        expect_fit(leaves, [](std::uint32_t n) { return n - 1; });
        expect_fit(leaves, [](std::uint32_t n) { return 1 + (n - 1) / 7; });
    }
}

TEST(FitLevels, AChainOfAThousandLevels) {
    expect_fit(1001, [](std::uint32_t n) { return n % 2 != 0 ? 1u : n - 1; });
}

TEST(FitLevels, RandomTrees) {
    std::mt19937_64 random(32);
    std::cout << "seed 32\n";
    for (const std::uint32_t leaves : {5u, 40u, 5000u})
        expect_fit(leaves, [&](std::uint32_t n) {
            return static_cast<std::uint32_t>(1 + random() % (n - 1));
        });
}

TEST(FitLevels, LevelSizesAreBounded) {
    EXPECT_EQ(level_size_limit(0, 100), 1u);
    EXPECT_EQ(level_size_limit(6, 100), 64u);
    EXPECT_EQ(level_size_limit(7, 100), 100u);
    EXPECT_EQ(level_size_limit(40, 3'000'000'000u), 3'000'000'000u);
    EXPECT_EQ(inner_node_limit(5, 1), 4u);
    EXPECT_EQ(inner_node_limit(5, 4), 1u);
    EXPECT_EQ(inner_node_limit(5, 5), 0u);
}

}  // namespace
}  // namespace raydix::test
