// Statistics of trees small enough to work out by hand, and of larger ones against plain sums.
#include <gtest/gtest.h>
#include <raydix/bvh.h>

#include <bit>

#include "support/reference_tree.h"
#include "support/support.h"

namespace raydix::test {
namespace {

TEST(TreeStats, EmptyTree) {
    const TreeStats stats = tree_stats(build_bvh(Mesh{}));
    EXPECT_EQ(stats.nodes, 0u);
    EXPECT_EQ(stats.leaves, 0u);
    EXPECT_EQ(stats.references, 0u);
    EXPECT_EQ(stats.layout_nodes, 0u);
    EXPECT_EQ(stats.bytes, 0u);
    EXPECT_FALSE(stats.depth_bound);
    EXPECT_FALSE(stats.sah);
    EXPECT_FALSE(stats.epo);
    EXPECT_EQ(stats.tree_hash.size(), 32u);
}

TEST(TreeStats, TwoUnitBoxes) {
    // Two unit cubes at the ends of a 4 x 1 x 1 box: half areas 3, 3 and 9.
    const std::vector<Aabb> boxes{{{0, 0, 0}, {1, 1, 1}}, {{3, 0, 0}, {4, 1, 1}}};
    const Bvh bvh = build_bvh(boxes, {.max_leaf = 1});
    const TreeStats stats = tree_stats(bvh);
    EXPECT_EQ(stats.nodes, 3u);
    EXPECT_EQ(stats.leaves, 2u);
    EXPECT_EQ(stats.references, 2u);
    EXPECT_EQ(stats.layout_nodes, 4u);
    EXPECT_EQ(stats.max_depth, 1u);
    EXPECT_EQ(stats.depth_bound, 64u);
    EXPECT_DOUBLE_EQ(*stats.sah, 1.0 + 3.0 / 9.0 + 3.0 / 9.0);
    EXPECT_EQ(stats.bytes, 4 * 32u + 2 * 4u + 2 * 24u);
    EXPECT_EQ(stats.bytes_referenced, 0u);

    const TreeStats weighted = tree_stats(bvh, {.sah = {.node = 2.0, .primitive = 0.5}});
    EXPECT_DOUBLE_EQ(*weighted.sah, 2.0 + 0.5 * (3.0 / 9.0 + 3.0 / 9.0));
    EXPECT_EQ(weighted.sah_constants.node, 2.0);
}

TEST(TreeStats, OneLeafCostsItsPrimitives) {
    const std::vector<Aabb> boxes{{{0, 0, 0}, {1, 1, 1}}, {{3, 0, 0}, {4, 1, 1}}};
    EXPECT_DOUBLE_EQ(*tree_stats(build_bvh(boxes)).sah, 2.0);
}

TEST(TreeStats, NoAreaNoSah) {
    const std::vector<Vec3> line{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}};
    EXPECT_FALSE(tree_stats(build_bvh(line, {.max_leaf = 1})).sah);
    const std::vector<Vec3> plane{{0, 0, 0}, {1, 0, 0}, {0, 0, 1}};
    EXPECT_TRUE(tree_stats(build_bvh(plane, {.max_leaf = 1})).sah);
}

TEST(TreeStats, DepthBound) {
    const auto bound = [](std::size_t n, int bits) {
        return *tree_stats(build_bvh(std::vector<Vec3>(n, Vec3{1, 1, 1}), {.bits = bits}))
                    .depth_bound;
    };
    EXPECT_EQ(bound(1, 30), 30u);
    EXPECT_EQ(bound(2, 30), 31u);
    EXPECT_EQ(bound(3, 63), 65u);
    EXPECT_EQ(bound(4, 63), 65u);
    EXPECT_EQ(bound(5, 63), 66u);
}

/// The same sum without blocks or threads.
double plain_sah(const Bvh& bvh, std::uint32_t node_index) {
    const auto area = [](const BvhNode& n) {
        const double x = double(n.hi.x) - n.lo.x, y = double(n.hi.y) - n.lo.y,
                     z = double(n.hi.z) - n.lo.z;
        return x * y + y * z + z * x;
    };
    const BvhNode& node = bvh.nodes()[node_index];
    const double share = area(node) / area(bvh.nodes()[0]);
    if (node.is_leaf()) return share * node.count;
    return share + plain_sah(bvh, node.first) + plain_sah(bvh, node.first + 1);
}

TEST(TreeStats, SahOfManyNodes) {
    const Bvh bvh = build_bvh(random_soup(40'000, 4));
    const double expected = plain_sah(bvh, 0);
    const double once = *tree_stats(bvh, {.threads = 1}).sah;
    EXPECT_NEAR(once, expected, 1e-9 * expected);
    for (const int threads : {2, 7}) {
        const double again = *tree_stats(bvh, {.threads = threads}).sah;
        EXPECT_EQ(std::bit_cast<std::uint64_t>(again), std::bit_cast<std::uint64_t>(once))
            << threads;
    }
}

TEST(TreeStats, CountsAgreeWithTheArrays) {
    const Bvh bvh = build_bvh(random_soup(5000, 2), {.max_leaf = 2});
    const TreeStats stats = tree_stats(bvh, {.with_hash = false});
    std::uint64_t leaves = 0, inner = 0;
    for (std::size_t i = 0; i < bvh.nodes().size(); ++i)
        if (i != 1) ++(bvh.nodes()[i].is_leaf() ? leaves : inner);
    EXPECT_EQ(stats.leaves, leaves);
    EXPECT_EQ(stats.nodes, leaves + inner);
    EXPECT_EQ(stats.references, 5000u);
    EXPECT_LE(stats.max_depth, *stats.depth_bound);
    EXPECT_TRUE(stats.tree_hash.empty());
}

}  // namespace
}  // namespace raydix::test
