// build_octree against the octree whose points go in one at a time: every kind of input, both code
// lengths, leaf sizes, levels, threads.
#include <gtest/gtest.h>
#include <raydix/octree.h>

#include <algorithm>

#include "support/octree_inputs.h"
#include "support/octree_reference.h"
#include "support/reference_tree.h"
#include "support/sanitized.h"
#include "support/support.h"

namespace raydix::test {
namespace {

constexpr std::uint64_t octree_seed = 20120625;
constexpr std::size_t size = thorough > 1 ? 2000 : 300;

std::string name_of(const std::string& input, const OctreeOptions& o) {
    return input + ", bits " + std::to_string(o.bits) + ", max_level " +
           std::to_string(o.max_level) + ", max_leaf " + std::to_string(o.max_leaf) + ", threads " +
           std::to_string(o.threads) + ", seed " + std::to_string(octree_seed);
}

void compare(const NamedPoints& input, OctreeOptions options) {
    const ReferenceOctree expected = reference_octree(input.points, options);
    std::string hash;
    for (const int threads : {1, 2, 7}) {
        options.threads = threads;
        SCOPED_TRACE(name_of(input.name, options));
        const Octree built = build_octree(input.points, options);
        ASSERT_EQ(difference(built, expected), "");
        if (hash.empty()) hash = tree_hash(built);
        EXPECT_EQ(tree_hash(built), hash);
        EXPECT_EQ(built.input_count(), input.points.size());
    }
}

TEST(Octree, EqualsTheTreeOfOneInsertionAfterTheOther) {
    for (const NamedPoints& input : octree_inputs(size, octree_seed))
        for (const int bits : {30, 63})
            for (const int max_leaf : {1, 2, 4, 64})
                compare(input, {.bits = bits, .max_leaf = max_leaf});
}

TEST(Octree, EndsAtEveryLevelItIsAskedTo) {
    for (const NamedPoints& input : octree_inputs(size / 4, octree_seed + 1))
        for (const int bits : {30, 63})
            for (int max_level = 0; max_level <= bits / 3; max_level += sanitized ? 4 : 1)
                for (const int max_leaf : {1, 3})
                    compare(input, {.bits = bits, .max_level = max_level, .max_leaf = max_leaf});
}

TEST(Octree, EveryLeafSize) {
    const auto inputs = octree_inputs(200, octree_seed + 2);
    for (const NamedPoints& input : inputs)
        for (int max_leaf = 1; max_leaf <= 64; max_leaf += sanitized ? 21 : 1)
            compare(input, {.max_leaf = max_leaf});
}

TEST(Octree, MillionsOfEqualPointsAreOneChain) {
    const std::vector<Vec3> points(thorough > 1 ? 1'000'000 : 20'000, Vec3{-3, 0, 1e9f});
    for (const int bits : {30, 63}) {
        compare({"equal", points}, {.bits = bits});
        EXPECT_EQ(build_octree(points, {.bits = bits}).nodes().size(),
                  static_cast<std::size_t>(bits / 3 + 1));
    }
}

TEST(Octree, InsertionOrderDoesNotMatter) {
    for (const NamedPoints& input : octree_inputs(size, octree_seed + 3)) {
        const OctreeOptions options{.max_leaf = 2};
        EXPECT_EQ(difference(build_octree(input.points, options),
                             reference_octree(input.points, options, true)),
                  "")
            << name_of(input.name, options);
    }
}

/// Twenty levels of nodes with one child, then the pair apart: what one radix node stands for.
TEST(Octree, ACloseNeighbourMakesAChain) {
    const std::vector<Vec3> points{{0, 0, 0}, {0x1p-21f, 0, 0}, {1, 1, 1}};
    const Octree octree = build_octree(points, {.max_leaf = 1});
    const OctreeStats stats = octree_stats(octree);
    std::vector<std::uint64_t> expected(22, 1);  // the root alone, then ...
    for (std::size_t level = 1; level <= 20; ++level) expected[level] = 1;
    expected[1] = 2;   // ... the far point is a leaf at once ...
    expected[21] = 2;  // ... and the pair part at the last level
    EXPECT_EQ(stats.nodes_per_level, expected);
    EXPECT_EQ(stats.leaves, 3u);
    for (std::uint32_t node = octree.nodes()[0].child(0); octree.nodes()[node].level < 20;
         node = octree.nodes()[node].first_child) {
        EXPECT_EQ(octree.nodes()[node].child_mask, 1u);
        EXPECT_EQ(octree.nodes()[node].point_count, 2u);
    }
}

/// By hand: two bits an axis matter, x is the highest of a triple.
TEST(Octree, SmallTreeByHand) {
    const std::vector<Vec3> points{{4, 4, 4}, {0, 0, 0}, {3, 0, 0}, {0, 2, 0}, {0, 0, 3}};
    const Octree octree = build_octree(points, {.bits = 30, .max_level = 2, .max_leaf = 1});
    const std::vector<OctreeNode> expected{
        {000, no_node, 1, 0, 5, 0b10010111, 0},  // 0: (0 0 0)
        {000, 0, no_node, 0, 1, 0, 1},           // id 1
        {001, 0, no_node, 1, 1, 0, 1},           // id 4: z in the upper half
        {002, 0, no_node, 2, 1, 0, 1},           // id 3: y on the middle plane, so above
        {004, 0, no_node, 3, 1, 0, 1},           // id 2
        {007, 0, no_node, 4, 1, 0, 1},  // id 0: the upper corner of the scene, in the last cell
    };
    EXPECT_TRUE(std::ranges::equal(octree.order(), std::vector<std::uint32_t>{1, 4, 3, 2, 0}));
    ASSERT_EQ(octree.nodes().size(), expected.size());
    for (std::size_t i = 0; i < expected.size(); ++i) {
        EXPECT_EQ(octree.nodes()[i].code, expected[i].code) << i;
        EXPECT_EQ(octree.nodes()[i].parent, expected[i].parent) << i;
        EXPECT_EQ(octree.nodes()[i].first_child, expected[i].first_child) << i;
        EXPECT_EQ(octree.nodes()[i].first_point, expected[i].first_point) << i;
        EXPECT_EQ(octree.nodes()[i].point_count, expected[i].point_count) << i;
        EXPECT_EQ(octree.nodes()[i].child_mask, expected[i].child_mask) << i;
        EXPECT_EQ(octree.nodes()[i].level, expected[i].level) << i;
    }
}

}  // namespace
}  // namespace raydix::test
