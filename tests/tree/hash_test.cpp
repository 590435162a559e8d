// tree_hash: the documented byte stream, and sensitivity to each thing it covers.
#include <gtest/gtest.h>
#include <raydix/bvh.h>
#include <xxhash.h>

#include <fmt/format.h>

#include <bit>
#include <cstring>

#include "support/support.h"
#include "tree/bvh_internals.h"

namespace raydix::test {
namespace {

std::string hash_of_words(const std::vector<std::uint32_t>& words) {
    std::vector<unsigned char> bytes;
    for (const std::uint32_t word : words)
        for (int k = 0; k < 4; ++k) bytes.push_back(static_cast<unsigned char>(word >> (8 * k)));
    const XXH128_hash_t hash = XXH3_128bits(bytes.data(), bytes.size());
    return fmt::format("{:016x}{:016x}", hash.high64, hash.low64);
}

void append(std::vector<std::uint32_t>& words, const BvhNode& node) {
    for (const float x : {node.lo.x, node.lo.y, node.lo.z, node.hi.x, node.hi.y, node.hi.z})
        words.push_back(std::bit_cast<std::uint32_t>(x));
}

/// The stream by recursion.
void append_subtree(std::vector<std::uint32_t>& words, const Bvh& bvh, std::uint32_t node_index) {
    const BvhNode& node = bvh.nodes()[node_index];
    append(words, node);
    if (node.is_leaf()) {
        words.push_back(node.count);
        for (std::uint32_t i = 0; i < node.count; ++i) words.push_back(bvh.order()[node.first + i]);
        return;
    }
    append_subtree(words, bvh, node.first);
    append_subtree(words, bvh, node.first + 1);
}

TEST(TreeHash, EmptyTreeIsItsHeader) {
    EXPECT_EQ(tree_hash(build_bvh(Mesh{}, {.bits = 30, .max_leaf = 7})), hash_of_words({0, 30, 7}));
}

TEST(TreeHash, OnePoint) {
    const std::vector<Vec3> point{{1, -2, 4}};
    const std::uint32_t one = 0x3F800000, minus_two = 0xC0000000, four = 0x40800000;
    EXPECT_EQ(tree_hash(build_bvh(point)),
              hash_of_words({0, 63, 4, one, minus_two, four, one, minus_two, four, 1, 0}));
}

TEST(TreeHash, StreamOfALargeTree) {
    const Bvh bvh = build_bvh(random_soup(20'000, 6), {.bits = 30, .max_leaf = 3});
    std::vector<std::uint32_t> words{0, 30, 3};
    append_subtree(words, bvh, 0);
    EXPECT_EQ(tree_hash(bvh), hash_of_words(words));
}

TEST(TreeHash, EveryPartCounts) {
    const Mesh mesh = random_soup(100, 6);
    const std::string original = tree_hash(build_bvh(mesh));
    EXPECT_EQ(tree_hash(build_bvh(mesh, {.threads = 3})), original);
    EXPECT_NE(tree_hash(build_bvh(mesh, {.bits = 30})), original);
    EXPECT_NE(tree_hash(build_bvh(mesh, {.max_leaf = 5})), original);

    Bvh bvh = build_bvh(mesh);
    const BvhInternals access{bvh};
    std::swap(access.order()[3], access.order()[4]);
    EXPECT_NE(tree_hash(bvh), original) << "order";
    std::swap(access.order()[3], access.order()[4]);
    EXPECT_EQ(tree_hash(bvh), original);
    access.nodes()[5].hi.z = std::nextafter(access.nodes()[5].hi.z, infinity);
    EXPECT_NE(tree_hash(bvh), original) << "box";
}

TEST(TreeHash, NodeNumbersDoNotCount) {
    Bvh bvh = build_bvh(random_soup(100, 6));
    const std::string original = tree_hash(bvh);
    auto& nodes = BvhInternals{bvh}.nodes();
    for (int k = 0; k < 2; ++k) std::swap(nodes[4 + k], nodes[8 + k]);
    for (std::size_t i = 0; i < nodes.size(); ++i) {
        if (i == 1 || nodes[i].is_leaf()) continue;
        if (nodes[i].first == 4)
            nodes[i].first = 8;
        else if (nodes[i].first == 8)
            nodes[i].first = 4;
    }
    EXPECT_EQ(tree_hash(bvh), original);
}

}  // namespace
}  // namespace raydix::test
