// Faults that users of other libraries keep meeting, as far as they concern rays: one test each.
// Watertightness, shared edges and thread counts have theirs in watertight_test, triangle_test_test
// and hits_test.
#include <gtest/gtest.h>
#include <raydix/raydix.h>
#include <raydix/trace.h>

#include <algorithm>
#include <cmath>
#include <iostream>

#include "support/bits.h"
#include "support/line_tree.h"
#include "support/ray_sets.h"
#include "support/sanitized.h"
#include "support/scenes.h"
#include "support/support.h"

namespace raydix::test {
namespace {

constexpr std::uint64_t faults_seed = 60;

/// A box of twelve triangles, wound outward.
Mesh box_mesh(Vec3 lo, Vec3 hi) {
    Mesh mesh;
    for (int k = 0; k < 8; ++k)
        mesh.vertices.push_back({k & 1 ? hi.x : lo.x, k & 2 ? hi.y : lo.y, k & 4 ? hi.z : lo.z});
    mesh.triangles = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                      {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
    return mesh;
}

/// The tree, with every leaf size, gives the bits of brute force over all triangles.
void expect_brute_force(const Mesh& mesh, std::span<const Ray> rays, bool some_hit = true) {
    const std::vector<Hit> wanted = trace_brute_force(mesh, rays);
    if (some_hit) {
        EXPECT_TRUE(std::ranges::any_of(wanted, &Hit::hit));
    }
    for (const int max_leaf : {1, 4})
        for (const int bits : {30, 63}) {
            const Bvh bvh = build_bvh(mesh, {.bits = bits, .max_leaf = max_leaf});
            EXPECT_TRUE(std::ranges::equal(trace(bvh, rays), wanted, same_bits));
        }
}

TEST(RayFaults, AxisAlignedRayInASlabPlane) {
    const Mesh mesh = box_mesh({1, 2, 3}, {4, 6, 8});
    const Bvh bvh = build_bvh(mesh, {.max_leaf = 1});
    for (std::size_t axis = 0; axis < 3; ++axis)
        for (const Vec3& corner : mesh.vertices)
            for (const float sign : {1.0f, -1.0f}) {
                Ray ray{corner, 0, {0, 0, 0}, infinity};
                (&ray.origin.x)[axis] = -50 * sign;
                (&ray.direction.x)[axis] = sign;
                // Along an edge of the box, in two of its planes: the faces across it are met.
                const Hit hit = closest_hit(bvh, ray);
                EXPECT_TRUE(hit.hit()) << axis << " " << sign;
                EXPECT_TRUE(any_hit(bvh, ray));
                expect_brute_force(mesh, {&ray, 1});
            }
}

TEST(RayFaults, ZeroComponentsGiveNoNaN) {
    const Mesh mesh = box_mesh({-1, -1, -1}, {1, 1, 1});
    const Bvh bvh = build_bvh(mesh, {.max_leaf = 1});
    std::vector<Ray> rays;
    for (int x = -1; x <= 1; ++x)
        for (int y = -1; y <= 1; ++y)
            for (int z = -1; z <= 1; ++z)
                for (const float sign : {1.0f, -1.0f}) {
                    if (x == 0 && y == 0 && z == 0) continue;
                    const auto part = [&](int k) { return k == 0 ? 0.0f * sign : float(k); };
                    rays.push_back({{0, 0, 0}, 0, {part(x), part(y), part(z)}, infinity});
                    rays.push_back({{0, 0.25f, -0.5f}, 0, {part(x), part(y), part(z)}, infinity});
                }
    for (const Ray& ray : rays) {
        const Hit hit = closest_hit(bvh, ray);
        ASSERT_TRUE(hit.hit());
        EXPECT_TRUE(std::isfinite(hit.t) && std::isfinite(hit.u) && std::isfinite(hit.v));
    }
    expect_brute_force(mesh, rays);
}

TEST(RayFaults, NaNTrianglePoisonsNoBox) {
    const Model clean = scene_of(random_soup(200, faults_seed, 0.5f), "soup");
    Mesh poisoned = clean.mesh();
    const float nan = std::nanf("");
    for (const Vec3 bad : {Vec3{nan, 0, 0}, Vec3{0, infinity, 0}, Vec3{0, 0, -infinity},
                           Vec3{nan, nan, nan}, Vec3{1e13f, 0, 0}}) {
        const auto v = static_cast<std::uint32_t>(poisoned.vertices.size());
        poisoned.vertices.push_back(bad);
        poisoned.triangles.push_back({0, 1, v});
    }
    const auto rays = make_mixed_rays(clean, fewer(20'000, 8), faults_seed);
    const Bvh bvh = build_bvh(poisoned);
    EXPECT_EQ(bvh.left_out(), 5u);
    const auto wanted = trace(build_bvh(clean.mesh()), rays);
    EXPECT_TRUE(std::ranges::any_of(wanted, &Hit::hit));
    EXPECT_TRUE(std::ranges::equal(trace(bvh, rays), wanted, same_bits));
    expect_brute_force(poisoned, rays);
}

TEST(RayFaults, VeryFewTriangles) {
    const Mesh all = random_soup(5, faults_seed, 2.0f);
    for (std::size_t n = 0; n <= 5; ++n) {
        Mesh mesh = all;
        mesh.triangles.resize(n);
        if (n == 0) mesh.vertices.clear();
        const auto rays = make_mixed_rays(scene_of(all, "five"), 2000, faults_seed);
        expect_brute_force(mesh, rays, n > 0);
        const AllHits hits = trace_all(build_bvh(mesh), rays);
        EXPECT_EQ(hits.hits.empty(), n == 0);
    }
    // Vertices without triangles are a cloud of points: not a thing that rays can hit.
    Mesh cloud = all;
    cloud.triangles.clear();
    const Ray ray{{0, 0, 0}, 0, {1, 0, 0}, infinity};
    EXPECT_THROW((void)closest_hit(build_bvh(cloud), ray), InputError);
}

/// Triangles whose distance to one corner halves each time: one level of the tree per code bit, and
/// equal codes below that.
TEST(RayFaults, DeepTreesOverrunNoStack) {
    Mesh mesh;
    const auto add = [&](float x, float y, float z, float size) {
        const auto v = static_cast<std::uint32_t>(mesh.vertices.size());
        mesh.vertices.insert(mesh.vertices.end(),
                             {{x - size, y - size, z}, {x + size, y - size, z}, {x, y + size, z}});
        mesh.triangles.push_back({v, v + 1, v + 2});
    };
    constexpr float size = 1e-9f;
    for (int bit = 1; bit <= 22; ++bit) {
        const float at = std::ldexp(1.0f, -bit);
        add(at, 0, 0, size);
        add(0, at, 0, size);
        add(0, 0, at, size);
    }
    for (int i = 0; i < 5000; ++i) add(0, 0, 0, size);
    const Bvh bvh = build_bvh(mesh, {.max_leaf = 1});
    EXPECT_GT(bvh.max_depth(), 64u);
    std::vector<Ray> rays{{{0, 0, -1}, 0, {0, 0, 1}, infinity}};
    for (int bit = 1; bit <= 22; ++bit)
        for (const Vec3 target : {Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}}) {
            const Vec3 at{std::ldexp(target.x, -bit), std::ldexp(target.y, -bit),
                          std::ldexp(target.z, -bit)};
            rays.push_back({{at.x, at.y, -1}, 0, {0, 0, 1}, infinity});
            rays.push_back({at, 0, {0, 0, 1}, infinity});
            rays.push_back({{at.x - 1, at.y - 1, at.z - 1}, 0, {1, 1, 1}, infinity});
        }
    expect_brute_force(mesh, rays);
    const AllHits all = trace_all(bvh, std::span(rays).first(1));
    EXPECT_EQ(all.hits.size(), 5000u + 22u) << "the pile, and the row above it";
}

TEST(RayFaults, HundredsOfThousandsOfEqualTriangles) {
    constexpr std::uint32_t n = 10'000 * static_cast<std::uint32_t>(thorough);
    Mesh mesh{"equal", {{0, 0, 1}, {1, 0, 1}, {0, 1, 1}}, {}};
    mesh.triangles.assign(n, {0, 1, 2});
    const Bvh bvh = build_bvh(mesh);
    const Ray ray{{0.25f, 0.25f, 0}, 0, {0, 0, 1}, infinity};
    EXPECT_EQ(closest_hit(bvh, ray).prim, 0u) << "of equal hits the lowest id";
    const AllHits all = trace_all(bvh, {&ray, 1});
    ASSERT_EQ(all.hits.size(), n);
    for (std::uint32_t i = 0; i < n; ++i) ASSERT_EQ(all.hits[i].prim, i);
}

/// 30-bit codes of a few metres at coordinates of 5e6 fall into few cells.
TEST(RayFaults, GpsCoordinatesCollapseCodes) {
    Mesh mesh = moved(random_soup(3000, faults_seed, 8.0f), {0, 0, 0});
    for (Vec3& p : mesh.vertices) p = {500'000 + 30 * p.x, 5'400'000 + 30 * p.y, 300 + 30 * p.z};
    mesh.vertices.push_back({-1e7f, -1e7f, -1e7f});  // far away: the grid's cells are large
    mesh.vertices.push_back({-1e7f, -1e7f + 1, -1e7f});
    mesh.vertices.push_back({-1e7f + 1, -1e7f, -1e7f});
    const auto v = static_cast<std::uint32_t>(mesh.vertices.size());
    Model scene = scene_of(mesh, "GPS");
    const auto rays = make_rays(scene, RaySet::at_vertex, fewer(500 * thorough, 4), faults_seed);
    mesh.triangles.push_back({v - 3, v - 2, v - 1});
    expect_brute_force(mesh, rays);
}

TEST(RayFaults, InvalidRaysMissAndAreCounted) {
    const Mesh mesh = box_mesh({-1, -1, -1}, {1, 1, 1});
    const float nan = std::nanf("");
    const std::vector<Ray> rays{{{0, 0, 0}, 0, {1, 0, 0}, infinity},
                                {{nan, 0, 0}, 0, {1, 0, 0}, infinity},
                                {{0, infinity, 0}, 0, {1, 0, 0}, infinity},
                                {{0, 0, 0}, 0, {0, 0, 0}, infinity},
                                {{0, 0, 0}, 0, {-0.0f, 0, -0.0f}, infinity},
                                {{0, 0, 0}, 0, {1, nan, 0}, infinity},
                                {{0, 0, 0}, 0, {1, 0, -infinity}, infinity},
                                {{0, 0, 0}, nan, {1, 0, 0}, infinity},
                                {{0, 0, 0}, 0, {1, 0, 0}, nan},
                                {{0, 0, 0}, 2, {1, 0, 0}, 1},
                                {{0, 0, 0}, -5, {1, 0, 0}, infinity}};
    for (const Mesh& scene : {mesh, Mesh{}}) {
        const Bvh bvh = build_bvh(scene);
        std::vector<Hit> hits(rays.size());
        const TraceCounts counts = trace(bvh, rays, hits);
        EXPECT_EQ(counts.rays, rays.size());
        EXPECT_EQ(counts.invalid_rays, 9u);
        EXPECT_EQ(counts.hits, scene.triangles.empty() ? 0u : 2u);
        std::vector<std::uint8_t> occluded(rays.size(), 7);
        EXPECT_EQ(trace_any(bvh, rays, occluded).invalid_rays, 9u);
        const AllHits all = trace_all(bvh, rays);
        EXPECT_EQ(all.counts.invalid_rays, 9u);
        for (std::size_t i = 1; i + 1 < rays.size(); ++i) {
            EXPECT_TRUE(same_bits(hits[i], Hit{})) << i;
            EXPECT_EQ(occluded[i], 0) << i;
            EXPECT_EQ(all.offsets[i], all.offsets[i + 1]) << i;
        }
    }
}

}  // namespace
}  // namespace raydix::test
