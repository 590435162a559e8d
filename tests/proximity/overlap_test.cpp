// Segments, spheres and moving spheres against a look at every triangle, and moving ones against
// distances along their path in higher precision.
#include <gtest/gtest.h>
#include <raydix/error.h>
#include <raydix/model.h>
#include <raydix/overlap.h>
#include <raydix/trace.h>

#include <iostream>
#include <limits>

#include "base/same_bits.h"
#include "proximity/sweep_walk.h"
#include "proximity/touch_walk.h"
#include "support/exact_overlap_reference.h"
#include "support/mesh_triangles.h"
#include "support/random.h"
#include "support/region_distance.h"
#include "support/scenes.h"
#include "support/support.h"

namespace raydix {
namespace {

constexpr std::uint64_t overlap_seed = 19880711;
constexpr float overlap_nan = std::numeric_limits<float>::quiet_NaN();
constexpr const char* some_builders[] = {"karras", "apetrei", "hploc", "binned", "split", "sbvh"};

using test::corners, test::Random;

bool touch(const Segment& s, const LeafTriangle& t) {
    return segment_touches_triangle(s.a, s.b, t);
}
bool touch(const Sphere& s, const LeafTriangle& t) {
    return closest_on_triangle(t, s.center).d2 <= s.radius * s.radius;
}

template <class Query>
void expect_brute_force(const std::string& name, const Mesh& mesh,
                        const std::vector<Query>& queries) {
    std::vector<std::uint64_t> offsets{0};
    std::vector<std::uint32_t> prims;
    for (const Query& q : queries) {
        for (std::uint32_t i = 0; is_valid(q) && i < mesh.triangles.size(); ++i)
            if (touch(q, corners(mesh, i))) prims.push_back(i);
        offsets.push_back(prims.size());
    }
    std::cout << name << ": " << queries.size() << " queries, " << prims.size() << " triangles\n";
    EXPECT_GT(prims.size(), queries.size() / 20);
    for (const char* builder : some_builders)
        for (const int threads : {1, 2, 7}) {
            const Bvh bvh = build_bvh(mesh, {.builder = builder_from_name(builder)});
            const OverlapLists lists = touch_all(bvh, queries, {.threads = threads});
            EXPECT_TRUE(lists.offsets == offsets) << name << ' ' << builder << ' ' << threads;
            EXPECT_TRUE(lists.prims == prims) << name << ' ' << builder << ' ' << threads;
            EXPECT_EQ(lists.counts.found, prims.size());
            std::vector<std::uint8_t> touched(queries.size());
            touch_any(bvh, queries, touched, {.threads = threads});
            for (std::size_t i = 0; i < queries.size(); ++i)
                ASSERT_EQ(touched[i] != 0, offsets[i + 1] != offsets[i]) << name << ' ' << i;
        }
}

std::vector<Segment> segments(std::size_t count, float lo, float hi, bool lattice) {
    Random random(overlap_seed);
    std::vector<Segment> list;
    const auto place = [&] {
        const Vec3 p = random.in(lo, hi);
        return lattice ? Vec3{std::floor(p.x), std::floor(p.y), std::floor(p.z)} : p;
    };
    for (std::size_t i = 0; i < count; ++i) {
        const Vec3 a = place();
        list.push_back({a, i % 5 == 0 ? a : place()});
    }
    return list;
}

TEST(Overlap, SegmentsAreBruteForce) {
    const std::size_t n = 50 * test::thorough;
    expect_brute_force("segments, soup", test::random_soup(1000, overlap_seed, 0.2f),
                       segments(n, -0.2f, 1.2f, false));
    expect_brute_force("segments, lattice", test::lattice_mesh(300, 5, overlap_seed),
                       segments(n, -1, 7, true));
    expect_brute_force("segments, huge",
                       test::scaled(test::lattice_mesh(300, 5, overlap_seed), 1e9f),
                       segments(n, -1e9f, 7e9f, false));
}

TEST(Overlap, SegmentsOnALatticeTouchAsInWholeNumbers) {
    const Mesh mesh = test::lattice_mesh(200, 5, overlap_seed);
    const Bvh bvh = build_bvh(mesh);
    for (const Segment& s : segments(100 * test::thorough, -1, 7, true)) {
        bool expected = false;
        for (std::size_t i = 0; i < mesh.triangles.size() && !expected; ++i)
            expected = test::whole_triangles_touch({s.a, s.b, s.b}, corners(mesh, i));
        ASSERT_EQ(touches(bvh, s), expected);
    }
}

TEST(Overlap, SpheresAreBruteForce) {
    Random random(overlap_seed);
    std::vector<Sphere> spheres;
    const Mesh soup = test::random_soup(1000, overlap_seed);
    for (std::size_t i = 0; i < 100 * test::thorough; ++i)
        spheres.push_back({random.in(-0.2f, 1.2f), i % 4 == 0 ? 0.0f : random.between(0, 0.2f)});
    for (std::size_t i = 0; i < 100; ++i) spheres.push_back({soup.vertices[i], 0.0f});
    spheres.push_back({{0, overlap_nan, 0}, 1});
    spheres.push_back({{0, 0, 0}, -1});
    spheres.push_back({{0, 0, 0}, overlap_nan});
    spheres.push_back({{0, 0, 0}, infinity});
    expect_brute_force("spheres, soup", soup, spheres);
    const Mesh ball = test::ball_mesh({0, 0, 0});
    std::vector<Sphere> around;
    for (std::size_t i = 0; i < 20 * test::thorough; ++i)
        around.push_back({random.in(-150, 150), random.between(0, 60)});
    expect_brute_force("spheres, ball", ball, around);
}

std::vector<SphereSweep> sweeps(std::size_t count, float lo, float hi, float radius) {
    Random random(overlap_seed);
    std::vector<SphereSweep> list;
    for (std::size_t i = 0; i < count; ++i) {
        Ray ray{random.in(lo, hi), 0, random.in(-1, 1)};
        if (i % 6 == 0) ray.direction = {0, 0, i % 4 ? 1.0f : -1.0f};
        if (i % 7 == 0) {
            ray.tmin = 0.1f;
            ray.tmax = 0.1f + 0.5f * (hi - lo);
        }
        list.push_back({ray, random.between(0, radius)});
    }
    return list;
}

void expect_sweeps(const std::string& name, const Mesh& mesh,
                   const std::vector<SphereSweep>& list) {
    std::vector<Contact> expected(list.size());
    std::size_t hits = 0;
    for (std::size_t k = 0; k < list.size(); ++k) {
        const Path path = path_of(list[k].path);
        const GrownBoxes boxes(path, list[k].radius);
        for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i) {
            const float t = first_contact(path, boxes, list[k].radius, corners(mesh, i));
            if (t < expected[k].t) expected[k] = {t, i, 0};
        }
        hits += expected[k].prim != no_primitive;
    }
    std::cout << name << ": " << list.size() << " sweeps, " << hits << " hits\n";
    EXPECT_GT(hits, list.size() / 20);
    for (const char* builder : some_builders)
        for (const int threads : {1, 2, 7}) {
            const Bvh bvh = build_bvh(mesh, {.builder = builder_from_name(builder)});
            const std::vector<SweepHit> found = sweep_spheres(bvh, list, {.threads = threads});
            std::size_t wrong = 0;
            for (std::size_t k = 0; k < list.size(); ++k)
                wrong += !same_bits(found[k].t, expected[k].t) || found[k].prim != expected[k].prim;
            EXPECT_EQ(wrong, 0u) << name << ' ' << builder << ' ' << threads;
        }
}

TEST(Overlap, SweepsAreBruteForce) {
    const std::size_t n = 50 * test::thorough;
    expect_sweeps("soup", test::random_soup(1000, overlap_seed), sweeps(n, -1, 2, 0.1f));
    expect_sweeps("ball", test::ball_mesh({0, 0, 0}), sweeps(n, -200, 200, 20));
    expect_sweeps("lattice", test::lattice_mesh(300, 5, overlap_seed), sweeps(n, -3, 8, 0.3f));
}

/// The contact is at the radius, and nothing on the way to it is nearer.
TEST(Overlap, SweepsStopWhereTheDistanceIsTheRadius) {
    const Mesh mesh = test::random_soup(60, overlap_seed, 0.3f);
    const Bvh bvh = build_bvh(mesh);
    const auto distance = [&](const Ray& ray, double t) {
        const Vec3 p{float(ray.origin.x + t * ray.direction.x),
                     float(ray.origin.y + t * ray.direction.y),
                     float(ray.origin.z + t * ray.direction.z)};
        long double least = infinity;
        for (std::size_t i = 0; i < mesh.triangles.size(); ++i)
            least = std::min(least, test::region_distance(corners(mesh, i), p));
        return static_cast<double>(least);
    };
    std::size_t hits = 0;
    for (const SphereSweep& sweep : sweeps(100 + 20 * test::thorough, -1, 2, 0.2f)) {
        if (sweep.radius < 0.001f) continue;
        const SweepHit hit = sweep_sphere(bvh, sweep);
        const double end = hit.hit() ? hit.t : std::min(4.0f, sweep.path.tmax);
        for (int k = 0; k < 50; ++k) {
            const double t = sweep.path.tmin + (end - sweep.path.tmin) * k / 50;
            if (t < end) {
                EXPECT_GT(distance(sweep.path, t), sweep.radius - 2e-6) << hit.t << ' ' << t;
            }
        }
        if (!hit.hit()) continue;
        ++hits;
        if (hit.t > sweep.path.tmin) {
            EXPECT_NEAR(distance(sweep.path, hit.t), sweep.radius, 2e-6);
        } else {
            EXPECT_LT(distance(sweep.path, hit.t), sweep.radius + 2e-6);
        }
        const Vec3 d = hit.position - (sweep.path.origin + hit.t * sweep.path.direction);
        EXPECT_LT(std::sqrt(dot(d, d)), sweep.radius + 2e-6f);
    }
    EXPECT_GT(hits, 3u);
}

TEST(Overlap, SweepsWithoutARadiusAreRays) {
    const Mesh mesh = test::random_soup(1000, overlap_seed);
    const Bvh bvh = build_bvh(mesh);
    std::vector<SphereSweep> list = sweeps(500, -1, 2, 0.1f);
    for (SphereSweep& sweep : list) sweep.radius = 0;
    for (const SphereSweep& sweep : list) {
        const Hit ray = closest_hit(bvh, sweep.path);
        const SweepHit hit = sweep_sphere(bvh, sweep);
        EXPECT_TRUE(same_bits(hit.t, ray.t));
        EXPECT_EQ(hit.prim, ray.prim);
    }
}

/// A ball from so far away that rounding moves the contact past the box of the part that it is on.
TEST(Overlap, SweepsFromAfarFindParts) {
    const Mesh mesh{"",
                    {{-0x1.34938cp+23f, 0x1.a138bp+22f, -0x1.34cf46p+22f},
                     {-0x1.cfbd52p+36f, 0x1.7bb37p+36f, 0x1.01806p+37f},
                     {-0x1.1a848ap+21f, 0x1.dcea6p+22f, -0x1.8c1c38p+17f},
                     {-0x1.e4be76p+21f, 0x1.05abdcp+23f, -0x1.61ee94p+23f},
                     {-0x1.fd73b8p+36f, 0x1.f916b8p+30f, 0x1.3bacbep+35f},
                     {0x1.c632bep+21f, 0x1.2e14dep+24f, -0x1.c28622p+23f},
                     {-0x1.2d908p+23f, -0x1.ef3feep+16f, -0x1.2efe38p+23f},
                     {-0x1.2d908p+23f, 0x1.15bd82p+37f, -0x1.2efe38p+23f},
                     {-0x1.1eac02p+24f, -0x1.6fb6cap+22f, -0x1.40806ap+23f},
                     {0x1.22b696p+23f, 0x1.4beecp+19f, 0x1.c98902p+20f},
                     {-0x1.ddd8f2p+36f, 0x1.07b14cp+37f, 0x1.b2cb78p+35f},
                     {0x1.fbc8bap+23f, 0x1.0fbf4cp+23f, 0x1.f575aep+21f},
                     {0x1.2900c8p+22f, -0x1.30c82cp+21f, 0x1.b2a80cp+19f},
                     {0x1.2900c8p+22f, -0x1.30c82cp+21f, 0x1.15bdfep+37f},
                     {0x1.3c153cp+23f, -0x1.5d2e2ep+22f, 0x1.1ebe2ep+22f},
                     {-0x1.e451e8p+21f, -0x1.6a11p+22f, 0x1.49270ap+21f},
                     {-0x1.e451e8p+21f, -0x1.6a11p+22f, 0x1.15bedcp+37f},
                     {-0x1.be8d28p+23f, -0x1.094eecp+22f, 0x1.5e51dap+23f}},
                    {{0, 1, 2}, {3, 4, 5}, {6, 7, 8}, {9, 10, 11}, {12, 13, 14}, {15, 16, 17}}};
    const SphereSweep sweep{
        {{-0x1.d85f7p+33f, 0x1.48fc34p+36f, -0x1.4c7f6ep+92f}, 0, {0, 0, 0x1.15bd92p+37f}},
        0x1.8c1942p+29f};
    const SweepHit whole = sweep_sphere(build_bvh(mesh), sweep);
    ASSERT_TRUE(whole.hit());
    for (const Builder builder : {Builder::split, Builder::sbvh})
        for (const int max_leaf : {1, 2, 4}) {
            const Bvh bvh = build_bvh(mesh, {.builder = builder, .max_leaf = max_leaf});
            const SweepHit hit = sweep_sphere(bvh, sweep);
            EXPECT_EQ(hit.prim, whole.prim) << builder_name(builder) << ' ' << max_leaf;
            EXPECT_TRUE(same_bits(hit.t, whole.t));
        }
    EXPECT_TRUE(build_bvh(mesh, {.builder = Builder::sbvh, .max_leaf = 1}).has_split_primitives());
}

TEST(Overlap, NoSweepHasMinusZeroOrNoEnd) {
    const Mesh mesh{"", {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}, {0, 1, 2}}};
    const Bvh bvh = build_bvh(mesh);
    for (const float radius : {0.0f, 1e-30f, 0.5f, 1.0f})
        for (const float tmin : {0.0f, -0.0f})
            for (const Vec3 from : {Vec3{0, 0, 0}, Vec3{0.25f, 0.25f, 0}, Vec3{0, 0, 1}})
                for (const Vec3 d : {Vec3{0, 0, 1}, Vec3{0, 0, -1}, Vec3{-1, -1, -1}}) {
                    const SweepHit hit = sweep_sphere(bvh, {{from, tmin, d}, radius});
                    EXPECT_FALSE(hit.t == 0.0f && std::signbit(hit.t));
                    if (hit.hit()) {
                        EXPECT_EQ(hit.prim, 0u);
                    }
                }
    for (const float radius : {0.0f, 0.5f}) {
        EXPECT_FALSE(
            sweep_sphere(bvh, {{{0.2f, 0.2f, 3}, infinity, {0, 0, -1}, infinity}, radius}).hit());
        EXPECT_FALSE(sweep_sphere(bvh, {{{0.2f, 0.2f, 1e12f}, 0, {0, 0, -1e-30f}}, radius}).hit());
    }
}

TEST(Overlap, OddInput) {
    const Mesh mesh{"", {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}};
    const Bvh bvh = build_bvh(mesh), none;
    EXPECT_TRUE(touches(bvh, Segment{{0, 0, 0}, {0, 0, 0}}));
    EXPECT_FALSE(touches(none, Segment{{0, 0, 0}, {0, 0, 0}}));
    EXPECT_FALSE(touches(bvh, Segment{{overlap_nan, 0, 0}, {0, 0, 0}}));
    EXPECT_FALSE(touches(none, Sphere{{0, 0, 0}, 1}));
    EXPECT_TRUE(touches(bvh, Sphere{{0, 0, 1}, 1}));
    EXPECT_FALSE(touches(bvh, Sphere{{0, 0, 1}, 0.999f}));
    EXPECT_TRUE(touches(bvh, Sphere{{0, 0, 0}, 0}));
    EXPECT_EQ(sweep_sphere(none, {{{0, 0, 0}, 0, {0, 0, 1}}, 1}).prim, no_primitive);
    EXPECT_EQ(sweep_sphere(bvh, {{{0.2f, 0.2f, 3}, 0, {0, 0, -1}}, 1}).t, 2.0f);
    EXPECT_EQ(sweep_sphere(bvh, {{{0.2f, 0.2f, 0.5f}, 0.25f, {0, 0, -1}}, 1}).t, 0.25f)
        << "from the start";
    EXPECT_FALSE(sweep_sphere(bvh, {{{0.2f, 0.2f, 3}, 0, {0, 0, 1}}, 1}).hit());
    const std::vector<SphereSweep> bad{{{{0, 0, 0}, 0, {0, 0, 0}}, 1},
                                       {{{overlap_nan, 0, 0}, 0, {0, 0, 1}}, 1},
                                       {{{0, 0, 0}, 0, {0, 0, 1}}, -1},
                                       {{{0, 0, 0}, 0, {0, 0, 1}}, overlap_nan},
                                       {{{0, 0, 0}, 2, {0, 0, 1}, 1}, 1}};
    std::vector<SweepHit> hits(bad.size());
    EXPECT_EQ(sweep_spheres(bvh, bad, hits).invalid_queries, bad.size());
    for (const SweepHit& hit : hits) EXPECT_FALSE(hit.hit());
    EXPECT_THROW(sweep_spheres(bvh, bad, std::span(hits).first(1)), InputError);
    const Bvh points = build_bvh(std::span<const Vec3>(mesh.vertices));
    EXPECT_THROW(static_cast<void>(touches(points, Sphere{{0, 0, 0}, 1})), InputError);
    EXPECT_THROW(static_cast<void>(sweep_sphere(points, {})), InputError);
    const std::vector<Sphere> many(1000, Sphere{{0, 0, 0}, 1});
    EXPECT_THROW(static_cast<void>(touch_all(bvh, many, {.max_result_bytes = 11'999})),
                 ResultTooLarge);  // with the offsets
    EXPECT_EQ(touch_all(bvh, many, {.max_result_bytes = 50'000}).prims.size(), 1000u);
}

}  // namespace
}  // namespace raydix
