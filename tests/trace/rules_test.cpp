// The rules of a hit that a single fault can break: who wins a tie, where a ray begins, and that no
// ray slips between triangles that share an edge.
#include <gtest/gtest.h>
#include <raydix/bvh.h>
#include <raydix/raydix.h>
#include <raydix/trace.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <random>
#include <vector>

#include "support/support.h"

namespace raydix {
namespace {

/// Triangles in the plane z = 0 around the vertex (0, 0, 0), the first one where codes are highest.
Mesh fan() {
    Mesh mesh;
    mesh.vertices = {{0, 0, 0}};
    constexpr std::uint32_t corners = 16;
    for (std::uint32_t i = 0; i < corners; ++i) {
        const double angle = 0.4 + 6.283185307179586 * i / corners;
        mesh.vertices.push_back(
            {static_cast<float>(std::cos(angle)), static_cast<float>(std::sin(angle)), 0.0f});
    }
    for (std::uint32_t i = 0; i < corners; ++i)
        mesh.triangles.push_back({0, 1 + i, 1 + (i + 1) % corners});
    return mesh;
}

void expect_hit_by_both(const Mesh& mesh, const Ray& ray, std::uint32_t prim, float t) {
    const std::vector<Ray> rays{ray};
    const Hit brute = trace_brute_force(mesh, rays)[0];
    EXPECT_EQ(brute.prim, prim);
    EXPECT_EQ(brute.t, t);
    for (const int max_leaf : {1, 4, 255}) {
        const Hit hit = closest_hit(build_bvh(mesh, {.max_leaf = max_leaf}), ray);
        EXPECT_EQ(std::memcmp(&hit, &brute, sizeof(Hit)), 0) << "max_leaf " << max_leaf;
    }
}

TEST(TraceRules, TiesGoToTheLowerId) {
    Mesh mesh = fan();
    for (std::size_t turn = 0; turn < mesh.triangles.size(); ++turn) {
        std::rotate(mesh.triangles.begin(), mesh.triangles.begin() + 1, mesh.triangles.end());
        // From afar, and from the vertex itself: there no box is padded, and all begin at t = 0.
        expect_hit_by_both(mesh, {.origin = {0, 0, 2}, .direction = {0, 0, -1}}, 0, 2.0f);
        expect_hit_by_both(mesh, {.origin = {0, 0, 0}, .direction = {0, 0, 1}}, 0, 0.0f);
    }
    const Triangle first = mesh.triangles[0];
    mesh.triangles.assign(40, first);
    const Vec3 a = mesh.vertices[first[1]], b = mesh.vertices[first[2]];
    const Vec3 inside{(a.x + b.x) / 4, (a.y + b.y) / 4, 1};
    expect_hit_by_both(mesh, {.origin = inside, .direction = {0, 0, -1}}, 0, 1.0f);
}

TEST(TraceRules, RaysBeginAtTheirOrigin) {
    const Mesh mesh = fan();
    const Bvh tree = build_bvh(mesh);
    const auto hits = [&](float z, float tmin, float tmax) {
        return any_hit(tree, {{0.1f, 0.05f, z}, tmin, {0, 0, -1}, tmax});
    };
    EXPECT_TRUE(hits(1, 0, 2));
    EXPECT_TRUE(hits(1, -5, 2)) << "a negative tmin counts as 0";
    EXPECT_FALSE(hits(-1, -5, 2)) << "what lies behind the origin is not hit";
    EXPECT_FALSE(hits(1, 1.5f, 2));
    EXPECT_TRUE(hits(1, 1, 1)) << "limits are closed";
    const std::vector<Ray> rays{{{0, 0, 1}, -3, {0, 0, -1}, -1}, {{0, 0, 1}, -3, {0, 0, -1}, 2}};
    std::vector<Hit> found(2);
    EXPECT_EQ(trace(tree, rays, found).invalid_rays, 1u) << "a ray that ends before it begins";
    EXPECT_TRUE(found[1].hit());
}

/// Rays through the vertex, the edges and the inside of a square of four triangles cross it once.
TEST(TraceRules, AllHitsCrossASheetOnce) {
    Mesh mesh;
    mesh.vertices = {{0, 0, 0}, {-2, -2, 0}, {2, -2, 0}, {2, 2, 0}, {-2, 2, 0}};
    mesh.triangles = {{0, 1, 2}, {0, 2, 3}, {0, 3, 4}, {0, 4, 1}};
    const Bvh tree = build_bvh(mesh, {.max_leaf = 1});
    std::vector<Ray> rays;
    for (int y = -7; y <= 7; ++y)
        for (int x = -7; x <= 7; ++x)
            for (const Vec3 d : {Vec3{0, 0, -1}, Vec3{1, 0, -1}, Vec3{-1, 2, -1}, Vec3{0, -1, -2}})
                for (const float turn : {1.0f, -1.0f})
                    rays.push_back(
                        {.origin = {0.25f * static_cast<float>(x) - turn * d.x,
                                    0.25f * static_cast<float>(y) - turn * d.y, -turn * d.z},
                         .direction = {turn * d.x, turn * d.y, turn * d.z}});
    const AllHits all = trace_all(tree, rays);
    for (std::size_t i = 0; i < rays.size(); ++i)
        EXPECT_EQ(all.offsets[i + 1] - all.offsets[i], 1u) << "ray " << i;
}

/// A flat sheet of squares, and rays at points of its inner edges: boxes end where triangles do.
TEST(TraceRules, NoRaySlipsBetweenFlatNeighbours) {
    constexpr std::uint32_t side = 32;
    constexpr std::uint64_t seed = 20130101;
    std::mt19937_64 random(seed);
    std::size_t rays_traced = 0, slipped = 0;
    for (const float away : {0.0f, 17.3f, 1000.1f, 100000.7f}) {
        Mesh mesh;
        for (std::uint32_t y = 0; y <= side; ++y)
            for (std::uint32_t x = 0; x <= side; ++x)
                mesh.vertices.push_back({away + 0.37f * static_cast<float>(x),
                                         away + 0.37f * static_cast<float>(y), away});
        for (std::uint32_t y = 0; y < side; ++y)
            for (std::uint32_t x = 0; x < side; ++x) {
                const std::uint32_t at = y * (side + 1) + x;
                mesh.triangles.push_back({at, at + 1, at + side + 2});
                mesh.triangles.push_back({at, at + side + 2, at + side + 1});
            }
        const Bvh tree = build_bvh(mesh, {.max_leaf = 1});
        std::uniform_real_distribution<float> part(0.0f, 1.0f);
        std::vector<Ray> rays;
        for (std::size_t i = 0; i < 20000 * test::thorough; ++i) {
            const auto column = 2 + random() % (side - 4), row = 2 + random() % (side - 4);
            const Vec3 a = mesh.vertices[row * (side + 1) + column];
            const Vec3 b = mesh.vertices[(row + 1) * (side + 1) + column];
            const float along = part(random);
            const Vec3 origin{a.x + 8 * part(random) - 4, a.y + 8 * part(random) - 4,
                              a.z + 1 + 4 * part(random)};
            const Vec3 aim{a.x, a.y + along * (b.y - a.y), a.z};
            rays.push_back({.origin = origin,
                            .direction = {aim.x - origin.x, aim.y - origin.y, aim.z - origin.z}});
        }
        for (const Hit& hit : trace(tree, rays)) slipped += !hit.hit();
        rays_traced += rays.size();
    }
    std::printf("seed %llu: %zu rays, %zu slipped through\n", static_cast<unsigned long long>(seed),
                rays_traced, slipped);
    EXPECT_EQ(slipped, 0u);
    EXPECT_GT(rays_traced, 0u);
}

}  // namespace
}  // namespace raydix
