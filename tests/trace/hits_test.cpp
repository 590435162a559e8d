// trace, trace_any and trace_all against brute force in float, bit for bit, over generated and
// built-in scenes; and that nothing but the input decides a bit.
#include <gtest/gtest.h>
#include <raydix/raydix.h>
#include <raydix/trace.h>

#include <algorithm>
#include <cstring>
#include <iostream>
#include <set>
#include <tuple>

#include "support/bits.h"
#include "support/line_tree.h"
#include "support/ray_sets.h"
#include "support/sanitized.h"
#include "support/scenes.h"
#include "support/support.h"

namespace raydix::test {
namespace {

constexpr std::uint64_t hits_seed = 4242;

/// Prints the line of the comparison; fails on any difference, on no hits and on an empty scene.
void expect_same_hits(const std::string& what, std::span<const Ray> rays, std::span<const Hit> ours,
                      std::span<const Hit> wanted) {
    std::uint64_t hits = 0, different = 0;
    ASSERT_EQ(ours.size(), rays.size());
    ASSERT_EQ(wanted.size(), rays.size());
    for (std::size_t i = 0; i < rays.size(); ++i) {
        hits += wanted[i].hit();
        if (same_bits(ours[i], wanted[i])) continue;
        ++different;
        const Ray& ray = rays[i];
        std::cout << "  ray " << i << " from " << ray.origin.x << " " << ray.origin.y << " "
                  << ray.origin.z << " along " << ray.direction.x << " " << ray.direction.y << " "
                  << ray.direction.z << ": ours " << ours[i].prim << " at " << ours[i].t
                  << ", wanted " << wanted[i].prim << " at " << wanted[i].t << "\n";
    }
    std::cout << what << ": " << rays.size() << " rays, " << hits << " hits, "
              << rays.size() - different << " exact, 0 ties, " << different << " wrong (seed "
              << hits_seed << ")\n";
    EXPECT_GT(hits, 0u) << what;
    EXPECT_EQ(different, 0u) << what;
}

/// trace_any says hit or miss as `closest` does.
void expect_any_agrees(const Bvh& bvh, std::span<const Ray> rays, std::span<const Hit> closest) {
    std::vector<std::uint8_t> occluded(rays.size());
    const TraceCounts counts = trace_any(bvh, rays, occluded);
    std::uint64_t hits = 0, different = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
        hits += closest[i].hit();
        different += occluded[i] != (closest[i].hit() ? 1 : 0);
    }
    EXPECT_EQ(different, 0u);
    EXPECT_EQ(counts.hits, hits);
}

/// trace_all gives exactly the half-open hits of every triangle, in order.
void expect_all_agrees(const Bvh& bvh, const LineTree& brute_force, std::span<const Ray> rays) {
    const AllHits all = trace_all(bvh, rays);
    ASSERT_EQ(all.offsets.size(), rays.size() + 1);
    ASSERT_EQ(all.offsets.back(), all.hits.size());
    EXPECT_EQ(all.counts.hits, all.hits.size());
    std::uint64_t different = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
        const std::span<const Hit> ours(all.hits.data() + all.offsets[i],
                                        all.offsets[i + 1] - all.offsets[i]);
        const std::vector<Hit> wanted = brute_force.all(rays[i]);
        different += !std::ranges::equal(ours, wanted, same_bits);
        EXPECT_TRUE(
            std::ranges::is_sorted(ours, {}, [](const Hit& h) { return std::tuple(h.t, h.prim); }));
        std::set<std::uint32_t> prims;
        for (const Hit& hit : ours) prims.insert(hit.prim);
        EXPECT_EQ(prims.size(), ours.size()) << "a triangle twice on ray " << i;
    }
    std::cout << "  all hits: " << rays.size() << " rays, " << all.hits.size() << " hits, "
              << different << " wrong\n";
    EXPECT_GT(all.hits.size(), 0u);
    EXPECT_EQ(different, 0u);
}

void expect_like_brute_force(const Model& scene, std::size_t ray_count) {
    ASSERT_FALSE(scene.mesh().triangles.empty()) << scene.name;
    const Bvh bvh = build_bvh(scene.mesh());
    const LineTree line_tree(scene.mesh());
    const std::vector<Ray> rays = make_mixed_rays(scene, ray_count, hits_seed);
    const std::vector<Hit> ours = trace(bvh, rays);
    const std::string name = scene.name + ", " + std::to_string(scene.mesh().triangles.size()) +
                             " triangles, against float brute force";
    expect_same_hits(name, rays, ours, line_tree.closest(rays));
    expect_any_agrees(bvh, rays, ours);
    std::vector<Ray> some;  // of every kind: the kinds follow each other
    for (std::size_t i = 0; i < rays.size(); i += 23) some.push_back(rays[i]);
    expect_all_agrees(bvh, line_tree, some);
}

/// The tree of lines is itself held against the plainest of loops.
TEST(Hits, LineTreeAgreesWithEveryTriangle) {
    for (const Model& scene : {scene_of(random_soup(700, 3), "soup of 700"),
                               scene_of(lattice_mesh(300, 5, 9), "lattice of 300"),
                               load_model("builtin:figure?triangles=10000")}) {
        const bool small = scene.mesh().triangles.size() < 1000;
        const std::size_t per_thorough = small ? 2000 : 100;
        const auto rays = make_mixed_rays(
            scene, thorough == 1 ? per_thorough / 4 : per_thorough * thorough, hits_seed);
        expect_same_hits(scene.name + ", line tree against trace_brute_force", rays,
                         LineTree(scene.mesh()).closest(rays),
                         trace_brute_force(scene.mesh(), rays));
    }
}

TEST(Hits, SoupAgainstEveryTriangle) {
    const Model scene = scene_of(random_soup(2000, 12, 0.3f), "soup of 2000");
    const auto rays =
        make_mixed_rays(scene, thorough == 1 ? fewer(3000, 4) : 10'000 * thorough, hits_seed);
    expect_same_hits(scene.name + " against trace_brute_force", rays,
                     trace(build_bvh(scene.mesh()), rays), trace_brute_force(scene.mesh(), rays));
}

constexpr std::size_t million = thorough == 1 ? fewer(6'000, 4) : 1'000'000;

TEST(Hits, SoupsLikeBruteForce) {
    expect_like_brute_force(scene_of(random_soup(2000, 1), "soup"), million);
    expect_like_brute_force(scene_of(random_soup(2000, 2, 1.0f), "soup of large ones"),
                            million / 4);
    expect_like_brute_force(scene_of(lattice_mesh(2000, 20, 5), "lattice"), million / 4);
    expect_like_brute_force(
        scene_of(moved(random_soup(2000, 4), {1e5f, -2e5f, 5e6f}), "soup far off"), million / 4);
    expect_like_brute_force(scene_of(scaled(random_soup(2000, 4), 1e-9f), "tiny soup"),
                            million / 4);
    expect_like_brute_force(scene_of(scaled(random_soup(2000, 4), 1e12f), "huge soup"),
                            million / 4);
}

TEST(Hits, BuiltinScenesLikeBruteForce) {
    const auto scenes = builtin_triangle_scenes(fewer(20'000, 4));
    EXPECT_GE(scenes.size(), 4u);
    for (const Model& scene : scenes) expect_like_brute_force(scene, million);
}

std::vector<Hit> hits_with(const Mesh& mesh, std::span<const Ray> rays, const BuildOptions& options,
                           int threads) {
    return trace(build_bvh(mesh, options), rays, {.threads = threads});
}

TEST(Hits, FaultResultsDifferByThreadCount) {
    const Model scene = load_model("builtin:atrium?triangles=10000");
    const auto rays = make_mixed_rays(scene, thorough == 1 ? 1500 : 5000 * thorough, hits_seed);
    const Bvh bvh = build_bvh(scene.mesh());
    const auto wanted = trace(bvh, rays, {.threads = 1});
    const AllHits all_wanted = trace_all(bvh, rays, {.threads = 1});
    for (const int threads : {1, 2, 7, 0}) {
        EXPECT_TRUE(std::ranges::equal(trace(bvh, rays, {.threads = threads}), wanted, same_bits));
        const AllHits all = trace_all(bvh, rays, {.threads = threads, .counters = true});
        EXPECT_EQ(all.offsets, all_wanted.offsets);
        EXPECT_TRUE(std::ranges::equal(all.hits, all_wanted.hits, same_bits));
    }
}

TEST(Hits, LeafSizeAndCodeBitsChangeNoBit) {
    for (const Model& scene : {load_model("builtin:grove?triangles=10000"),
                               scene_of(lattice_mesh(fewer(3000, 3), 12, 8), "lattice")}) {
        const auto rays =
            make_mixed_rays(scene, thorough == 1 ? fewer(1500, 3) : 5000 * thorough, hits_seed);
        const auto wanted = hits_with(scene.mesh(), rays, {}, 1);
        for (const int bits : {30, 63})
            for (const int max_leaf : {1, 4, 255})
                EXPECT_TRUE(std::ranges::equal(
                    hits_with(scene.mesh(), rays, {.bits = bits, .max_leaf = max_leaf}, 2), wanted,
                    same_bits))
                    << scene.name << ", " << bits << " bits, max_leaf " << max_leaf;
    }
}

TEST(Hits, OneByOneAndWithCountersAsInBatches) {
    const Model scene = scene_of(random_soup(500, 6, 0.4f), "soup");
    const auto rays = make_mixed_rays(scene, 3000, hits_seed);
    const Bvh bvh = build_bvh(scene.mesh());
    const auto wanted = trace(bvh, rays);
    std::vector<Hit> counted(rays.size());
    const TraceCounts counts = trace(bvh, rays, counted, {.counters = true});
    EXPECT_TRUE(std::ranges::equal(counted, wanted, same_bits));
    EXPECT_GT(counts.node_visits, counts.rays);
    EXPECT_GT(counts.triangle_tests, counts.hits);
    for (std::size_t i = 0; i < rays.size(); ++i) {
        ASSERT_TRUE(same_bits(closest_hit(bvh, rays[i]), wanted[i])) << i;
        ASSERT_EQ(any_hit(bvh, rays[i]), wanted[i].hit()) << i;
    }
}

TEST(Hits, OrderOfTrianglesDecidesOnlyTheNames) {
    Model scene = scene_of(random_soup(2000, 7), "soup");
    const auto rays = make_mixed_rays(scene, 50'000, hits_seed);
    const auto wanted = trace(build_bvh(scene.mesh()), rays);
    std::ranges::reverse(scene.mesh().triangles);
    const auto turned = trace(build_bvh(scene.mesh()), rays);
    std::uint64_t renamed = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
        ASSERT_EQ(turned[i].t, wanted[i].t) << i;
        if (wanted[i].hit()) renamed += turned[i].prim + wanted[i].prim == 1999;
    }
    EXPECT_GT(renamed, 1000u);
}

}  // namespace
}  // namespace raydix::test
