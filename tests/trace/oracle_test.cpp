// Closest hits against judges that share no code with the library: double precision and Embree.
// Same triangle, an exact tie, or t within rounding; a ray within rounding of an edge is told apart
// and anything else is wrong.
#include "support/oracle.h"

#include <gtest/gtest.h>
#include <raydix/raydix.h>
#include <raydix/trace.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <iostream>
#include <vector>

#include "exec/parallel.h"
#include "support/line_tree.h"
#include "support/ray_sets.h"
#include "support/sanitized.h"
#include "support/scenes.h"
#include "support/support.h"

namespace raydix::test {
namespace {

constexpr std::uint64_t oracle_seed = 777;

/// Rays that are not aimed at edges or limits: hardly any may be excused as grazing.
bool is_ordinary(RaySet set) { return set == RaySet::camera || set == RaySet::through_box; }

void add(Tally& sum, const Tally& part) {
    sum.rays += part.rays;
    sum.hits += part.hits;
    sum.exact += part.exact;
    sum.ties += part.ties;
    sum.both_miss += part.both_miss;
    sum.grazing += part.grazing;
    sum.wrong += part.wrong;
    sum.first_wrong += part.first_wrong;
}

/// `other` answers rays; every set of rays is judged by itself.
template <class Other>
void expect_like(const Model& scene, const std::string& peer, std::size_t rays_per_set,
                 const Other& other) {
    ASSERT_FALSE(scene.mesh().triangles.empty()) << scene.name;
    const Bvh bvh = build_bvh(scene.mesh());
    Tally sum;
    for (int k = 0; k < static_cast<int>(RaySet::count); ++k) {
        const auto set = static_cast<RaySet>(k);
        // Both judges stop short of float's limits: 1e-30 to 1e30 is for the bit comparisons.
        if (set == RaySet::any_length) continue;
        const auto rays = make_rays(scene, set, rays_per_set, oracle_seed);
        const std::vector<Hit> ours = trace(bvh, rays), theirs = other(rays);
        const Tally tally = compare(scene.mesh(), rays, ours, theirs);
        EXPECT_EQ(tally.wrong, 0u) << scene.name << ", " << name_of(set) << "\n"
                                   << tally.first_wrong;
        EXPECT_GT(tally.hits, 0u) << scene.name << ", " << name_of(set);
        if (is_ordinary(set)) {
            EXPECT_LE(tally.grazing, tally.rays / 200 + 2) << scene.name << ", " << name_of(set);
        }
        add(sum, tally);
    }
    print_line(std::cout, scene.name, peer, sum);
    EXPECT_GT(sum.exact, sum.rays / 4) << scene.name;
}

void expect_like_double(const Model& scene, std::size_t rays_per_set) {
    expect_like(scene, "double", rays_per_set, [&](std::span<const Ray> rays) {
        std::vector<Hit> hits(rays.size());
        for_each_index(
            rays.size(), [&](std::size_t i) { hits[i] = oracle_closest(scene.mesh(), rays[i]); },
            16);
        return hits;
    });
}

void expect_like_embree(const Model& scene, std::size_t rays_per_set) {
    const EmbreeOracle embree(scene.mesh());
    expect_like(scene, "Embree", rays_per_set,
                [&](std::span<const Ray> rays) { return embree.closest(rays); });
}

/// The oracle itself, where the answer is known by hand.
TEST(Oracle, KnowsARightAngledTriangle) {
    const Mesh mesh{"one", {{0, 0, 5}, {4, 0, 5}, {0, 4, 5}}, {{0, 1, 2}}};
    const Hit inside = oracle_closest(mesh, {{1, 2, 0}, 0, {0, 0, 2}, infinity});
    EXPECT_EQ(inside.prim, 0u);
    EXPECT_EQ(inside.t, 2.5f);
    EXPECT_EQ(inside.u, 0.25f);
    EXPECT_EQ(inside.v, 0.5f);
    EXPECT_FALSE(oracle_closest(mesh, {{3, 3, 0}, 0, {0, 0, 1}, infinity}).hit());
    EXPECT_FALSE(oracle_closest(mesh, {{1, 1, 0}, 0, {0, 0, 1}, 4}).hit());
    EXPECT_FALSE(oracle_closest(mesh, {{1, 1, 0}, 6, {0, 0, 1}, 9}).hit());
}

TEST(Oracle, FindsPlantedFaults) {
    const Model scene = scene_of(random_soup(300, 5, 0.5f), "soup");
    const auto rays = make_rays(scene, RaySet::through_box, 2000, oracle_seed);
    const auto good = trace(build_bvh(scene.mesh()), rays);
    const auto wrong_after = [&](auto&& spoil) {
        auto bad = good;
        for (std::size_t i = 0; i < bad.size(); i += 10)
            if (bad[i].hit()) spoil(bad[i]);
        return compare(scene.mesh(), rays, bad, good).wrong;
    };
    EXPECT_EQ(wrong_after([](Hit&) {}), 0u);
    EXPECT_GT(wrong_after([](Hit& hit) { hit = Hit{}; }), 50u) << "lost hits";
    EXPECT_GT(wrong_after([](Hit& hit) { hit.t *= 1.001f; }), 50u) << "wrong distance";
    EXPECT_GT(wrong_after([](Hit& hit) { hit.prim ^= 1; }), 50u) << "another triangle";
}

TEST(OracleHits, SoupsLikeDouble) {
    expect_like_double(scene_of(random_soup(1000, 21, 0.3f), "soup"), 100 * thorough);
    expect_like_double(
        scene_of(moved(random_soup(500, 22, 0.3f), {1e5f, -2e5f, 3e4f}), "soup far off"),
        100 * thorough);
    expect_like_double(scene_of(lattice_mesh(500, 8, 23), "lattice"), 100 * thorough);
}

TEST(OracleHits, BuiltinScenesLikeDouble) {
    for (const Model& scene : builtin_triangle_scenes(fewer(10'000, 4)))
        expect_like_double(scene, thorough > 1 ? 100 + 5 * thorough : 30);
}

constexpr std::size_t embree_rays = thorough > 1 ? 2500 * thorough : 200;

TEST(OracleHits, BuiltinScenesLikeEmbree) {
    RAYDIX_SKIP_WITHOUT_EMBREE();
    for (const Model& scene : builtin_triangle_scenes(fewer(100'000, 5)))
        expect_like_embree(scene, embree_rays);
}

/// A shared scene: Embree judges, and float brute force compares bit for bit.
class SharedSceneHits : public testing::TestWithParam<const char*> {
protected:
    static Model load(const std::filesystem::path& file) { return load_thinned(file, 100'000); }
};

TEST_P(SharedSceneHits, LikeEmbree) {
    RAYDIX_SKIP_WITHOUT_EMBREE();
    const auto file = shared_scene(GetParam());
    RAYDIX_SKIP_WITHOUT(file);
    expect_like_embree(load(file), embree_rays);
}

TEST_P(SharedSceneHits, LikeFloatBruteForce) {
    const auto file = shared_scene(GetParam());
    RAYDIX_SKIP_WITHOUT(file);
    const Model scene = load(file);
    ASSERT_FALSE(scene.mesh().triangles.empty());
    const auto rays = make_mixed_rays(scene, thorough > 1 ? 50'000 * thorough : 5'000, oracle_seed);
    const std::vector<Hit> ours = trace(build_bvh(scene.mesh()), rays);
    const std::vector<Hit> wanted = LineTree(scene.mesh()).closest(rays);
    std::uint64_t hits = 0, different = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
        hits += wanted[i].hit();
        if (std::memcmp(&ours[i], &wanted[i], sizeof(Hit)) == 0) continue;
        ++different;
        std::cout << "  ray " << i << ": ours " << ours[i].prim << " at " << ours[i].t
                  << ", wanted " << wanted[i].prim << " at " << wanted[i].t << "\n";
    }
    std::cout << scene.name << ", " << scene.mesh().triangles.size()
              << " triangles, against float brute force: " << rays.size() << " rays, " << hits
              << " hits, " << rays.size() - different << " exact, 0 ties, " << different
              << " wrong (seed " << oracle_seed << ")\n";
    EXPECT_GT(hits, 0u);
    EXPECT_EQ(different, 0u);
}

INSTANTIATE_TEST_SUITE_P(Shared, SharedSceneHits,
                         testing::Values("sibenik/sibenik.ply.xz", "conference/conference.ply.xz",
                                         "bunny/bunny.ply.xz", "crown/crown.ply.xz"),
                         [](const auto& scene) {
                             const std::string name = scene.param;
                             return name.substr(0, name.find('/'));
                         });

}  // namespace
}  // namespace raydix::test
