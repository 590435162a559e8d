// The triangle test alone: edges, faces, scales, limits, triangles without area, odd rays.
#include "trace/triangle_test.h"

#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <iostream>
#include <optional>
#include <random>
#include <vector>

#include "support/oracle.h"

namespace raydix::test {
namespace {

using Random = std::mt19937_64;

template <EdgeRule rule = EdgeRule::closed>
std::optional<Hit> shoot(const Ray& ray, const LeafTriangle& triangle) {
    if (!is_valid(ray)) return std::nullopt;
    const RayFrame frame = make_frame(ray);
    TriangleHit hit;
    if (!intersect_triangle<rule>(frame, triangle, frame.tmax, hit)) return std::nullopt;
    return hit_of_tree({hit.t * frame.t_scale, 0, hit.u, hit.v});
}

Vec3 turned(Vec3 p, int axis) {  // z goes to `axis`, the winding stays
    return axis == 2 ? p : axis == 1 ? Vec3{p.y, p.z, p.x} : Vec3{p.z, p.x, p.y};
}
LeafTriangle turned(const LeafTriangle& t, int axis) {
    return {turned(t.v0, axis), turned(t.v1, axis), turned(t.v2, axis)};
}
LeafTriangle flipped(const LeafTriangle& t) { return {t.v0, t.v2, t.v1}; }
LeafTriangle scaled(const LeafTriangle& t, float s) { return {t.v0 * s, t.v1 * s, t.v2 * s}; }

const LeafTriangle right_angled{{0, 0, 5}, {4, 0, 5}, {0, 4, 5}};

TEST(TriangleTest, DistanceAndBarycentricsOnAllAxesAndFaces) {
    for (int axis = 0; axis < 3; ++axis)
        for (const float side : {1.0f, -1.0f}) {
            const Vec3 origin = turned(Vec3{1, 2, 5 - 5 * side}, axis);
            const Vec3 direction = turned(Vec3{0, 0, side}, axis);
            const LeafTriangle triangle = turned(right_angled, axis);
            const auto hit = shoot({origin, 0, direction, infinity}, triangle);
            ASSERT_TRUE(hit) << axis << " " << side;
            EXPECT_EQ(hit->t, 5.0f);
            EXPECT_EQ(hit->u, 0.25f);
            EXPECT_EQ(hit->v, 0.5f);
            const auto back = shoot({origin, 0, direction, infinity}, flipped(triangle));
            ASSERT_TRUE(back);
            EXPECT_EQ(back->t, 5.0f);
            EXPECT_EQ(back->u, 0.5f);
            EXPECT_EQ(back->v, 0.25f);
        }
}

TEST(TriangleTest, AgreesWithDoubleOnRandomTriangles) {
    constexpr std::uint64_t seed = 5;
    std::cout << "seed " << seed << "\n";
    Random random(seed);
    const auto unit = [&] { return static_cast<float>(random() >> 40) * 0x1p-23f - 1.0f; };
    const auto point = [&] { return Vec3{unit(), unit(), unit()}; };
    int hits = 0;
    for (int i = 0; i < 200'000; ++i) {
        const LeafTriangle t{point(), point(), point()};
        const Ray ray{point(), 0, point(), infinity};
        const auto hit = shoot(ray, t);
        const OracleHit exact = oracle_intersect(t.v0, t.v1, t.v2, ray);
        const OracleSlack slack = oracle_slack(t.v0, t.v1, t.v2, ray);
        const double edge = std::min({exact.u, exact.v, 1 - exact.u - exact.v});
        if (std::abs(edge) > slack.edge && std::abs(exact.t) > slack.t) {
            ASSERT_EQ(hit.has_value(), edge > 0 && exact.t > 0) << i;
        }
        if (!hit) continue;
        ++hits;
        EXPECT_NEAR(hit->t, exact.t, slack.t) << i;
        EXPECT_NEAR(hit->u, exact.u, slack.edge) << i;
        EXPECT_NEAR(hit->v, exact.v, slack.edge) << i;
    }
    EXPECT_GT(hits, 5000);
}

/// The theorem that culling stands on (docs/algorithms/triangle-test.md): on every axis the ray at
/// t is within 2 F + 6 Fz roundings of the point that u and v name, which are rounded, too.
TEST(TriangleTest, PointAtTIsNearTheRay) {
    constexpr std::uint64_t seed = 15;
    Random random(seed);
    const auto unit = [&] { return static_cast<float>(random() >> 40) * 0x1p-23f - 1.0f; };
    const auto point = [&](float size) {
        return Vec3{unit() * size, unit() * size, unit() * size};
    };
    int hits = 0;
    long double worst = 0;
    for (int i = 0; i < 400'000; ++i) {
        const auto power = [&](int most) {
            return std::ldexp(1.0f, static_cast<int>(random() % static_cast<unsigned>(most)));
        };
        LeafTriangle t{point(1), {}, {}};
        t.v1 = t.v0 + point(power(24));
        t.v2 = t.v0 + point(1.0f / power(16));
        const float a = std::fabs(unit()), b = (1.0f - a) * std::fabs(unit());
        Ray ray{point(power(20)), 0, {}, infinity};
        ray.direction = (t.v0 * (1.0f - a - b) + t.v1 * a + t.v2 * b) - ray.origin;
        const auto hit = shoot(ray, t);
        if (!hit) continue;
        ++hits;
        const int kz = make_frame(ray).kz;
        const auto at = [](Vec3 p, int axis) {
            return static_cast<long double>(component(p, axis));
        };
        const auto far = [&](int axis) {
            const long double o = at(ray.origin, axis);
            return std::max({std::abs(at(t.v0, axis) - o), std::abs(at(t.v1, axis) - o),
                             std::abs(at(t.v2, axis) - o)});
        };
        for (int axis = 0; axis < 3; ++axis) {
            const long double e1 = at(t.v1, axis) - at(t.v0, axis),
                              e2 = at(t.v2, axis) - at(t.v0, axis);
            const long double off =
                std::abs(at(ray.origin, axis) + hit->t * at(ray.direction, axis) -
                         (at(t.v0, axis) + hit->u * e1 + hit->v * e2));
            const long double rounded = 0x1p-25L * (std::abs(e1) + std::abs(e2));
            const long double bound = 0x1p-24L * (2 * far(axis) + 6 * far(kz));
            worst = std::max(worst, (off - rounded) / bound);
            ASSERT_LE(off - rounded, bound) << "seed " << seed << " case " << i;
        }
    }
    std::cout << hits << " hits, at most " << worst << " of the bound off\n";
    EXPECT_GT(hits, 100'000);
}

TEST(TriangleTest, ClosedRuleOwnsItsEdgesAndVertices) {
    const Vec3 border[] = {{0, 0, 0}, {4, 0, 0}, {0, 4, 0}, {2, 0, 0}, {0, 2, 0},
                           {2, 2, 0}, {1, 3, 0}, {3, 1, 0}, {0, 3, 0}};
    const Vec3 outside[] = {{-1, 0, 0}, {5, 0, 0}, {0, -1, 0}, {3, 2, 0}, {2, 3, 0}, {4, 4, 0}};
    for (int axis = 0; axis < 3; ++axis)
        for (const Vec3 lean : {Vec3{0, 0, 1}, {1, -1, 2}, {-3, 1, 4}, {1, 1, -1}}) {
            const LeafTriangle triangle = turned(right_angled, axis);
            const auto towards = [&](Vec3 p) {
                const Vec3 target = p + Vec3{0, 0, 5};
                return Ray{turned(target - lean * 8.0f, axis), 0, turned(lean, axis), infinity};
            };
            for (const Vec3 p : border) {
                EXPECT_TRUE(shoot(towards(p), triangle)) << axis << " " << p.x << " " << p.y;
                EXPECT_TRUE(shoot(towards(p), flipped(triangle))) << axis << " " << p.x;
            }
            for (const Vec3 p : outside) {
                EXPECT_FALSE(shoot(towards(p), triangle)) << axis << " " << p.x << " " << p.y;
                EXPECT_FALSE(shoot<EdgeRule::half_open>(towards(p), triangle)) << axis;
            }
        }
}

/// Eight triangles around the origin, on a plane or folded, all wound the same way.
std::vector<LeafTriangle> make_fan(Vec3 slope, float fold) {
    const int ring[8][2] = {{2, 0}, {2, 2}, {0, 2}, {-2, 2}, {-2, 0}, {-2, -2}, {0, -2}, {2, -2}};
    const auto corner = [&](std::size_t k) {
        const auto x = static_cast<float>(ring[k % 8][0]), y = static_cast<float>(ring[k % 8][1]);
        return Vec3{x, y, slope.x * x + slope.y * y + fold * (x * x + y * y)};
    };
    std::vector<LeafTriangle> fan;
    for (std::size_t k = 0; k < 8; ++k) fan.push_back({{0, 0, 0}, corner(k), corner(k + 1)});
    return fan;
}

template <EdgeRule rule>
int count_hits(const Ray& ray, const std::vector<LeafTriangle>& fan, int axis, bool flip) {
    int hits = 0;
    for (const LeafTriangle& t : fan) {
        const LeafTriangle triangle = turned(t, axis);
        hits += shoot<rule>(ray, flip ? flipped(triangle) : triangle).has_value();
    }
    return hits;
}

TEST(TriangleTest, FaultTwoHitsOnOneSharedEdge) {
    const Vec3 directions[] = {{0, 0, 1},  {0, 0, -1}, {1, 0, 4},
                               {-1, 2, 8}, {1, 1, -4}, {3, -2, 8}};
    for (const float fold : {0.0f, 0.125f})
        for (const Vec3 direction : directions)
            for (int axis = 0; axis < 3; ++axis)
                for (const bool flip : {false, true}) {
                    const auto fan = make_fan({0.25f, -0.5f, 0}, fold);
                    const auto aim = [&](Vec3 p) {
                        return Ray{turned(p - direction * 16.0f, axis), 0, turned(direction, axis),
                                   infinity};
                    };
                    const Ray centre = aim({0, 0, 0});
                    EXPECT_EQ(count_hits<EdgeRule::half_open>(centre, fan, axis, flip), 1);
                    EXPECT_EQ(count_hits<EdgeRule::closed>(centre, fan, axis, flip), 8);
                    for (const LeafTriangle& t : fan) {
                        const Ray spoke = aim(t.v1 * 0.5f);
                        EXPECT_EQ(count_hits<EdgeRule::half_open>(spoke, fan, axis, flip), 1);
                        EXPECT_EQ(count_hits<EdgeRule::closed>(spoke, fan, axis, flip), 2);
                    }
                }
}

/// Whatever rounding does to the vertices, one that lies within the fan's outline counts once.
TEST(TriangleTest, FanWithRoundedCoordinatesCountsOnce) {
    constexpr std::uint64_t seed = 17;
    std::cout << "seed " << seed << "\n";
    Random random(seed);
    const auto unit = [&] { return static_cast<float>(random() >> 40) * 0x1p-23f - 1.0f; };
    for (int round = 0; round < 20'000; ++round) {
        auto fan = make_fan({0.3f * unit(), 0.3f * unit(), 0}, 0.0f);
        const Vec3 shift{1e3f * unit(), 1e3f * unit(), 1e3f * unit()};
        for (LeafTriangle& t : fan) t = {t.v0 + shift, t.v1 + shift, t.v2 + shift};
        const Vec3 spoke = fan[random() % 8].v1;
        const Vec3 target = round % 2 ? fan[0].v0 : 0.5f * (fan[0].v0 + spoke);
        const Vec3 direction{0.3f * unit(), 0.3f * unit(), 1 + 0.1f * unit()};
        const Ray ray{target - direction * 64.0f, 0, direction, infinity};
        ASSERT_EQ(count_hits<EdgeRule::half_open>(ray, fan, round % 3, false),
                  round % 3 == 2 ? 1 : 0)
            << round;
    }
}

/// The edge beside the ray has an edge function of 2e-50: 0 as a float, but the ray is outside.
TEST(TriangleTest, EdgeFunctionsThatUnderflowKeepTheirSigns) {
    for (int axis = 0; axis < 3; ++axis)
        for (const float side : {1.0f, -1.0f}) {
            const LeafTriangle beside{
                {side * 1e-30f, -1e-20f, 5}, {side * 1e-30f, 1e-20f, 5}, {side, 0, 5}};
            const LeafTriangle around{
                {-side * 1e-30f, -1e-20f, 5}, {-side * 1e-30f, 1e-20f, 5}, {side, 0, 5}};
            const Ray ray{{0, 0, 0}, 0, turned(Vec3{0, 0, 1}, axis), infinity};
            for (const bool flip : {false, true}) {
                const auto faced = [&](const LeafTriangle& t) {
                    return turned(flip ? flipped(t) : t, axis);
                };
                EXPECT_FALSE(shoot(ray, faced(beside))) << axis << " " << side << " " << flip;
                EXPECT_TRUE(shoot(ray, faced(around))) << axis << " " << side << " " << flip;
            }
        }
}

TEST(TriangleTest, EdgeFunctionTurnsItsSignExactly) {
    Random random(23);
    const auto wild = [&] {
        return std::ldexp(static_cast<float>(static_cast<std::int32_t>(random())),
                          static_cast<int>(random() % 80) - 60);
    };
    for (int i = 0; i < 100'000; ++i) {
        const ShearedVertex a{wild(), wild(), 0}, b{wild(), wild(), 0};
        ASSERT_EQ(edge_function(a, b), -edge_function(b, a));
        ASSERT_EQ(perturbed_edge_sign(a, b), -perturbed_edge_sign(b, a));
        ASSERT_NE(perturbed_edge_sign(a, b), 0);
    }
    const ShearedVertex p{1.5f, -2.5f, 3};
    EXPECT_EQ(perturbed_edge_sign(p, p), 0);
}

TEST(TriangleTest, DirectionLengthScalesOnlyT) {
    const LeafTriangle tilted{{-1, -2, 1}, {3, -1, 1.25f}, {0, 4, 1.5f}};
    const Vec3 direction{0.125f, 0.0625f, 1};
    const auto plain = shoot({{0.1f, 0.2f, 0}, 0, direction, infinity}, tilted);
    ASSERT_TRUE(plain);
    for (int k = -120; k <= 120; ++k) {
        const float s = std::ldexp(1.0f, k);
        const auto hit = shoot({{0.1f, 0.2f, 0}, 0, direction * s, infinity}, tilted);
        ASSERT_TRUE(hit) << k;
        EXPECT_EQ(hit->t, plain->t / s) << k;
        EXPECT_EQ(hit->u, plain->u) << k;
        EXPECT_EQ(hit->v, plain->v) << k;
    }
    const auto straight = shoot({{0.1f, 0.2f, 0}, 0, {0, 0, 1}, infinity}, tilted);
    ASSERT_TRUE(straight);
    for (const float length : {1e-38f, 1e-30f, 1e-10f, 1e10f, 1e30f, 1e38f}) {
        const auto hit = shoot({{0.1f, 0.2f, 0}, 0, {0, 0, length}, infinity}, tilted);
        ASSERT_TRUE(hit) << length;
        EXPECT_NEAR(double(hit->t) * double(length) / straight->t, 1.0, 1e-6) << length;
    }
}

TEST(TriangleTest, CoordinatesFromTinyToHuge) {
    const LeafTriangle tilted{{-0.5f, -0.75f, 0.25f}, {0.75f, -0.5f, 0.5f}, {0, 0.875f, 0.75f}};
    for (const float size : {1e-6f, 1e-3f, 1.0f, 1e3f, 1e6f, 1e9f, 1e12f})
        for (const float length : {1e-38f, 1e-20f, 1e-9f, 1e-3f, 1.0f, 1e3f, 1e9f, 1e20f, 1e38f}) {
            if (size / length > 1e38f) continue;  // t would not be a float
            const LeafTriangle triangle = scaled(tilted, size);
            const Ray ray{Vec3{0.0625f, 0.125f, -1} * size, 0, Vec3{0.125f, -0.0625f, 1} * length,
                          infinity};
            const OracleHit exact = oracle_intersect(triangle.v0, triangle.v1, triangle.v2, ray);
            ASSERT_TRUE(exact.inside());
            if (exact.t < 1e-36) continue;  // nor here
            const auto hit = shoot(ray, triangle);
            ASSERT_TRUE(hit) << size << " " << length;
            EXPECT_NEAR(hit->t / exact.t, 1.0, 1e-6) << size << " " << length;
            EXPECT_NEAR(hit->u, exact.u, 1e-6) << size << " " << length;
            EXPECT_NEAR(hit->v, exact.v, 1e-6) << size << " " << length;
        }
}

TEST(TriangleTest, ZeroAreaAndRepeatedIndicesAreNeverHit) {
    const LeafTriangle flat[] = {
        {{1, 2, 3}, {1, 2, 3}, {1, 2, 3}},    {{0, 0, 0}, {4, 0, 0}, {4, 0, 0}},
        {{0, 0, 0}, {1, 2, 3}, {3, 6, 9}},    {{1, 1, 1}, {4, 5, 7}, {7, 9, 13}},
        {{-3, 1, 2}, {3, -1, -2}, {0, 0, 0}}, {{0, 0, 0}, {0, 1, 0}, {0, 5, 0}}};
    Random random(3);
    const auto small = [&] { return static_cast<float>(static_cast<int>(random() % 9) - 4); };
    int aimed = 0;
    for (int i = 0; i < 20'000; ++i)
        for (const LeafTriangle& t : flat) {
            const Vec3 direction{small(), small(), small()};
            const Vec3 targets[] = {t.v0, t.v1, t.v2, 0.5f * (t.v0 + t.v1), 0.5f * (t.v1 + t.v2)};
            const Ray ray{targets[i % 5] - direction * 4.0f, 0, direction, infinity};
            aimed += is_valid(ray);
            ASSERT_FALSE(shoot<EdgeRule::closed>(ray, t)) << i;
            ASSERT_FALSE(shoot<EdgeRule::half_open>(ray, t)) << i;
        }
    EXPECT_GT(aimed, 100'000);
}

TEST(TriangleTest, LimitsAreInclusive) {
    const float above = std::nextafter(5.0f, 6.0f), below = std::nextafter(5.0f, 4.0f);
    const auto within = [](float tmin, float tmax) {
        return shoot({{1, 1, 0}, tmin, {0, 0, 1}, tmax}, right_angled).has_value();
    };
    EXPECT_TRUE(within(0, 5));
    EXPECT_TRUE(within(5, infinity));
    EXPECT_TRUE(within(5, 5));
    EXPECT_FALSE(within(above, infinity));
    EXPECT_FALSE(within(0, below));
    EXPECT_FALSE(within(above, 5)) << "tmin above tmax";
    const auto from_surface = [](float tmin) {
        return shoot({{1, 1, 5}, tmin, {0, 0, 1}, infinity}, right_angled).has_value();
    };
    EXPECT_TRUE(from_surface(0));
    EXPECT_TRUE(from_surface(-1));
    EXPECT_FALSE(from_surface(1e-45f));
    const Ray beyond{{1, 1, 6}, -100, {0, 0, 1}, infinity};
    EXPECT_FALSE(shoot(beyond, right_angled)) << "a negative tmin counts as 0";
}

TEST(TriangleTest, SignsOfZeroChangeNothing) {
    const LeafTriangle triangle{{-1, -1, 3}, {2, -1, 3.5f}, {-1, 2, 4}};
    const auto plain = shoot({{0, 0, 0}, 0, {0, 0, 1}, infinity}, triangle);
    ASSERT_TRUE(plain);
    for (int signs = 0; signs < 32; ++signs) {
        const auto zero = [signs](int k) { return signs >> k & 1 ? -0.0f : 0.0f; };
        const Ray ray{{zero(0), zero(1), zero(2)}, 0, {zero(3), zero(4), 1}, infinity};
        const auto hit = shoot(ray, triangle);
        ASSERT_TRUE(hit);
        EXPECT_EQ(std::memcmp(&*hit, &*plain, sizeof(Hit)), 0) << signs;
    }
}

/// contract.md 1: coordinates beyond 1e12 count as non-finite.
TEST(TriangleTest, OriginsOutOfRangeGiveNoNaN) {
    Random random(29);
    const auto unit = [&] { return static_cast<float>(random() >> 40) * 0x1p-23f - 1.0f; };
    int hits = 0;
    for (const float far : {1e6f, 1e12f, 1.1e12f, 1e20f, 1e30f, 1e37f})
        for (int i = 0; i < 2000; ++i) {
            const Vec3 direction{unit(), unit(), unit()};
            const Ray ray{direction * -far, 0, direction, infinity};
            const auto hit = shoot(ray, scaled(right_angled, far * 1e-2f));
            if (!hit) continue;
            ++hits;
            ASSERT_TRUE(hit->u >= 0 && hit->v >= 0 && hit->u + hit->v <= 1.0001f)
                << far << ": " << hit->u << " " << hit->v;
        }
    EXPECT_GT(hits, 0);
}

TEST(TriangleTest, NonFiniteRaysAreInvalid) {
    const Ray good{{1, 1, 0}, 0, {0, 0, 1}, infinity};
    ASSERT_TRUE(is_valid(good));
    for (const float bad : {std::nanf(""), infinity, -infinity})
        for (const std::size_t k : {0u, 1u, 2u, 4u, 5u, 6u}) {  // origin and direction
            auto numbers = std::bit_cast<std::array<float, 8>>(good);
            numbers[k] = bad;
            const Ray ray = std::bit_cast<Ray>(numbers);
            EXPECT_FALSE(is_valid(ray)) << k << " " << bad;
        }
    const float nan = std::nanf("");
    EXPECT_FALSE(is_valid({good.origin, nan, good.direction, 1}));
    EXPECT_FALSE(is_valid({good.origin, 0, good.direction, nan}));
    EXPECT_FALSE(is_valid({good.origin, 2, good.direction, 1}));
    EXPECT_FALSE(is_valid({good.origin, -2, good.direction, -1})) << "it ends before it starts";
    EXPECT_FALSE(is_valid({good.origin, 0, {0, -0.0f, 0}, 1}));
    EXPECT_TRUE(is_valid({good.origin, -infinity, good.direction, infinity}));
    EXPECT_TRUE(is_valid({good.origin, 0, {0, 0, 1e-45f}, infinity}));
}

}  // namespace
}  // namespace raydix::test
