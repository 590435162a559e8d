// Balls that meet needles, triangles without area, and any triangle at the end of a long way, in
// float and in double, against distances in rational arithmetic.
#include "proximity/contact_steps.h"

#include <gtest/gtest.h>
#include <raydix/raydix.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <limits>
#include <vector>

#include "support/double_scenes.h"
#include "support/exact_distance.h"
#include "support/support.h"

namespace raydix::test {
namespace {

constexpr std::uint64_t contact_steps_seed = 20260301;

Vec3 narrow(Vec3d p) {
    return {static_cast<float>(p.x), static_cast<float>(p.y), static_cast<float>(p.z)};
}
Vec3d wide(Vec3 p) { return {p.x, p.y, p.z}; }

double sum(Vec3d p) { return std::fabs(p.x) + std::fabs(p.y) + std::fabs(p.z); }

struct Tally {
    double worst = 0;  // as a part of all lengths
    std::size_t contacts = 0, misses = 0;
};

/// At the contact the ball is at its radius, and on the way to it, or to the end, not well within.
void check(const LeafTriangleD& t, const SphereSweepD& sweep, bool hit, double at, double allowed,
           Tally& tally) {
    const RayD& path = sweep.path;
    const auto off = [&](double place) {
        const double lengths = sum(path.origin) + sum(path.direction) * place + sum(t.v0) +
                               sum(t.v1) + sum(t.v2) + sweep.radius;
        return (exact_distance(t, path, place) - sweep.radius) / lengths;
    };
    if (hit) {
        ASSERT_LE(off(at), allowed);
        if (at > path.tmin) {
            ASSERT_GE(off(at), -allowed);
            tally.worst = std::max(tally.worst, std::fabs(off(at)));
        }
    }
    ++(hit ? tally.contacts : tally.misses);
    if (hit && !(at > path.tmin)) return;
    for (const double part : {0.25, 0.5, 0.75, 0.9, 0.99, 0.999})
        ASSERT_GE(off(part * (hit ? at : 2.0)), -allowed);
}

/// Four times what the steps may leave.
void check_double(const LeafTriangleD& t, const SphereSweepD& sweep, Tally& tally) {
    const SweepHitD hit =
        sweep_sphere(build_bvh(MeshD{"", {t.v0, t.v1, t.v2}, {{0, 1, 2}}}), sweep);
    check(t, sweep, hit.hit(), hit.t, 0x1p-47, tally);
}

/// In float t is rounded.
void check_float(const LeafTriangleD& t, const SphereSweepD& sweep, Tally& tally) {
    const Vec3 a = narrow(t.v0), b = narrow(t.v1), c = narrow(t.v2);
    const SphereSweep narrowed{{narrow(sweep.path.origin), 0, narrow(sweep.path.direction)},
                               static_cast<float>(sweep.radius)};
    if (narrowed.path.direction == Vec3{0, 0, 0}) return;
    const SweepHit hit = sweep_sphere(build_bvh(Mesh{"", {a, b, c}, {{0, 1, 2}}}), narrowed);
    check({wide(a), wide(b), wide(c)},
          {{wide(narrowed.path.origin), 0, wide(narrowed.path.direction)}, narrowed.radius},
          hit.hit(), hit.t, 0x1p-22, tally);
}

/// A third corner on an edge up to rounding, beside it, or near an end of it; paths from up to a
/// million lengths away, some nearly along the longest edge.
struct Needle {
    LeafTriangleD triangle;
    SphereSweepD sweep;

    Needle(RandomD& random, std::size_t i) {
        const auto power = [&](int lowest) {
            return std::ldexp(0.5 + 0.5 * random.unit(), -static_cast<int>(random.below(lowest)));
        };
        const Vec3d a = i % 4 == 0 ? 1000.0 * random.direction() : random.direction();
        const Vec3d edge = random.direction(), b = a + edge;
        const Vec3d thin = power(50) * random.direction();
        const Vec3d c = i % 3 == 0   ? a + random.unit() * edge
                        : i % 3 == 1 ? a + random.unit() * edge + thin
                                     : b + thin;
        const double radius = power(20);
        const Vec3d aim = a + random.unit() * edge + 1.2 * radius * random.direction();
        const Vec3d from = aim + (i % 5 == 0 ? 1e6 : 3.0) * random.direction();
        const Vec3d along = i % 7 == 0 ? edge + power(50) * random.direction() : aim - from;
        triangle = {a, b, c};
        sweep = {{from, 0, along}, radius};
    }
};

TEST(ContactSteps, NeedlesAreMetAtTheRadius) {
    RandomD random(contact_steps_seed);
    Tally in_double, in_float;
    for (std::size_t i = 0; i < 150 * thorough; ++i) {
        const Needle needle(random, i);
        check_double(needle.triangle, needle.sweep, in_double);
        check_float(needle.triangle, needle.sweep, in_float);
        ASSERT_FALSE(HasFatalFailure()) << "case " << i << ", seed " << contact_steps_seed;
    }
    std::cout << in_double.contacts << " contacts, " << in_double.misses
              << " misses; off by up to 2^" << std::log2(in_double.worst) << " and, in float, 2^"
              << std::log2(in_float.worst) << " of all lengths\n";
    EXPECT_GT(in_double.contacts, 50 * thorough);
    EXPECT_GT(in_double.misses, 10 * thorough);
    EXPECT_GT(in_float.contacts, 50 * thorough);
    EXPECT_GT(in_float.misses, 10 * thorough);
}

/// Cases that closed formulas alone got wrong, by up to a third of the radius: most of
/// these balls pass by.
TEST(ContactSteps, CasesOfTheAttack) {
    Tally tally;
    const std::vector<std::pair<LeafTriangleD, SphereSweepD>> in_double{
        // The third corner is on an edge up to rounding.
        {{{-0x1.6f1b271ae56d7p+4, -0x1.35bb9bdedbc69p+5, 0x1.22dd5dcf40448p+6},
          {0x1.b9e2baf717dfcp+5, 0x1.77b6e5223f846p+6, 0x1.9fb44a124795ep+7},
          {0x1.4ea8e34a5bc7fp+4, 0x1.1d994f3c43311p+5, 0x1.290f5b0d09698p+7}},
         {{{-0x1.e943b11f0e0cbp+8, -0x1.00410dc30e49ap+9, 0x1.1c1d187d53ccep+8},
           0,
           {0x1.14cb1808c2a35p+9, 0x1.35d16ed74b6a2p+9, -0x1.5a6ed463f7b33p+8}},
          0x1.96cac17b72cb9p+5}},
        {{{0x1.0aded3a023de5p-2, -0x1.2b833c8fa211ap-2, 0x1.81856ba6089dfp-4},
          {0x1.28a832ecd1046p-2, 0x1.1946fe5df7c4cp-4, -0x1.872d0346c8a75p-4},
          {0x1.123a69946b86p-2, -0x1.a051179edcd9ep-3, 0x1.83546f58c56f7p-5}},
         {{{0x1.6356f750a0a84p+7, 0x1.67e8db9859e03p+6, 0x1.20c0be2372ebp+7},
           0,
           {-0x1.6314210466ea8p+7, -0x1.6a921e252f6d1p+6, -0x1.1fcdf8680d775p+7}},
          0x1.b6620b6331727p-2}},
        {{{0x1.d1c41f9be8304p+5, 0x1.23a80263839dfp+5, -0x1.56cca008a2d4cp+5},
          {0x1.b7cb252a4575p+1, -0x1.6a155d9fbb385p+5, -0x1.9ff835759c4bap+6},
          {0x1.9978eefeac05cp+3, -0x1.f4c7ed37432b2p+4, -0x1.762f290add0ecp+6}},
         {{{-0x1.470c58ebe63e8p+4, 0x1.2c93a9a00f62p+7, -0x1.9997327a65cd2p+6},
           0,
           {0x1.4288f8207bf6ap+6, -0x1.5ba4d6638227cp+5, 0x1.a147ddf9ca84ep+6}},
          0x1.464adeabba1f9p+6}},
        // In the plane of a triangle of two equal legs.
        {{{-0x1.b73222p+11, 0x1.c94e39eaf3fe7p+12, 0x1.facbacp+12},
          {-0x1.b73222p+11, 0x1.c94e39eaf3fe1p+12, 0x1.0ca5d1700611ap+13},
          {-0x1.7a32343fe77cep+11, 0x1.c94e39eaf3ffp+12, 0x1.facbacp+12}},
         {{{-0x1.98b22cp+11, 0x1.c94e3ap+12, 0x1.facbacp+12}, 0, {-0x1.e7ff6p+7, 0, 0}},
          0x1.e1ad3cp-2}},
        // 4e12 away from a triangle of 1e-6.
        {{{0x1.897f3200124d4p+0, -0x1.957e54001c551p-11, 0x1.8ffe2c003abd4p-2},
          {0x1.897fae000c7e5p+0, -0x1.957dca002e6ecp-11, 0x1.900330003acf4p-2},
          {0x1.897fd000249a8p+0, -0x1.957d3e001ec52p-11, 0x1.9002e2002512bp-2}},
         {{{0x1.459806p+39, 0x1.1bbc5ep+41, 0x1.a1d324p+38},
           0,
           {-0x1.459806p+39, -0x1.1bbc5ep+41, -0x1.a1d324p+38}},
          0x1.251c7ep+23}}};
    for (const auto& [triangle, sweep] : in_double) check_double(triangle, sweep, tally);
    // A segment, up to the least float.
    check_float({{0x1.6a2c26p-121, 0x1.9051acp-127, -0x1p-138},
                 {0x1p-131, 0x0p+0, -0x1.1ad414p-1},
                 {-0x1p-144, 0x1p-137, 0x0p+0}},
                {{{-0x1.0d77cp+0, 0x1.8a5ba2p+0, -0x1.56c7ep-6}, 0, {1, -2, -2}}, 0x1.b0017ap-1},
                tally);
    EXPECT_EQ(tally.contacts, 2u);
}

/// Nothing to step on: from within, away, and past the end.
TEST(ContactSteps, KnownAnswers) {
    const LeafTriangleD segment{{0, 0, 0}, {4, 0, 0}, {2, 0, 0}};
    const auto first = [&](Double3 from, Double3 direction, double radius, double tmax) {
        const Path path{from, direction, 0.0, tmax};
        return ContactSteps(path, {segment, {}}, radius).run(0.0);
    };
    EXPECT_EQ(first({1, 5, 0}, {0, -1, 0}, 1, 10), 4.0);
    EXPECT_EQ(first({1, 5, 0}, {0, -1, 0}, 1, 3.9), never);
    EXPECT_EQ(first({1, 5, 0}, {0, 1, 0}, 1, 10), never);
    EXPECT_EQ(first({1, 0.5, 0}, {0, 1, 0}, 1, 10), 0.0);
    EXPECT_EQ(first({-5, 0, 0}, {1, 0, 0}, 1, 10), 4.0);
    EXPECT_EQ(first({-5, 1.5, 0}, {1, 0, 0}, 1, 10), never);
    EXPECT_NEAR(first({-5, 3, 4}, {2, 0, 0}, 5, 10), 2.5, 1e-6) << "grazes";
}

}  // namespace
}  // namespace raydix::test
