// Wide trees as they lie in memory: every node and triangle once, every box around what is below
// it.
#include <gtest/gtest.h>
#include <raydix/raydix.h>
#include <raydix/wide.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "layout/wide_bvh.h"
#include "primitives/zero_area.h"
#include "support/scenes.h"
#include "support/support.h"

namespace raydix::test {
namespace {

class Walk {
public:
    explicit Walk(const WideBvh& tree) : arrays_(tree.arrays()), nodes_(arrays_.nodes.size()) {}

    /// The box of all triangles below; checks each child's box on the way.
    Aabb below(std::uint32_t w, std::uint32_t depth = 0) {
        EXPECT_EQ(nodes_.at(w)++, 0);
        const WideNode& node = arrays_.nodes[w];
        Aabb all = empty_box();
        for (int s = 0; s < 8; ++s) {
            const std::uint32_t word = node.child[s];
            EXPECT_EQ((node.used >> s & 1) != 0, word != wide_no_child);
            if (word == wide_no_child) continue;
            deepest = std::max(deepest, depth + 1);
            const Aabb box = (word & wide_leaf_bit) != 0 ? leaf_box(word) : below(word, depth + 1);
            EXPECT_TRUE(contains_exactly(node, s, box)) << "node " << w << ", slot " << s;
            all = unite(all, box);
        }
        return all;
    }
    [[nodiscard]] bool every_node_once() const {
        return std::ranges::all_of(nodes_, [](int times) { return times == 1; });
    }

    std::map<std::uint32_t, int> seen;  // triangle -> references
    std::uint32_t deepest = 0;

private:
    Aabb leaf_box(std::uint32_t word) {
        const std::uint32_t place = (word & ~wide_leaf_bit) >> 3, count = (word & 7) + 1;
        EXPECT_LE(place % 8 + count, 8u);
        EXPECT_LE(count, wide_max_leaf);
        const TriangleBlock& block = arrays_.blocks[place / 8];
        Aabb box = empty_box();
        for (std::uint32_t lane = place % 8; lane < place % 8 + count; ++lane) {
            ++seen[block.prim[lane]];
            EXPECT_TRUE(places_.emplace(place / 8 * 8 + lane, 0).second);
            for (int v = 0; v < 3; ++v) {
                const Vec3 p{block.corner[3 * v][lane], block.corner[3 * v + 1][lane],
                             block.corner[3 * v + 2][lane]};
                box = unite(box, {p, p});
            }
        }
        return box;
    }

    const WideBvh::Arrays& arrays_;
    std::vector<int> nodes_;
    std::map<std::uint32_t, int> places_;
};

void expect_sound(const Mesh& mesh, const BuildOptions& options, int width = 8) {
    const Bvh bvh = build_bvh(mesh, options);
    const WideBvh tree(bvh, {.width = width});
    std::uint64_t with_area = 0;
    for (const LeafTriangle& t : bvh.triangles()) with_area += !has_zero_area(t);
    const WideBvhStats& stats = tree.stats();
    EXPECT_EQ(stats.references, with_area);
    if (tree.arrays().nodes.empty()) return;
    Walk walk(tree);
    walk.below(0);
    EXPECT_TRUE(walk.every_node_once());
    EXPECT_LE(walk.deepest, stats.max_depth);
    std::map<std::uint32_t, int> wanted;
    for (std::size_t k = 0; k < bvh.order().size(); ++k)
        if (!has_zero_area(bvh.triangles()[k])) ++wanted[bvh.order()[k]];
    EXPECT_EQ(walk.seen, wanted);
    EXPECT_EQ(stats.bytes, stats.nodes * 96 + tree.arrays().blocks.size() * 320);
    EXPECT_GE(stats.widening, 1.0 - 1e-12);
    EXPECT_LE(stats.children_per_node, width);
}

TEST(WideLayout, HoldsEveryTriangleInItsBoxes) {
    for (const std::size_t n : {1u, 2u, 3u, 4u, 5u, 8u, 9u, 33u, 1000u, 20'000u})
        for (const int width : {4, 8}) {
            expect_sound(random_soup(n, n), {}, width);
            expect_sound(lattice_mesh(n, 7, n), {.builder = Builder::binned, .max_leaf = 1}, width);
        }
    for (const float scale : {1e-9f, 1e12f}) expect_sound(scaled(random_soup(500, 3), scale), {});
    expect_sound(moved(random_soup(500, 3), {1e9f, -1e9f, 1e3f}), {});
}

TEST(WideLayout, LeavesOutWhatHasNoArea) {
    Mesh mesh = random_soup(300, 5);
    for (std::size_t k = 0; k < 300; k += 2) mesh.triangles[k][1] = mesh.triangles[k][0];
    expect_sound(mesh, {});
    for (Triangle& t : mesh.triangles) t[1] = t[0];
    expect_sound(mesh, {});
}

TEST(WideLayout, WastesLittleOnBlocks) {
    const WideBvh tree(build_bvh(random_soup(20'000, 1), {.max_leaf = 1}));
    const auto places = static_cast<double>(8 * tree.arrays().blocks.size());
    EXPECT_LT(places, 1.1 * static_cast<double>(tree.stats().references));
}

TEST(WideLayout, IsTheSameForEveryThreadCount) {
    const Bvh bvh = build_bvh(random_soup(5000, 2));
    const WideBvh one(bvh, {.threads = 1}), many(bvh, {.threads = 5});
    EXPECT_TRUE(std::ranges::equal(std::as_bytes(one.arrays().nodes.view()),
                                   std::as_bytes(many.arrays().nodes.view())));
    EXPECT_TRUE(std::ranges::equal(std::as_bytes(one.arrays().blocks.view()),
                                   std::as_bytes(many.arrays().blocks.view())));
}

}  // namespace
}  // namespace raydix::test
