// Neighbours of nodes against a search over all nodes: by cells, and by cubes in space.
#include <gtest/gtest.h>
#include <raydix/error.h>
#include <raydix/octree.h>

#include "support/octree_inputs.h"
#include "support/support.h"

namespace raydix::test {
namespace {

constexpr std::uint64_t octree_neighbour_seed = 5;

struct Cells {
    std::int64_t level, x, y, z;
};
Cells cells_of(const OctreeNode& node) {
    Cells cells{node.level, 0, 0, 0};
    for (int bit = 0; bit < static_cast<int>(node.level); ++bit) {
        const std::uint64_t triple = node.code >> (3 * bit);
        cells.x |= static_cast<std::int64_t>(triple >> 2 & 1) << bit;
        cells.y |= static_cast<std::int64_t>(triple >> 1 & 1) << bit;
        cells.z |= static_cast<std::int64_t>(triple & 1) << bit;
    }
    return cells;
}

/// Every node is looked at: the wanted cell itself, or a leaf of a higher level around it.
std::uint32_t search(const Octree& octree, std::uint32_t node_index, Direction d) {
    Cells wanted = cells_of(octree.nodes()[node_index]);
    wanted.x += d.dx;
    wanted.y += d.dy;
    wanted.z += d.dz;
    for (std::uint32_t i = 0; i < octree.nodes().size(); ++i) {
        const OctreeNode& node = octree.nodes()[i];
        const Cells c = cells_of(node);
        if (c.level > wanted.level || (c.level < wanted.level && !node.is_leaf())) continue;
        const auto up = wanted.level - c.level;
        if (wanted.x >> up == c.x && wanted.y >> up == c.y && wanted.z >> up == c.z) return i;
    }
    return no_node;
}

TEST(OctreeNeighbour, EqualsASearchOverAllNodes) {
    std::size_t same = 0, coarser = 0, none = 0;
    for (const NamedPoints& input : octree_inputs(120, octree_neighbour_seed))
        for (const int bits : {30, 63})
            for (const int max_leaf : {1, 5}) {
                const Octree octree =
                    build_octree(input.points, {.bits = bits, .max_leaf = max_leaf});
                SCOPED_TRACE(input.name + ", seed " + std::to_string(octree_neighbour_seed));
                // Long trees are sampled: all nodes against all nodes takes a while.
                const std::size_t step = 1 + octree.nodes().size() / (thorough > 1 ? 200 : 20);
                for (std::uint32_t node = 0; node < octree.nodes().size();
                     node += static_cast<std::uint32_t>(step)) {
                    const auto all = neighbours(octree, node);
                    const auto directions = all_directions();
                    for (std::size_t k = 0; k < 26; ++k) {
                        const std::uint32_t found = neighbour(octree, node, directions[k]);
                        ASSERT_EQ(found, search(octree, node, directions[k])) << node << " " << k;
                        ASSERT_EQ(found, all[k]);
                        if (found == no_node)
                            ++none;
                        else
                            ++(octree.nodes()[found].level == octree.nodes()[node].level ? same
                                                                                         : coarser);
                    }
                }
            }
    EXPECT_GT(same, 1000u);
    EXPECT_GT(coarser, 1000u);
    EXPECT_GT(none, 1000u);
}

float middle(float lo, float hi) { return 0.5f * (lo + hi); }
bool holds(const Aabb& box, Vec3 p) {
    return box.lo.x <= p.x && p.x < box.hi.x && box.lo.y <= p.y && p.y < box.hi.y &&
           box.lo.z <= p.z && p.z < box.hi.z;
}

/// A scene whose cubes are exact floats: the neighbour of a leaf is what holds the centre of its
/// cube moved by one edge.
TEST(OctreeNeighbour, LeavesByTheirCubesInSpace) {
    std::vector<Vec3> points{{0, 0, 0}, {16, 16, 16}};
    std::mt19937_64 random(octree_neighbour_seed);
    for (int i = 0; i < 400; ++i)
        points.push_back({static_cast<float>(random() % 16), static_cast<float>(random() % 16),
                          static_cast<float>(random() % 8)});
    const Octree octree = build_octree(points, {.max_level = 4, .max_leaf = 2});
    std::vector<Aabb> boxes;
    for (std::uint32_t i = 0; i < octree.nodes().size(); ++i) boxes.push_back(node_box(octree, i));
    std::size_t found_any = 0;
    for (std::uint32_t i = 0; i < octree.nodes().size(); ++i) {
        if (!octree.nodes()[i].is_leaf()) continue;
        const Aabb box = boxes[i];
        const float edge = box.hi.x - box.lo.x;
        ASSERT_EQ(edge, 16.0f / static_cast<float>(1u << octree.nodes()[i].level));
        for (const Direction d : all_directions()) {
            const Vec3 there{middle(box.lo.x, box.hi.x) + edge * static_cast<float>(d.dx),
                             middle(box.lo.y, box.hi.y) + edge * static_cast<float>(d.dy),
                             middle(box.lo.z, box.hi.z) + edge * static_cast<float>(d.dz)};
            std::uint32_t expected = no_node;
            for (std::uint32_t j = 0; j < octree.nodes().size(); ++j) {
                const OctreeNode& other = octree.nodes()[j];
                const bool eligible = other.level == octree.nodes()[i].level ||
                                      (other.level < octree.nodes()[i].level && other.is_leaf());
                if (eligible && holds(boxes[j], there)) expected = j;
            }
            EXPECT_EQ(neighbour(octree, i, d), expected);
            found_any += expected != no_node ? 1 : 0;
        }
    }
    EXPECT_GT(found_any, 500u);
}

TEST(OctreeNeighbour, ManyAtOnceAreTheSameAsOneByOne) {
    const Octree octree = build_octree(octree_inputs(3000, octree_neighbour_seed)[5].points);
    std::vector<std::uint32_t> nodes;
    for (std::uint32_t i = 0; i < octree.nodes().size(); ++i)
        nodes.push_back(static_cast<std::uint32_t>(octree.nodes().size()) - 1 - i);
    for (const Direction d : all_directions()) {
        std::vector<std::uint32_t> expected;
        for (const std::uint32_t node : nodes) expected.push_back(neighbour(octree, node, d));
        for (const int threads : {1, 2, 7})
            EXPECT_EQ(neighbour(octree, nodes, d, threads), expected);
    }
    nodes[7] = no_node;
    EXPECT_THROW((void)neighbour(octree, nodes, {1, 0, 0}), InputError);
    nodes.clear();
    EXPECT_TRUE(neighbour(octree, nodes, {1, 0, 0}).empty());
    EXPECT_THROW((void)neighbour(octree, nodes, {0, 0, 0}), InputError);
}

TEST(OctreeNeighbour, BadQuestions) {
    const std::vector<Vec3> points{{0, 0, 0}, {1, 1, 1}};
    const Octree octree = build_octree(points, {.max_leaf = 1});
    EXPECT_THROW((void)neighbour(octree, 3, {1, 0, 0}), InputError);
    EXPECT_THROW((void)neighbour(octree, no_node, {1, 0, 0}), InputError);
    EXPECT_THROW((void)neighbour(octree, 0, {0, 0, 0}), InputError);
    EXPECT_THROW((void)neighbour(octree, 0, {0, 2, 0}), InputError);
    EXPECT_THROW((void)neighbours(octree, 3), InputError);
    for (const std::uint32_t found : neighbours(octree, 0)) EXPECT_EQ(found, no_node);
    EXPECT_EQ(neighbour(octree, 1, {1, 1, 1}), 2u);
    EXPECT_EQ(neighbour(octree, 2, {-1, -1, -1}), 1u);
    EXPECT_EQ(neighbour(octree, 1, {1, 1, 0}), no_node);  // no points there
}

}  // namespace
}  // namespace raydix::test
