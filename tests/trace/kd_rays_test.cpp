// kd_trace and kd_trace_any against trace_brute_force and against the BVH's trace, bit for bit.
#include <gtest/gtest.h>
#include <raydix/error.h>
#include <raydix/kdtree.h>
#include <raydix/raydix.h>

#include <algorithm>
#include <cstring>
#include <iostream>

#include "support/bits.h"
#include "support/line_tree.h"
#include "support/ray_sets.h"
#include "support/sanitized.h"
#include "support/scenes.h"
#include "support/support.h"

namespace raydix::test {
namespace {

constexpr std::uint64_t kd_rays_seed = 515;

void expect_same(const std::string& what, const KdTree& tree, std::span<const Ray> rays,
                 std::span<const Hit> wanted) {
    const std::vector<Hit> ours = kd_trace(tree, rays);
    std::vector<std::uint8_t> occluded(rays.size());
    const TraceCounts any = kd_trace_any(tree, rays, occluded);
    std::uint64_t hits = 0, wrong = 0, wrong_any = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
        hits += wanted[i].hit();
        wrong += !same_bits(ours[i], wanted[i]);
        wrong_any += (occluded[i] != 0) != wanted[i].hit();
    }
    std::cout << what << ": " << rays.size() << " rays, " << hits << " hits, " << wrong << " and "
              << wrong_any << " wrong (seed " << kd_rays_seed << ")\n";
    EXPECT_GT(hits, 0u) << what;
    EXPECT_EQ(wrong, 0u) << what;
    EXPECT_EQ(wrong_any, 0u) << what;
    EXPECT_EQ(any.hits, hits) << what;
}

void expect_kd_like_brute_force(const Model& scene, std::size_t ray_count) {
    const auto rays = make_mixed_rays(scene, ray_count, kd_rays_seed);
    const auto wanted = LineTree(scene.mesh()).closest(rays);
    for (const int max_leaf : {1, 8})
        for (const int bits : {30, 63})
            expect_same(scene.name + ", bits " + std::to_string(bits) + ", max_leaf " +
                            std::to_string(max_leaf),
                        build_kdtree(scene.mesh(), {.bits = bits, .max_leaf = max_leaf}), rays,
                        wanted);
}

TEST(KdRays, SoupAgainstEveryTriangle) {
    const Model scene = scene_of(random_soup(2000, 12, 0.3f), "soup of 2000");
    const auto rays = make_mixed_rays(scene, fewer(2000 * thorough, 4), kd_rays_seed);
    expect_same(scene.name + " against trace_brute_force", build_kdtree(scene.mesh()), rays,
                trace_brute_force(scene.mesh(), rays));
}

TEST(KdRays, SoupsLikeBruteForce) {
    const std::size_t rays = thorough == 1 ? fewer(1200, 4) : 5000 * thorough;
    expect_kd_like_brute_force(scene_of(random_soup(2000, 1), "soup"), rays);
    expect_kd_like_brute_force(scene_of(random_soup(2000, 2, 1.0f), "soup of large ones"), rays);
    expect_kd_like_brute_force(scene_of(lattice_mesh(2000, 20, 5), "lattice"), rays);
    expect_kd_like_brute_force(
        scene_of(moved(random_soup(2000, 4), {1e5f, -2e5f, 5e6f}), "soup far off"), rays);
    expect_kd_like_brute_force(scene_of(scaled(random_soup(2000, 4), 1e-9f), "tiny soup"), rays);
    expect_kd_like_brute_force(scene_of(scaled(random_soup(2000, 4), 1e12f), "huge soup"), rays);
}

TEST(KdRays, BuiltinScenesLikeBruteForce) {
    const auto scenes = builtin_triangle_scenes(1000 * thorough);
    EXPECT_GE(scenes.size(), 4u);
    for (const Model& scene : scenes)
        expect_kd_like_brute_force(scene, thorough == 1 ? fewer(2000, 4) : 10'000 * thorough);
}

TEST(KdRays, SharedBunnyLikeTheBvh) {
    const auto file = shared_scene("bunny/bunny.ply.xz");
    RAYDIX_SKIP_WITHOUT(file);
    const Model scene = load_model(file.string());
    const auto rays =
        make_mixed_rays(scene, thorough == 1 ? 8000 : 25'000 * thorough, kd_rays_seed);
    expect_same("bunny", build_kdtree(scene.mesh()), rays, trace(build_bvh(scene.mesh()), rays));
}

TEST(KdRays, ThreadsAndCountersChangeNothing) {
    const Model scene = load_model("builtin:grove?triangles=10000");
    const auto rays = make_mixed_rays(scene, 2000 * thorough, kd_rays_seed);
    const KdTree tree = build_kdtree(scene.mesh());
    const auto wanted = kd_trace(tree, rays, {.threads = 1});
    TraceCounts first;
    for (const int threads : {1, 2, 7}) {
        std::vector<Hit> hits(rays.size());
        const TraceCounts counts =
            kd_trace(tree, rays, hits, {.threads = threads, .counters = true});
        EXPECT_TRUE(std::ranges::equal(hits, wanted, same_bits));
        EXPECT_EQ(counts.rays, rays.size());
        if (threads == 1) first = counts;
        EXPECT_EQ(counts.node_visits, first.node_visits);
        EXPECT_EQ(counts.triangle_tests, first.triangle_tests);
        EXPECT_GT(counts.node_visits, counts.hits);
        EXPECT_GT(counts.triangle_tests, counts.hits);
    }
}

TEST(KdRays, DescendInsteadOfLookingAtEverything) {
    const Model scene = load_model("builtin:figure?triangles=20000");
    const auto rays = make_primary_rays(scene.cameras.cameras[0], 64, 48);
    std::vector<Hit> hits(rays.size());
    const TraceCounts counts = kd_trace(build_kdtree(scene.mesh()), rays, hits, {.counters = true});
    EXPECT_GT(counts.hits, rays.size() / 20);
    EXPECT_LT(counts.triangle_tests, 200 * rays.size());
    EXPECT_LT(counts.node_visits, 300 * rays.size());
}

TEST(KdRays, InvalidRaysAndEmptyTreesMiss) {
    const std::vector<Ray> rays{{{0, 0, 0}, 0, {0, 0, 0}, 1}, {{0, 0, 5}, 0, {0, 0, -1}, infinity}};
    std::vector<Hit> hits(2, hit_of_tree({1, 7, 0, 0}));
    const TraceCounts counts = kd_trace(build_kdtree(Mesh{}), rays, hits);
    EXPECT_EQ(counts.invalid_rays, 1u);
    EXPECT_EQ(counts.hits, 0u);
    EXPECT_FALSE(hits[0].hit());
    EXPECT_FALSE(hits[1].hit());
    const Mesh one{"", {{-1, -1, 0}, {1, -1, 0}, {0, 1, 0}}, {{0, 1, 2}}};
    EXPECT_EQ(kd_trace(build_kdtree(one), rays)[1].prim, 0u);
}

TEST(KdRays, RefuseWhatTheyCannotTrace) {
    const KdTree points = build_kdtree(std::vector<Vec3>{{0, 0, 0}});
    const std::vector<Ray> rays(3, Ray{{0, 0, 0}, 0, {0, 0, 1}, 1});
    std::vector<Hit> hits(2);
    std::vector<std::uint8_t> occluded(2);
    EXPECT_THROW((void)kd_trace(points, rays), InputError);
    EXPECT_THROW((void)kd_trace(build_kdtree(Mesh{}), rays, hits), InputError);
    EXPECT_THROW((void)kd_trace_any(build_kdtree(Mesh{}), rays, occluded), InputError);
}

}  // namespace
}  // namespace raydix::test
