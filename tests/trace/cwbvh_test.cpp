// The kernel `cwbvh` against `scalar`, bit for bit: scenes of every size, all kinds of rays, nasty
// meshes; no leaks; and that its planes stay within their pad.
#include <gtest/gtest.h>
#include <raydix/cwbvh.h>
#include <raydix/raydix.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <iostream>
#include <random>

#include "layout/cwbvh.h"
#include "support/bits.h"
#include "support/cwbvh_trace.h"
#include "support/quantised_steps.h"
#include "support/ray_sets.h"
#include "support/sanitized.h"
#include "support/scenes.h"
#include "support/support.h"
#include "trace/cwbvh_walk.h"
#include "tree/bvh_internals.h"

namespace raydix::test {
namespace {

constexpr std::uint64_t cwbvh_seed = 2017;

void expect_like_scalar(const std::string& what, const Bvh& bvh, const Cwbvh& tree,
                        std::span<const Ray> rays, bool some_hit = true) {
    std::vector<Hit> wanted(rays.size()), hits(rays.size());
    const TraceCounts counts = trace(bvh, rays, wanted);
    const TraceCounts own = trace(tree, rays, hits);
    std::uint64_t different = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) different += !same_bits(hits[i], wanted[i]);
    std::cout << what << ": " << rays.size() << " rays, " << counts.hits << " hits, " << different
              << " wrong (seed " << cwbvh_seed << ")\n";
    EXPECT_EQ(different, 0u) << what;
    EXPECT_EQ(own.hits, counts.hits);
    EXPECT_EQ(own.rays, rays.size());
    EXPECT_EQ(own.invalid_rays, counts.invalid_rays);
    if (some_hit) {
        EXPECT_GT(counts.hits, 0u) << what;
        EXPECT_GT(own.node_visits, 0u);
        EXPECT_GE(own.triangle_tests, own.hits);
    }
    std::vector<std::uint8_t> occluded(rays.size());
    const TraceCounts any = trace_any(tree, rays, occluded);
    EXPECT_EQ(any.hits, counts.hits);
    for (std::size_t i = 0; i < rays.size(); ++i)
        ASSERT_EQ(occluded[i] != 0, wanted[i].hit()) << what << ", ray " << i;
}

void expect_like_scalar(const Model& scene, std::size_t rays, const BuildOptions& options = {}) {
    const Bvh bvh = build_bvh(scene.mesh(), options);
    expect_like_scalar(scene.name, bvh, Cwbvh(bvh), make_mixed_rays(scene, rays, cwbvh_seed));
}

constexpr std::size_t million = thorough == 1 ? 8'000 : 50'000 * thorough;

TEST(CwbvhTrace, SoupsLikeScalar) {
    expect_like_scalar(scene_of(random_soup(2000, 1), "soup"), million / 4);
    expect_like_scalar(scene_of(random_soup(2000, 2, 1.0f), "soup of large ones"), million / 10);
    expect_like_scalar(scene_of(lattice_mesh(2000, 20, 5), "lattice"), million / 4);
    expect_like_scalar(scene_of(moved(random_soup(2000, 4), {1e5f, -2e5f, 5e6f}), "soup far off"),
                       million / 4);
    expect_like_scalar(scene_of(scaled(random_soup(2000, 4), 1e-6f), "small soup"), million / 4);
    expect_like_scalar(scene_of(scaled(random_soup(2000, 4), 1e-9f), "tiny soup"), million / 4);
    expect_like_scalar(scene_of(scaled(random_soup(2000, 4), 1e12f), "huge soup"), million / 4);
}

TEST(CwbvhTrace, BuiltinScenesLikeScalar) {
    const auto scenes = builtin_triangle_scenes(20'000);
    EXPECT_GE(scenes.size(), 4u);
    for (const Model& scene : scenes) expect_like_scalar(scene, million);
}

TEST(CwbvhTrace, EveryBuilderAndLeafSize) {
    const Model scene = scene_of(random_soup(3000, 8, 0.2f), "soup");
    for (const Builder builder : {Builder::karras, Builder::ploc, Builder::hploc, Builder::binned})
        for (const int max_leaf : {1, 4, 255})
            expect_like_scalar(scene, thorough == 1 ? 250 : 1000 * thorough,
                               {.builder = builder, .max_leaf = max_leaf});
}

TEST(CwbvhTrace, FewTriangles) {
    const Mesh all = random_soup(30, cwbvh_seed, 1.0f);
    for (std::size_t n = 0; n <= 30; ++n) {
        Mesh mesh = all;
        mesh.triangles.resize(n);
        if (n == 0) mesh.vertices.clear();
        const Bvh bvh = build_bvh(mesh);
        expect_like_scalar(std::to_string(n) + " triangles", bvh, Cwbvh(bvh),
                           make_mixed_rays(scene_of(all, "few"), 2000, cwbvh_seed), n > 0);
    }
}

TEST(CwbvhTrace, NastyRays) {
    const Model scene = scene_of(random_soup(500, 3, 0.5f), "soup");
    const Bvh bvh = build_bvh(scene.mesh());
    const Cwbvh tree(bvh);
    const float nan = std::nanf(""), most = std::numeric_limits<float>::max();
    std::vector<Ray> rays{{{0, 0, 0}, 0, {0, 0, 0}, infinity},
                          {{nan, 0, 0}, 0, {1, 0, 0}, infinity},
                          {{0, infinity, 0}, 0, {1, 0, 0}, infinity},
                          {{0, 0, 0}, nan, {1, 0, 0}, infinity},
                          {{0, 0, 0}, 2, {1, 0, 0}, 1},
                          {{0, 0, 0}, -5, {1, 1, 1}, infinity},
                          {{most, most, most}, 0, {-1, -1, -1}, infinity},
                          {{-most, 0.5f, 0.5f}, 0, {1, 0, -0.0f}, infinity},
                          {{0.5f, 0.5f, -1e30f}, 0, {0, -0.0f, 1}, infinity},
                          {{0.5f, 0.5f, -1}, 0, {1e-40f, -1e-44f, 1}, infinity},
                          {{0.5f, 0.5f, -1}, 0, {1e-30f, 1e-25f, 1e-20f}, infinity},
                          {{0.5f, 0.5f, -1}, 0, {1e-45f, 0, 1e-44f}, infinity},
                          {{0.5f, 0.5f, 2}, 0, {0, 0, -most}, infinity}};
    std::mt19937_64 random(cwbvh_seed);
    const auto unit = [&] { return static_cast<float>(random() >> 40) * 0x1p-24f; };
    for (int k = 0; k < 20'000; ++k) {  // along axes, from within and from far off
        Ray ray{{unit(), unit(), unit()}, 0, {0, -0.0f, 0}, infinity};
        const std::size_t axis = k % 3;
        (&ray.direction.x)[axis] = k % 2 == 0 ? 1.0f : -1.0f;
        if (k % 4 < 2) (&ray.origin.x)[axis] -= 1000.0f * (&ray.direction.x)[axis];
        if (k % 5 == 0) (&ray.direction.x)[(axis + 1) % 3] = std::ldexp(unit() - 0.5f, -k % 149);
        rays.push_back(ray);
    }
    expect_like_scalar("nasty rays", bvh, tree, rays);
}

TEST(CwbvhTrace, NastyMeshes) {
    const Mesh soup = random_soup(500, 6, 0.3f);
    Mesh laced = soup;
    for (std::size_t i = 0; i < laced.vertices.size(); i += 7) laced.vertices[i].y = std::nanf("");
    Mesh with_points = soup;  // zero areas
    for (std::size_t k = 0; k < with_points.triangles.size(); k += 3)
        with_points.triangles[k][1] = with_points.triangles[k][0];
    Mesh twice = soup;  // ties
    twice.triangles.insert(twice.triangles.end(), soup.triangles.rbegin(), soup.triangles.rend());
    Mesh piled = soup;
    for (std::size_t k = 0; k < piled.triangles.size(); ++k)
        piled.triangles[k] = soup.triangles[k % 2];
    Mesh flat = soup;
    for (Vec3& v : flat.vertices) v.z = -0.25f;
    for (const Mesh& mesh : {laced, with_points, twice, piled, flat}) {
        const Bvh bvh = build_bvh(mesh);
        Model whole = scene_of(soup, "soup");
        whole.mesh().triangles = {soup.triangles.begin(), soup.triangles.begin() + 400};
        expect_like_scalar("nasty mesh", bvh, Cwbvh(bvh),
                           make_mixed_rays(whole, fewer(20'000, 8), cwbvh_seed));
    }
}

/// As a builder that splits triangles leaves it: several references to one triangle.
TEST(CwbvhTrace, DuplicatedReferences) {
    const Model scene = scene_of(random_soup(1000, 5, 0.3f), "soup");
    const auto n = static_cast<std::uint32_t>(scene.mesh().triangles.size());
    Mesh doubled = scene.mesh();
    doubled.triangles.insert(doubled.triangles.end(), scene.mesh().triangles.begin(),
                             scene.mesh().triangles.end());
    Bvh bvh = build_bvh(doubled);
    for (std::uint32_t& prim : BvhInternals{bvh}.order().span()) prim %= n;
    BvhInternals{bvh}.input_count() = n;
    const Cwbvh tree(bvh);
    EXPECT_EQ(tree.stats().references, 2 * n);
    EXPECT_EQ(tree.stats().triangles, n);
    const auto rays = make_mixed_rays(scene, 20'000, cwbvh_seed);
    EXPECT_TRUE(
        std::ranges::equal(trace(tree, rays), trace(build_bvh(scene.mesh()), rays), same_bits));
}

/// Rays from the middle of a closed surface, at vertices and edges, wherever it lies.
TEST(CwbvhTrace, NoRayLeavesAClosedSurface) {
    for (const Vec3 move : {Vec3{0, 0, 0}, Vec3{1e5f, 1e5f, -1e5f}}) {
        const Mesh mesh = ball_mesh(move);
        const Cwbvh tree(build_bvh(mesh, {.max_leaf = 1}));
        std::mt19937_64 random(cwbvh_seed);
        std::vector<Ray> rays;
        for (std::size_t k = 0; k < (thorough == 1 ? 2'500 : 10'000 * thorough); ++k) {
            const Triangle& t = mesh.triangles[random() % mesh.triangles.size()];
            const Vec3 a = mesh.vertices[t[0]], b = mesh.vertices[t[1]];
            rays.push_back({move, 0, (k % 2 == 0 ? a : 0.5f * (a + b)) - move, infinity});
        }
        const auto hits = trace(tree, rays);
        EXPECT_EQ(std::ranges::count_if(hits, [](const Hit& h) { return !h.hit(); }), 0);
    }
}

/// The claim of CwbvhRay: a plane as computed is never inside the same plane as slab.h computes it
/// without a pad, for any node and ray.
TEST(CwbvhTrace, PlanesStayWithinTheirPad) {
    std::mt19937_64 random(cwbvh_seed);
    const auto unit = [&] { return static_cast<float>(random() >> 40) * 0x1p-24f; };
    std::uint64_t planes = 0;
    for (int turn = 0; turn < 20'000; ++turn) {
        const float size = std::ldexp(1.0f, static_cast<int>(random() % 60) - 30);
        const auto coordinate = [&] { return size * (2 * unit() - 1); };
        Aabb root{{coordinate(), coordinate(), coordinate()}, {}};
        root.hi = root.lo + Vec3{size * unit(), size * unit(), size * unit()};
        const float away = std::ldexp(1.0f, static_cast<int>(random() % 20) - 4);
        const Vec3 direction{unit() - 0.5f, std::ldexp(unit() - 0.5f, -int(random() % 100)),
                             unit() - 0.5f};
        const Ray ray{{away * coordinate(), away * coordinate(), away * coordinate()},
                      0,
                      direction,
                      infinity};
        if (!is_valid(ray)) continue;
        const RayFrame frame = make_frame(ray);
        const CwbvhRay own = make_cwbvh_ray(frame, root);
        const int exponent = step_exponent(root.lo.x, root.hi.x);
        const CwbvhAxis axis = make_axis(root.lo.x, static_cast<std::uint32_t>(exponent),
                                         frame.origin.x, own.pad.x, own.inverse.x);
        const float at = root.lo.x + unit() * (root.hi.x - root.lo.x);
        if (!(at >= root.lo.x && at <= root.hi.x)) continue;
        const float t = (at - frame.origin.x) * frame.inverse.x;
        const auto [below, above] = quantised_steps(root.lo.x, root.hi.x, at);
        const int near = (own.octant & 1u) == 0 ? above : below,
                  far = (own.octant & 1u) == 0 ? below : above;
        ASSERT_LE(plane_at(float(near), axis.rate, axis.near), t) << "turn " << turn;
        ASSERT_GE(plane_at(float(far), axis.rate, axis.far), t) << "turn " << turn;
        // The device's form, rounded once.
        ASSERT_LE(std::fma(float(near), axis.rate, axis.near), t) << "turn " << turn;
        ASSERT_GE(std::fma(float(far), axis.rate, axis.far), t) << "turn " << turn;
        ++planes;
    }
    EXPECT_GT(planes, 10'000u);
}

}  // namespace
}  // namespace raydix::test
