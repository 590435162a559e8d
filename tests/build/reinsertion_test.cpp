// The build option `reinsertion_rounds`, over all builders: valid trees, the hits of brute force,
// never more cost, and what it does not go with.
#include <gtest/gtest.h>
#include <raydix/check.h>
#include <raydix/error.h>
#include <raydix/model.h>
#include <raydix/rdx.h>
#include <raydix/trace.h>
#include <raydix/wide.h>

#include <cstring>
#include <filesystem>
#include <limits>

#include "support/ray_sets.h"
#include "support/sanitized.h"
#include "support/scenes.h"
#include "support/support.h"
#include "tree/cluster_cases.h"

namespace raydix::test {
namespace {

constexpr std::uint64_t reinsertion_seed = 20180501;
constexpr bool few = thorough == 1;
constexpr Builder builders[] = {
    Builder::karras, Builder::lauterbach, Builder::garanzha, Builder::apetrei, Builder::ploc,
    Builder::hploc,  Builder::binned,     Builder::sweep,    Builder::split,   Builder::sbvh};

class Reinserted : public testing::TestWithParam<Builder> {
protected:
    static BuildOptions options(int rounds, int threads = 0) {
        BuildOptions result;
        result.builder = GetParam();
        result.threads = threads;
        result.reinsertion_rounds = rounds;
        return result;
    }
};

TEST_P(Reinserted, TreesAreValidAndCostNoMore) {
    int cheaper = 0;
    for (const Model& scene : builtin_triangle_scenes(few ? 1000 : 3000)) {
        const Bvh plain = build_bvh(scene.mesh(), options(0));
        const Bvh tree = build_bvh(scene.mesh(), options(8));
        const CheckReport valid = check(tree, scene.mesh());
        EXPECT_TRUE(valid.ok) << scene.name << ": " << valid.broken;
        const TreeStats before = tree_stats(plain), after = tree_stats(tree);
        EXPECT_EQ(after.references, before.references) << scene.name;
        EXPECT_LE(*after.sah, *before.sah * (1 + 1e-6)) << scene.name;
        EXPECT_FALSE(after.depth_bound.has_value());
        cheaper += *after.sah < 0.999 * *before.sah ? 1 : 0;
    }
    EXPECT_GT(cheaper, 0);
}

TEST_P(Reinserted, TreeDoesNotDependOnThreads) {
    const Mesh mesh = random_soup(30'000, reinsertion_seed, 0.2f);
    const std::string one = tree_hash(build_bvh(mesh, options(4, 1)));
    for (const int threads : {2, 8})
        EXPECT_EQ(tree_hash(build_bvh(mesh, options(4, threads))), one) << threads << " threads";
    EXPECT_NE(tree_hash(build_bvh(mesh, options(0, 1))), one);
}

TEST_P(Reinserted, HitsAreThoseOfBruteForce) {
    for (const Model& scene : builtin_triangle_scenes(few ? 500 : 2000)) {
        const Bvh tree = build_bvh(scene.mesh(), options(5));
        const std::vector<Ray> rays = make_mixed_rays(scene, 100 * thorough, reinsertion_seed);
        const std::vector<Hit> expected = trace_brute_force(scene.mesh(), rays);
        const std::vector<Hit> hits = trace(tree, rays);
        const std::vector<Hit> wide = trace(build_wide_bvh(scene.mesh(), options(5)), rays);
        for (std::size_t i = 0; i < rays.size(); ++i) {
            ASSERT_EQ(std::memcmp(&hits[i], &expected[i], sizeof(Hit)), 0)
                << scene.name << ", ray " << i << ", seed " << reinsertion_seed;
            ASSERT_EQ(std::memcmp(&wide[i], &expected[i], sizeof(Hit)), 0)
                << scene.name << ", ray " << i << ", seed " << reinsertion_seed;
        }
    }
}

TEST_P(Reinserted, AnyBoxesGiveAValidTree) {
    BvhBuilder builder;  // one memory for all of them
    Bvh tree;
    for (const BoxInput& input : cluster_inputs(reinsertion_seed)) {
        builder.build(input.boxes, options(3), tree);
        const CheckReport valid = check(tree);
        EXPECT_TRUE(valid.ok) << input.name << ": " << valid.broken;
    }
}

TEST_P(Reinserted, FewBrokenHugeAndEqualTriangles) {
    constexpr float nan = std::numeric_limits<float>::quiet_NaN();
    for (const std::size_t n : {0, 1, 2, 3, 5, 100}) {
        Mesh mesh = random_soup(n, reinsertion_seed + n);
        const std::string what =
            std::to_string(n) + " triangles, seed " + std::to_string(reinsertion_seed + n);
        EXPECT_TRUE(check(build_bvh(mesh.triangles.empty() ? Mesh{} : mesh, options(2)),
                          mesh.triangles.empty() ? Mesh{} : mesh)
                        .ok)
            << what;
        if (n < 5) continue;
        EXPECT_TRUE(check(build_bvh(scaled(mesh, 1e11f), options(2)), scaled(mesh, 1e11f)).ok)
            << what;
        for (std::size_t k = 0; k < mesh.triangles.size(); k += 2)
            mesh.triangles[k] = mesh.triangles[1];
        mesh.vertices[mesh.triangles[3][0]].x = nan;
        const Bvh tree = build_bvh(mesh, options(2));
        EXPECT_GT(tree.left_out(), 0u);
        EXPECT_TRUE(check(tree, mesh).ok) << what;
    }
}

TEST_P(Reinserted, FilesKeepTheNumberOfRounds) {
    const Model scene = scene_of(random_soup(500, reinsertion_seed, 0.2f), "soup");
    const Bvh tree = build_bvh(scene.mesh(), options(7));
    const auto file = std::filesystem::path(testing::TempDir()) /
                      ("reinserted-" + std::string(builder_name(GetParam())) + ".rdx");
    save_rdx(file, tree, scene);
    const RdxFile loaded = load_rdx(file);
    EXPECT_EQ(loaded.bvh.options().reinsertion_rounds, 7);
    EXPECT_EQ(loaded.bvh.options().max_leaf, tree.options().max_leaf);
    EXPECT_EQ(tree_hash(loaded.bvh), tree_hash(tree));
    std::filesystem::remove(file);
}

INSTANTIATE_TEST_SUITE_P(Builders, Reinserted, testing::ValuesIn(builders),
                         [](const auto& builder) {
                             return std::string(builder_name(builder.param));
                         });

TEST(ReinsertionOption, QualityWordsBringTheirs) {
    EXPECT_EQ(build_options_for(Quality::fast).reinsertion_rounds, 0);
    EXPECT_EQ(build_options_for(Quality::balanced).builder, Builder::ploc);
    EXPECT_EQ(build_options_for(Quality::balanced).reinsertion_rounds, 2);
    EXPECT_EQ(build_options_for(Quality::high).builder, Builder::sbvh);
    EXPECT_EQ(build_options_for(Quality::high).reinsertion_rounds, 4);
}

TEST(ReinsertionOption, IsAnErrorOutOfRange) {
    const Mesh mesh = random_soup(10, reinsertion_seed);
    for (const int rounds : {-1, 256}) {
        BuildOptions options;
        options.reinsertion_rounds = rounds;
        EXPECT_THROW(static_cast<void>(build_bvh(mesh, options)), InputError) << rounds;
    }
}

TEST(ReinsertionOption, WideTreesFromMeshesAreThoseFromBinaryTrees) {
    const std::vector<Model> scenes = builtin_triangle_scenes(few ? 500 : 3000);
    std::size_t turn = 0;
    for (const Builder builder : builders) {
        const std::size_t own = turn++ % scenes.size();
        for (const Model& scene : scenes) {
            if (sanitized && &scene != &scenes[own]) continue;  // one scene for each builder
            BuildOptions options = build_options_for(Quality::high);
            options.builder = builder;
            const WideBvh direct = build_wide_bvh(scene.mesh(), options);
            const WideBvh from_binary(build_bvh(scene.mesh(), options));
            EXPECT_EQ(direct.stats().nodes, from_binary.stats().nodes) << scene.name;
            EXPECT_EQ(direct.stats().bytes, from_binary.stats().bytes) << scene.name;
            EXPECT_EQ(direct.stats().sah, from_binary.stats().sah) << scene.name;
        }
    }
}

}  // namespace
}  // namespace raydix::test
