// Builders ploc and hploc against their definitions, and what holds for every tree of theirs.
#include <gtest/gtest.h>
#include <raydix/check.h>
#include <raydix/model.h>
#include <raydix/rdx.h>
#include <raydix/trace.h>

#include <algorithm>

#include <cmath>
#include <cstring>

#include "support/ray_sets.h"
#include "support/reference_clusters.h"
#include "support/scenes.h"
#include "tree/cluster_cases.h"

namespace raydix::test {
namespace {

BuildOptions options_of(Builder builder, int max_leaf = 4, int threads = 0) {
    BuildOptions options;
    options.builder = builder;
    options.max_leaf = max_leaf;
    options.threads = threads;
    return options;
}

class Clusters : public testing::TestWithParam<Builder> {
protected:
    [[nodiscard]] BuildOptions options(int max_leaf = 4, int threads = 0) const {
        return options_of(GetParam(), max_leaf, threads);
    }
    [[nodiscard]] Bvh reference(std::span<const Aabb> boxes, const BuildOptions& build) const {
        switch (GetParam()) {
            case Builder::ploc:
                return reference_ploc(boxes, build);
            case Builder::hploc:
                return reference_hploc(boxes, build);
            default:
                return reference_binned(boxes, build);
        }
    }
};

TEST_P(Clusters, GivesTheTreeOfTheDefinition) {
    constexpr std::uint64_t seed = 20180501;
    for (const BoxInput& input : cluster_inputs(seed))
        for (const int max_leaf : {1, 4, 255})
            for (const int bits : {30, 63}) {
                if (thorough == 1 && (bits == 30) == (max_leaf == 4)) continue;
                SCOPED_TRACE(input.name + ", max_leaf " + std::to_string(max_leaf) + ", bits " +
                             std::to_string(bits) + ", seed " + std::to_string(seed));
                BuildOptions build = options(max_leaf);
                build.bits = bits;
                const Bvh tree = build_bvh(input.boxes, build);
                const CheckReport valid = check(tree);
                ASSERT_TRUE(valid.ok) << valid.broken;
                const CheckReport same = check_same(tree, reference(input.boxes, build));
                ASSERT_TRUE(same.ok) << same.broken;
            }
}

TEST_P(Clusters, TreeDoesNotDependOnThreads) {
    for (const Model& scene : builtin_triangle_scenes(thorough * 2000)) {
        const std::string one = tree_hash(build_bvh(scene.mesh(), options(4, 1)));
        for (const int threads : {2, 7})
            EXPECT_EQ(tree_hash(build_bvh(scene.mesh(), options(4, threads))), one)
                << scene.name << ", " << threads << " threads";
    }
}

TEST_P(Clusters, RebuildingIntoKeptMemoryGivesTheSameTree) {
    BvhBuilder builder;
    Bvh tree;
    for (const std::size_t n : {3000, 40, 1, 0, 5000, 2}) {
        const Mesh mesh = random_soup(n, n);
        builder.build(mesh, options(), tree);
        if (mesh.triangles.empty()) continue;
        const CheckReport same = check_same(tree, build_bvh(mesh, options()));
        EXPECT_TRUE(same.ok) << n << " triangles: " << same.broken;
    }
}

TEST_P(Clusters, HitsAreThoseOfBruteForce) {
    constexpr std::uint64_t seed = 7;
    for (const Model& scene : builtin_triangle_scenes(2000)) {
        const Bvh tree = build_bvh(scene.mesh(), options());
        const CheckReport valid = check(tree, scene.mesh());
        ASSERT_TRUE(valid.ok) << scene.name << ": " << valid.broken;
        const std::vector<Ray> rays = make_mixed_rays(scene, 100 * thorough, seed);
        const std::vector<Hit> hits = trace(tree, rays);
        const std::vector<Hit> expected = trace_brute_force(scene.mesh(), rays);
        for (std::size_t i = 0; i < rays.size(); ++i)
            ASSERT_EQ(std::memcmp(&hits[i], &expected[i], sizeof(Hit)), 0)
                << scene.name << ", ray " << i << ", seed " << seed;
    }
}

TEST_P(Clusters, SahIsBetterThanThatOfTheRadixTree) {
    for (const Model& scene : builtin_triangle_scenes(thorough * 2000)) {
        const auto sah = [&](Builder builder) {
            return *tree_stats(build_bvh(scene.mesh(), options_of(builder))).sah;
        };
        EXPECT_LT(sah(GetParam()), sah(Builder::karras)) << scene.name;
    }
}

TEST_P(Clusters, LeavesAscendAndTheLeftChildHoldsTheSmallestId) {
    const Mesh mesh = random_soup(2000, 5);
    const Bvh tree = build_bvh(mesh, options());
    const std::span<const BvhNode> nodes = tree.nodes();
    std::vector<std::uint32_t> least(nodes.size());
    for (std::size_t slot = nodes.size(); slot-- > 0;) {  // preorder: children stand behind
        if (slot == 1) continue;
        const BvhNode& node = nodes[slot];
        if (node.is_leaf()) {
            const auto ids = tree.order().subspan(node.first, node.count);
            EXPECT_TRUE(std::ranges::is_sorted(ids));
            least[slot] = ids.front();
        } else {
            ASSERT_GT(node.first, slot);
            EXPECT_LT(least[node.first], least[node.first + 1]);
            least[slot] = least[node.first];
        }
    }
    EXPECT_EQ(least[0], 0u);
}

TEST_P(Clusters, AMillionEqualPointsGiveAShallowTree) {
    const std::size_t n = 50'000 * thorough;
    const std::vector<Vec3> points(n, Vec3{1, 2, 3});
    const Bvh tree = build_bvh(points, options());
    EXPECT_LE(tree.max_depth(), 32u);
    EXPECT_EQ(tree.order().size(), n);
    EXPECT_TRUE(check(tree).ok);
}

/// Boxes one inside the other: in each round the two smallest are all that agree, so a million
/// would take a million rounds over a million clusters.
TEST_P(Clusters, NestedBoxesDoNotTakeARoundPerPair) {
    std::vector<Aabb> boxes;
    for (std::size_t i = 0; i < 10'000 * thorough; ++i) {
        const float size = 1.0f + 1e-5f * static_cast<float>(i);
        boxes.push_back({{0, 0, 0}, {size, size, size}});
    }
    const Bvh tree = build_bvh(boxes, options());
    EXPECT_TRUE(check(tree).ok);
    EXPECT_LE(tree.max_depth(), 1100u);  // a list of 1024 may still become a chain
}

/// Boxes one inside the other: each is nearest to the one before, so the tree is a chain, deeper
/// than the array that stacks of radix trees fit into.
TEST_P(Clusters, DeepTreesAreTracedSavedAndLoaded) {
    const Model scene = scene_of(nested_triangles(280), "chain");
    const Bvh tree = build_bvh(scene.mesh(), options(1));
    // From the top down, such boxes are divided evenly.
    const std::uint32_t least_depth = GetParam() == Builder::ploc    ? 96
                                      : GetParam() == Builder::hploc ? 32
                                                                     : 1;
    EXPECT_GT(tree.max_depth(), least_depth);
    const CheckReport valid = check(tree, scene.mesh());
    ASSERT_TRUE(valid.ok) << valid.broken;
    const std::vector<Ray> rays = make_mixed_rays(scene, 2000, 3);
    const std::vector<Hit> hits = trace(tree, rays),
                           expected = trace_brute_force(scene.mesh(), rays);
    ASSERT_EQ(std::memcmp(hits.data(), expected.data(), hits.size() * sizeof(Hit)), 0);

    const TempFolder folder;
    save_rdx(folder.path() / "chain.rdx", tree, scene);
    const RdxFile loaded = load_rdx(folder.path() / "chain.rdx");
    const CheckReport same = check_same(tree, loaded.bvh);
    EXPECT_TRUE(same.ok) << same.broken;
    EXPECT_EQ(loaded.bvh.options().builder, GetParam());
    EXPECT_EQ(tree_hash(loaded.bvh), tree_hash(tree));
}

/// More primitives than one task takes: the first planes are found over runs of neighbours, which
/// may not cost much. The sizes of boxes differ, and some lie in dense clumps.
TEST(Binned, PlanesOverRunsAreHardlyWorse) {
    constexpr std::uint64_t seed = 11;
    std::mt19937_64 random(seed);
    const auto unit = [&] { return static_cast<float>(random() >> 40) * 0x1p-24f; };
    std::vector<Aabb> boxes;
    for (int i = 0; i < 100'000; ++i) {
        const float scale = i % 3 == 0 ? 0.05f : 1.0f, size = 0.01f * scale * unit();
        const Vec3 p{scale * unit(), scale * unit(), scale * unit()};
        boxes.push_back({p, {p.x + size, p.y + size, p.z + size}});
    }
    const Bvh tree = build_bvh(boxes, options_of(Builder::binned));
    const CheckReport valid = check(tree);
    ASSERT_TRUE(valid.ok) << valid.broken;
    EXPECT_LE(tree.max_depth(), 96u + 32u);
    const auto sah = [&](Builder builder) {
        return *tree_stats(build_bvh(boxes, options_of(builder))).sah;
    };
    EXPECT_LT(*tree_stats(tree).sah, 0.99 * sah(Builder::ploc)) << "seed " << seed;
    const std::string hash = tree_hash(tree);
    for (const int threads : {1, 2, 7})
        EXPECT_EQ(tree_hash(build_bvh(boxes, options_of(Builder::binned, 4, threads))), hash);
}

INSTANTIATE_TEST_SUITE_P(Builders, Clusters,
                         testing::Values(Builder::ploc, Builder::hploc, Builder::binned),
                         [](const auto& p) { return std::string(builder_name(p.param)); });

}  // namespace
}  // namespace raydix::test
