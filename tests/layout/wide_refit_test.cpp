// Refits of wide trees: the bits of a build where nothing moved, boxes as a plain walk finds them
// where all did, the same for any number of threads, and memory that goes from tree to tree.
#include "layout/wide_refit.h"

#include <gtest/gtest.h>
#include <raydix/mesh.h>
#include <raydix/model.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <optional>
#include <vector>

#include "exec/parallel.h"
#include "layout/about_middle.h"
#include "support/random.h"
#include "support/support.h"

namespace raydix {
namespace {

using Tree = std::shared_ptr<const WideBvh>;

bool is_leaf(std::uint32_t word) { return word != wide_no_child && (word & wide_leaf_bit) != 0; }

Mesh waves(float phase) {
    static const Mesh still = load_flat_model("builtin:figure?triangles=5000").mesh();
    Mesh mesh = still;
    for (Vec3& v : mesh.vertices) v.x += 0.1f * std::sin(3 * v.y + phase);
    return mesh;
}

/// The exact box of a word of a tree, by its triangles in the mesh.
Aabb box_of_word(const WideBvh::Arrays& tree, const Mesh& mesh, std::uint32_t word) {
    Aabb box = empty_box();
    if (is_leaf(word)) {
        const std::uint32_t place = (word & ~wide_leaf_bit) >> 3;
        for (std::uint32_t p = place; p <= place + (word & 7); ++p) {
            const std::uint32_t prim = tree.blocks[p / block_lanes].prim[p % block_lanes];
            for (const std::uint32_t v : mesh.triangles[prim]) {
                const Vec3 at = without_negative_zero(mesh.vertices[v]);
                box = unite(box, {at, at});
            }
        }
        return box;
    }
    for (const std::uint32_t child : tree.nodes[word].child)
        if (child != wide_no_child) box = unite(box, box_of_word(tree, mesh, child));
    return box;
}

/// Compares every box, corner and bound with what the mesh says, bit by bit.
void expect_fits(const WideBvh& wide, const Mesh& mesh) {
    const WideBvh::Arrays& tree = wide.arrays();
    double areas = 0;
    for (const WideNode& node : tree.nodes.view()) {
        SlotBoxes boxes;
        Aabb all = empty_box();
        for (int s = 0; s < quantised_width; ++s) {
            if (node.child[s] == wide_no_child) continue;
            const Aabb box = box_of_word(tree, mesh, node.child[s]);
            boxes.set(s, box);
            all = unite(all, box);
            if (is_leaf(node.child[s]))
                areas += wide_primitive_cost * ((node.child[s] & 7) + 1) * half_area(box);
        }
        areas += half_area(all);
        WideNode wanted = node;
        set_boxes_about(tree.middle, boxes, wanted);
        ASSERT_EQ(std::memcmp(&wanted, &node, sizeof node), 0);
    }
    const Aabb bounds = box_of_word(tree, mesh, 0);
    EXPECT_EQ(std::memcmp(&bounds, &tree.bounds, sizeof bounds), 0);
    EXPECT_NEAR(wide.stats().sah, areas / half_area(bounds), 1e-9 * wide.stats().sah);
}

/// Nodes, and the lanes of blocks that leaves have.
void expect_same_bits(const WideBvh& a, const WideBvh& b) {
    const WideBvh::Arrays &x = a.arrays(), &y = b.arrays();
    ASSERT_EQ(x.nodes.size(), y.nodes.size());
    EXPECT_EQ(std::memcmp(x.nodes.data(), y.nodes.data(), x.nodes.size() * sizeof(WideNode)), 0);
    for (const WideNode& node : x.nodes.view())
        for (const std::uint32_t word : node.child) {
            if (!is_leaf(word)) continue;
            const std::uint32_t place = (word & ~wide_leaf_bit) >> 3;
            for (std::uint32_t p = place; p <= place + (word & 7); ++p)
                for (int k = 0; k < 9; ++k)
                    ASSERT_EQ(x.blocks[p / block_lanes].corner[k][p % block_lanes],
                              y.blocks[p / block_lanes].corner[k][p % block_lanes]);
        }
    EXPECT_EQ(std::memcmp(&x.frame, &y.frame, sizeof x.frame), 0);
}

TEST(WideRefit, WithoutMovesGivesTheBitsOfTheBuild) {
    for (const Quality quality : {Quality::fast, Quality::balanced})
        for (const std::size_t triangles : {1, 2, 3, 4, 5, 9, 300, 5000}) {
            SCOPED_TRACE(triangles);
            const Mesh mesh = test::random_soup(triangles, 5 + triangles, 0.1f);
            const WideBvh tree = build_wide_bvh(mesh, build_options_for(quality));
            const auto refitter = WideRefitter::of(tree);
            ASSERT_NE(refitter, nullptr);
            const Tree again = refitter->refit(tree, mesh);
            ASSERT_NE(again, nullptr);
            expect_same_bits(tree, *again);
            EXPECT_NEAR(again->stats().sah, tree.stats().sah, 1e-9 * tree.stats().sah);
        }
}

TEST(WideRefit, BoxesAreThoseOfMovedTrianglesForAnyThreads) {
    const Mesh mesh = waves(0);
    const WideBvh tree = build_wide_bvh(mesh);
    const auto refitter = WideRefitter::of(tree);
    ASSERT_NE(refitter, nullptr);
    for (int frame = 1; frame < 4; ++frame) {
        const Mesh moved = waves(static_cast<float>(frame));
        Tree one, many;
        with_threads(1, [&] { one = refitter->refit(tree, moved); });
        with_threads(8, [&] { many = refitter->refit(*one, moved); });
        ASSERT_NE(one, nullptr);
        ASSERT_NE(many, nullptr);
        expect_fits(*one, moved);
        expect_same_bits(*one, *many);
        EXPECT_EQ(one->stats().sah, many->stats().sah);
    }
}

TEST(WideRefit, VerticesOfNoTriangleAreOutOfTheBounds) {
    Mesh mesh = waves(0);
    const WideBvh tree = build_wide_bvh(mesh);
    const auto refitter = WideRefitter::of(tree);
    mesh = waves(1);
    mesh.vertices.push_back({1e6f, -1e7f, 12});
    for (int turn = 0; turn < 2; ++turn) {  // the second one knows
        const Tree moved = refitter->refit(tree, mesh);
        ASSERT_NE(moved, nullptr);
        expect_fits(*moved, mesh);
    }
    mesh.vertices.back().y = std::numeric_limits<float>::quiet_NaN();
    const Tree moved = refitter->refit(tree, mesh);
    ASSERT_NE(moved, nullptr);
    expect_fits(*moved, mesh);
}

TEST(WideRefit, SaysNoWhereATreeCannotStay) {
    const Mesh mesh = waves(0);
    const WideBvh tree = build_wide_bvh(mesh);
    const auto refitter = WideRefitter::of(tree);
    const auto refitted = [&](const Mesh& other) {
        return refitter->refit(tree, other) != nullptr;
    };
    EXPECT_TRUE(refitted(mesh));
    for (const float odd : {std::numeric_limits<float>::quiet_NaN(), infinity, -2e12f}) {
        Mesh other = mesh;
        other.vertices[mesh.triangles[1234][2]].z = odd;
        EXPECT_FALSE(refitted(other)) << odd;
    }
    Mesh other = mesh;
    other.vertices[mesh.triangles[77][0]] = other.vertices[mesh.triangles[77][1]];
    EXPECT_FALSE(refitted(other));
    for (Vec3& v : other.vertices) v = {1, 2, 3};
    EXPECT_FALSE(refitted(other));
    other = mesh;
    for (Vec3& v : other.vertices) v = v * 1e-16f;  // too small to count
    EXPECT_FALSE(refitted(other));
    other = mesh;
    other.triangles.pop_back();
    EXPECT_FALSE(refitted(other));
    EXPECT_TRUE(refitted(mesh));
    const Tree again = refitter->refit(tree, mesh);
    expect_same_bits(tree, *again);
    EXPECT_EQ(WideRefitter::of(build_wide_bvh(mesh, {}, {.compact = true})), nullptr);
    EXPECT_EQ(WideRefitter::of(WideBvh()), nullptr);
}

TEST(WideRefit, TrianglesWithoutAreaStayOutAndCountForTheBounds) {
    Mesh mesh = waves(0);
    const auto flat = static_cast<std::uint32_t>(mesh.vertices.size());
    mesh.vertices.push_back({9, 9, 9});
    mesh.vertices.push_back({9, 12, 9});
    mesh.triangles.push_back({flat, flat + 1, flat});
    const WideBvh tree = build_wide_bvh(mesh);
    const auto refitter = WideRefitter::of(tree);
    const Tree again = refitter->refit(tree, mesh);
    ASSERT_NE(again, nullptr);
    expect_same_bits(tree, *again);
    EXPECT_EQ(again->arrays().bounds.hi.y, 12);
    mesh.vertices[flat].x = std::numeric_limits<float>::quiet_NaN();
    const Tree without = refitter->refit(*again, mesh);
    ASSERT_NE(without, nullptr);
    EXPECT_EQ(without->stats().left_out, 1u);
    EXPECT_LT(without->arrays().bounds.hi.y, 12);
    mesh.triangles.back() = {flat + 1, 0, 1};
    EXPECT_EQ(refitter->refit(*again, mesh), nullptr);
}

TEST(WideRefit, MemoryGoesFromTreesThatNobodyHoldsToNewOnes) {
    const Mesh mesh = waves(0);
    const WideBvh tree = build_wide_bvh(mesh);
    auto refitter = WideRefitter::of(tree);
    Tree first = refitter->refit(tree, mesh);
    const Tree second = refitter->refit(*first, waves(1));
    const auto* const memory = first->arrays().blocks.data();
    EXPECT_NE(second->arrays().blocks.data(), memory);
    first = nullptr;
    const Tree third = refitter->refit(*second, waves(2));
    EXPECT_EQ(third->arrays().blocks.data(), memory);
    expect_fits(*second, waves(1));
    expect_fits(*third, waves(2));
    refitter = nullptr;  // trees outlive it
    expect_fits(*third, waves(2));
}

}  // namespace
}  // namespace raydix
