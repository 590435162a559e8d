// Rays through geometry of the caller's own, and through spheres, capsules and points with a
// radius, against a look at all of them.
#include <gtest/gtest.h>
#include <raydix/error.h>
#include <raydix/user_geometry.h>

#include <atomic>
#include <cmath>
#include <iostream>
#include <limits>
#include <random>

#include "base/double3.h"
#include "base/math.h"
#include "support/random.h"
#include "support/support.h"

namespace raydix {
namespace {

constexpr std::uint64_t seed = 19840723;
constexpr float nan = std::numeric_limits<float>::quiet_NaN();
constexpr const char* all_builders[] = {"karras", "lauterbach", "garanzha", "apetrei", "ploc",
                                        "hploc",  "binned",     "sweep",    "split",   "sbvh"};

using test::Random;

std::vector<Ray> random_rays(std::size_t count) {
    Random random(seed);
    std::vector<Ray> rays;
    for (std::size_t i = 0; i < count; ++i) {
        const Vec3 from = i % 2 ? random.in(0, 1) : random.in(-3, 4);
        Ray ray{from, 0, random.in(0, 1) - from};
        if (i % 5 == 0) ray.direction = {0, i % 10 ? -2.0f : 1.0f, 0};
        if (i % 7 == 0) ray.tmax = random.between(0.3f, 1.0f);
        if (i % 9 == 0) ray.tmin = random.between(0.0f, 0.5f);
        rays.push_back(ray);
    }
    return rays;
}

bool same(const Hit& a, const Hit& b) {
    return a.t == b.t && a.prim == b.prim && a.u == b.u && a.v == b.v;
}

void expect_brute_force(const std::string& name, const std::vector<Aabb>& boxes,
                        const IntersectPrimitive& intersect, const std::vector<Ray>& rays) {
    std::vector<Hit> expected(rays.size());
    std::size_t hits = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
        for (std::uint32_t prim = 0; prim < boxes.size(); ++prim) {
            Hit hit;
            if (!is_empty(boxes[prim]) && intersect(prim, rays[i], hit) && hit.t < expected[i].t)
                expected[i] = hit_of_tree({hit.t, prim, hit.u, hit.v});
        }
        hits += expected[i].hit();
    }
    std::cout << name << ": " << rays.size() << " rays, " << hits << " hits\n";
    EXPECT_GT(hits, rays.size() / 20);
    for (const char* builder : all_builders) {
        const Bvh bvh = build_bvh(boxes, {.builder = builder_from_name(builder)});
        for (const int threads : {1, 2, 7}) {
            std::vector<Hit> found(rays.size());
            std::vector<std::uint8_t> occluded(rays.size());
            const TraceCounts counts = trace(bvh, intersect, rays, found, {.threads = threads});
            trace_any(bvh, intersect, rays, occluded, {.threads = threads});
            EXPECT_EQ(counts.hits, hits);
            std::size_t wrong = 0;
            for (std::size_t i = 0; i < rays.size(); ++i)
                wrong += !same(found[i], expected[i]) || (occluded[i] != 0) != expected[i].hit();
            EXPECT_EQ(wrong, 0u) << name << ' ' << builder << ' ' << threads << ", seed " << seed;
        }
        EXPECT_TRUE(same(closest_hit(bvh, intersect, rays[3]), expected[3]));
        EXPECT_EQ(any_hit(bvh, intersect, rays[3]), expected[3].hit());
    }
}

std::vector<Sphere> spheres(std::size_t count) {
    Random random(seed + 1);
    std::vector<Sphere> list;
    for (std::size_t i = 0; i < count; ++i)
        list.push_back({random.in(0, 1), random.between(0.0f, 0.06f)});
    list.push_back(list[0]);  // the same again: the lower id wins
    list.push_back({{nan, 0, 0}, 1});
    list.push_back({{0.5f, 0.5f, 0.5f}, -0.1f});
    list.push_back({{0.5f, 0.5f, 0.5f}, nan});
    return list;
}

TEST(Shapes, SpheresCapsulesAndPointsAreBruteForce) {
    const std::vector<Ray> rays = random_rays(60 * test::thorough);
    const std::vector<Sphere> balls = spheres(800);
    expect_brute_force("spheres", boxes_of(balls), intersect_spheres(balls), rays);
    Random random(seed + 2);
    std::vector<Capsule> capsules;
    for (int i = 0; i < 600; ++i) {
        const Vec3 a = random.in(0, 1);
        const Vec3 b = i % 5 == 0   ? a
                       : i % 5 == 1 ? Vec3{a.x, a.y + 0.2f, a.z}
                                    : a + random.in(-0.15f, 0.15f);
        capsules.push_back({a, b, random.between(0, 0.04f)});
    }
    capsules.push_back({{nan, 0, 0}, {0, 0, 0}, 1});
    capsules.push_back({{0, 0, 0}, {0, nan, 0}, 1});
    capsules.push_back({{0, 0, 0}, {0, 0, 0}, -1});
    EXPECT_EQ(build_bvh(boxes_of(capsules)).left_out(), 3u);
    expect_brute_force("capsules", boxes_of(capsules), intersect_capsules(capsules), rays);
    std::vector<Vec3> points;
    for (int i = 0; i < 1000; ++i) points.push_back(random.in(0, 1));
    expect_brute_force("points", boxes_of(points, 0.03f), intersect_points(points, 0.03f), rays);
    EXPECT_EQ(build_bvh(boxes_of(points, -1.0f)).left_out(), points.size());
    EXPECT_EQ(build_bvh(boxes_of(points, 0.0f)).left_out(), 0u);
}

/// A hit needs a finite t: rays that begin at infinity, and shapes so far away for the length of
/// the direction that t has no float.
TEST(Shapes, AHitIsAtAFinitePlace) {
    const std::vector<Sphere> balls{{{0, 0, 10}, 1}, {{0, 0, 10}, 0}};
    const std::vector<Capsule> capsules{{{0, 0, 10}, {0, 0, 11}, 1}, {{0, -1, 10}, {0, 1, 10}, 0}};
    const std::vector<Vec3> points{{0, 0, 10}, {0, 0, 20}};
    const std::vector<Ray> rays{
        {{0, 0, 0}, infinity, {0, 0, 1}, infinity}, {{0, 0, 10}, infinity, {0, 0, 1}, infinity},
        {{0, 0, 0}, infinity, {1, 0, 0}, infinity}, {{0, 0, 0}, 0, {0, 0, 1e-38f}, infinity},
        {{0, 0, 0}, 0, {0, 0, 1e-45f}, infinity},   {{0, 0, 0}, 1e30f, {0, 0, 1e-38f}, infinity}};
    const auto expect_none = [&](const std::vector<Aabb>& boxes,
                                 const IntersectPrimitive& intersect) {
        for (const int max_leaf : {1, 4}) {
            const Bvh bvh = build_bvh(boxes, {.max_leaf = max_leaf});
            std::vector<Hit> hits(rays.size());
            std::vector<std::uint8_t> occluded(rays.size());
            EXPECT_EQ(trace(bvh, intersect, rays, hits).hits, 0u);
            EXPECT_EQ(trace_any(bvh, intersect, rays, occluded).hits, 0u);
            for (const Ray& ray : rays) {
                EXPECT_FALSE(closest_hit(bvh, intersect, ray).hit());
                Hit hit;
                for (const std::uint32_t prim : {0u, 1u}) EXPECT_FALSE(intersect(prim, ray, hit));
            }
        }
    };
    expect_none(boxes_of(balls), intersect_spheres(balls));
    expect_none(boxes_of(capsules), intersect_capsules(capsules));
    expect_none(boxes_of(points, 0.5f), intersect_points(points, 0.5f));
    // Whatever the function says.
    const std::vector<Aabb> walls(5, Aabb{{-1, -1, 1}, {1, 1, 1}});
    const IntersectPrimitive endless = [](std::uint32_t, const Ray&, Hit& hit) {
        hit.t = infinity;
        return true;
    };
    const Bvh bvh = build_bvh(walls);
    EXPECT_FALSE(closest_hit(bvh, endless, {{0, 0, 0}, 0, {0, 0, 1}}).hit());
    EXPECT_FALSE(any_hit(bvh, endless, {{0, 0, 0}, 0, {0, 0, 1}}));
}

/// From so far that a step of double is longer than the scene, along an axis: what is across the
/// ray has all its digits. t in units of the scaled direction is beyond all floats.
TEST(Shapes, FromTheEndOfAllFloats) {
    const std::vector<Capsule> capsules{{{-0x1.c5be4ep-1f, -0x1.00a458p-3f, 0x1.bbe5ecp-2f},
                                         {0x1.ec0ebep+11f, 0x1.0d42a4p+12f, 0x1.57c2e4p+11f},
                                         0x1.27bfccp-1f}};
    const std::vector<Sphere> balls{{{0.4f, 1.9f, 5.0f}, 0.25f}};
    const Bvh pipe = build_bvh(boxes_of(capsules)), ball = build_bvh(boxes_of(balls));
    const auto pipe_hit = [&](float x, float y, float speed) {
        return closest_hit(pipe, intersect_capsules(capsules),
                           {{x, y, 0x1.ff933cp+127f}, 0, {0, 0, speed}});
    };
    EXPECT_EQ(pipe_hit(0x1.a6ba7p-2f, 0x1.dfeb74p+0f, -0x1.504aa2p+9f).t, 0x1.856f02p+118f);
    EXPECT_TRUE(pipe_hit(0x1.a6ba7p-2f, 0x1.dfeb74p+0f, -1.0f).hit());
    EXPECT_FALSE(pipe_hit(0x1.a6ba7p-2f, 0x1.dfeb74p+0f, 1.0f).hit());
    EXPECT_FALSE(pipe_hit(-2.0f, 2.0f, -100.0f).hit());
    const auto ball_hit = [&](float x) {
        return any_hit(ball, intersect_spheres(balls), {{x, 1.9f, 3e38f}, 0, {0, 0, -700.0f}});
    };
    EXPECT_TRUE(ball_hit(0.64f));
    EXPECT_FALSE(ball_hit(0.66f));
}

/// Rays that begin on a shape without a radius, or less than any float before its surface.
TEST(Shapes, NoTIsMinusZero) {
    const auto expect_plus = [](const std::vector<Aabb>& boxes, const IntersectPrimitive& intersect,
                                const std::vector<Ray>& rays) {
        const Bvh bvh = build_bvh(boxes);
        for (const Ray& ray : rays) {
            const Hit hit = closest_hit(bvh, intersect, ray);
            ASSERT_TRUE(hit.hit());
            EXPECT_EQ(hit.t, 0.0f);
            EXPECT_FALSE(std::signbit(hit.t));
            Hit own;
            ASSERT_TRUE(intersect(hit.prim, ray, own));
            EXPECT_FALSE(std::signbit(own.t));
        }
    };
    std::vector<Ray> rays;
    for (const float tmin : {0.0f, -0.0f})
        for (const Vec3 d : {Vec3{0, 0, 1}, Vec3{0, 0, -1}, Vec3{-1, -2, -3}, Vec3{-1e-20f, 0, 0}})
            rays.push_back({{0, 0, 0}, tmin, d});
    const std::vector<Sphere> balls{{{0, 0, 0}, 0}, {{-0.0f, -0.0f, -0.0f}, 0}};
    expect_plus(boxes_of(balls), intersect_spheres(balls), rays);
    const std::vector<Capsule> capsules{{{0, 0, 0}, {0, 0, 0}, 0}};
    expect_plus(boxes_of(capsules), intersect_capsules(capsules), rays);
    const std::vector<Vec3> points{{0, 0, 0}};
    expect_plus(boxes_of(points, 0.0f), intersect_points(points, 0.0f), rays);
    const IntersectPrimitive minus = [](std::uint32_t, const Ray& ray, Hit& hit) {
        hit.t = -0.0f;
        return !std::signbit(ray.tmin);
    };
    const Bvh bvh = build_bvh(std::vector<Aabb>(3, Aabb{{-1, -1, -1}, {1, 1, 1}}));
    for (const Ray& ray : rays) EXPECT_FALSE(std::signbit(closest_hit(bvh, minus, ray).t));
}

double segment_distance(Double3 p, const Capsule& c) {
    const Double3 a(c.a), axis = Double3(c.b) - a;
    const double length2 = dot(axis, axis);
    const double s = length2 > 0 ? std::min(1.0, std::max(0.0, dot(p - a, axis) / length2)) : 0.0;
    return length(p - (a + axis * s));
}

/// A hit is on the surface, and the ray crosses none before it.
TEST(Shapes, HitsAreOnTheSurface) {
    Random random(seed);
    std::size_t hits = 0, from_inside = 0;
    for (const Ray& ray : random_rays(200 * test::thorough)) {
        const std::vector<Capsule> one{
            {random.in(0, 1), random.in(0, 1), random.between(0.01f, 0.4f)}};
        Hit hit;
        const bool found = intersect_capsules(one)(0, ray, hit);
        const Double3 o(ray.origin), d(ray.direction);
        const auto side = [&](double t) {
            return segment_distance(o + d * t, one[0]) - one[0].radius;
        };
        const double end = found ? double(hit.t) : std::min(20.0f, ray.tmax);
        const bool inside = side(ray.tmin) < 0;
        for (int k = 0; k <= 100; ++k) {
            const double t = ray.tmin + (end - ray.tmin) * k / 100, at = side(t);
            if (std::fabs(at) > 1e-5) {
                EXPECT_EQ(at < 0, inside) << "t " << t << " of " << end;
            }
        }
        if (!found) continue;
        ++hits;
        from_inside += inside;
        EXPECT_NEAR(side(hit.t), 0.0, 1e-6 * (1 + length(d) * hit.t));
    }
    std::cout << hits << " hits, " << from_inside << " from inside\n";
    EXPECT_GT(hits, 10 * test::thorough);
    EXPECT_GT(from_inside, test::thorough);
}

TEST(UserGeometry, IsWhatTheFunctionSays) {
    // Walls at x = prim, seen by a function that knows no boxes; the last two tie.
    std::vector<Aabb> boxes;
    for (int i = 0; i < 5; ++i) boxes.push_back({{float(i), -1, -1}, {float(i), 1, 1}});
    boxes.push_back(boxes[2]);
    std::atomic<int> calls{0};
    const IntersectPrimitive wall = [&](std::uint32_t prim, const Ray& ray, Hit& hit) {
        ++calls;
        if (prim < 2) return false;  // says no, whatever the box
        hit.t = (float(prim == 5 ? 2 : prim) - ray.origin.x) / ray.direction.x;
        hit.u = 0.25f;
        return true;
    };
    const Bvh bvh = build_bvh(boxes, {.max_leaf = 1});
    const Hit hit = closest_hit(bvh, wall, {{-10, 0, 0}, 0, {2, 0, 0}});
    EXPECT_EQ(hit.t, 6.0f);
    EXPECT_EQ(hit.prim, 2u) << "the lower id wins";
    EXPECT_EQ(hit.u, 0.25f);
    EXPECT_GT(calls.load(), 0);
    EXPECT_FALSE(closest_hit(bvh, wall, {{-10, 0, 0}, 0, {2, 0, 0}, 5.5f}).hit());
    EXPECT_FALSE(closest_hit(bvh, wall, {{-10, 5, 0}, 0, {2, 0, 0}}).hit()) << "beside all boxes";
    EXPECT_EQ(closest_hit(bvh, wall, {{-10, 0, 0}, 6.4f, {2, 0, 0}}).prim, 3u);
    // Answers outside the ray, or NaN, are no hits.
    const IntersectPrimitive liar = [](std::uint32_t prim, const Ray&, Hit& h) {
        h.t = prim == 0 ? -5.0f : prim == 1 ? nan : infinity;
        return true;
    };
    EXPECT_FALSE(any_hit(bvh, liar, {{-10, 0, 0}, 0, {2, 0, 0}, 100}));
    // What it throws comes out.
    const IntersectPrimitive thrower = [](std::uint32_t, const Ray&, Hit&) -> bool {
        throw InputError("mine");
    };
    const std::vector<Ray> rays(2000, Ray{{-10, 0, 0}, 0, {1, 0, 0}});
    std::vector<Hit> hits(rays.size());
    EXPECT_THROW(trace(bvh, thrower, rays, hits), InputError);
    EXPECT_THROW(trace(bvh, wall, rays, std::span(hits).first(3)), InputError);
    EXPECT_EQ(trace(Bvh(), wall, rays, hits).hits, 0u);
    const std::vector<Ray> bad{{{nan, 0, 0}, 0, {1, 0, 0}}};
    EXPECT_EQ(trace(bvh, wall, bad, std::span(hits).first(1)).invalid_rays, 1u);
    EXPECT_GE(trace(bvh, wall, rays, hits, {.counters = true}).triangle_tests, rays.size());
}

}  // namespace
}  // namespace raydix
