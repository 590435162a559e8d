// Where rays meet the surfaces of balls and capsules: in double against the surfaces in rational
// arithmetic and the roots in a hundred digits, in float against their distance in double.
#include <gtest/gtest.h>
#include <raydix/double.h>
#include <raydix/shapes.h>

#include <boost/multiprecision/cpp_bin_float.hpp>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <vector>

#include "base/double3.h"
#include "proximity/shape_hits.h"
#include "support/double_scenes.h"
#include "support/exact.h"
#include "support/random.h"
#include "support/support.h"

namespace raydix::test {
namespace {

constexpr std::uint64_t shape_hits_seed = 20190321;

using Digits = boost::multiprecision::cpp_bin_float_100;

/// Places and how large things are there.
struct Place {
    Vec3d at;
    double size;
};
constexpr Place places[] = {{{0, 0, 0}, 1.0},
                            {utm_place, 100.0},
                            {{-0.4e12, 0.4e12, 0.4e12}, 1e6},
                            {{4.5e6, 4.5e6, 4.5e6}, 1e-3}};

/// Squared distance of the ray's place at t from the segment, without rounding.
Exact exact_distance2(const CapsuleD& c, const RayD& ray, double t) {
    const ExactPoint o = exact(ray.origin), d = exact(ray.direction), a = exact(c.a);
    const Exact at(t);
    const ExactPoint p{o.x + at * d.x - a.x, o.y + at * d.y - a.y, o.z + at * d.z - a.z};
    const ExactPoint axis = exact(c.b) - a;
    const Exact length2 = dot(axis, axis);
    Exact s = length2 > 0 ? Exact(dot(p, axis) / length2) : Exact(0);
    if (s < 0) s = 0;
    if (s > 1) s = 1;
    const ExactPoint off{p.x - s * axis.x, p.y - s * axis.y, p.z - s * axis.z};
    return dot(off, off);
}

/// How far the place at t is outside (> 0) or inside of the surface.
double height(const CapsuleD& c, const RayD& ray, double t) {
    const Digits d2(exact_distance2(c, ray, t));
    return static_cast<double>(Digits(sqrt(d2) - c.radius));
}

double length_of(Vec3d v) { return std::sqrt(v.x * v.x + v.y * v.y + v.z * v.z); }

/// What scene.h promises.
double promised(const CapsuleD& c, const RayD& ray) {
    return 0x1p-50 * (std::fabs(height(c, ray, 0.0)) + length_of(c.b - c.a) + c.radius);
}

/// Toward the shape or past its edge, from far, from near, from inside, nearly along its axis.
RayD ray_at(const CapsuleD& c, RandomD& random, int kind) {
    const Vec3d middle = c.a + random.unit() * (c.b - c.a);
    const double far = c.radius * std::ldexp(1.0, static_cast<int>(random.below(40)));
    Vec3d from = middle + far * random.direction();
    const Vec3d to = middle + (0.5 + random.unit()) * c.radius * random.direction();
    if (kind % 5 == 0) from = middle + random.unit() * c.radius * random.direction();
    if (kind % 5 == 1) from = to + 1e-9 * c.radius * random.direction();
    if (kind % 5 == 2 && length_of(c.b - c.a) > 0.0) {
        const double bend = std::ldexp(1.0, -static_cast<int>(random.below(60)));
        const Vec3d side = random.unit() * 1.5 * c.radius * random.direction();
        return {c.a + side - 0.5 * (c.b - c.a), 0.0,
                (c.b - c.a) + bend * c.radius * random.direction()};
    }
    if (from == to) from.x = from.x - 8.0 * c.radius;
    return {from, 0.0, (0.5 + random.unit()) * (to - from)};
}

CapsuleD capsule_at(const Place& place, RandomD& random, bool ball) {
    const double r = place.size * std::ldexp(1.0, -static_cast<int>(random.below(10)));
    const Vec3d a = place.at + place.size * random.in({{-1, -1, -1}, {1, 1, 1}});
    const double l = r * std::ldexp(1.0, static_cast<int>(random.below(20)) - 4);
    return {a, ball ? a : a + l * random.direction(), r};
}

bool hit_of(const CapsuleD& c, bool ball, const RayD& ray, HitD& hit) {
    return ball ? hit_ball(c.a, c.radius, ray, hit) : hit_capsule(c, ray, hit);
}

/// What is hit is on the surface; between the start and there, or the end of a ray that misses, the
/// ray stays on one side of it.
TEST(ShapeHits, HitsAreOnTheSurface) {
    RandomD random(shape_hits_seed + 3);
    double worst = 0.0;
    std::size_t hits = 0, inside = 0;
    for (int i = 0; i < static_cast<int>(400 * thorough); ++i) {
        const bool ball = i % 2 == 0;
        const CapsuleD c = capsule_at(places[i % 4], random, ball);
        const RayD ray = ray_at(c, random, i / 2);
        HitD hit;
        const bool found = hit_of(c, ball, ray, hit);
        const double room = promised(c, ray), start = height(c, ray, 0.0);
        if (found) {
            const double off = std::fabs(height(c, ray, hit.t));
            EXPECT_LE(off, room) << i << " t " << hit.t;
            worst = std::max(worst, off / room);
            ++hits;
            inside += start < 0.0;
        }
        if (std::fabs(start) <= room) continue;
        // A ray that misses is looked at around where it comes closest.
        const Vec3d to = 0.5 * c.a + 0.5 * c.b - ray.origin, d = ray.direction;
        const double middle =
            (to.x * d.x + to.y * d.y + to.z * d.z) / (d.x * d.x + d.y * d.y + d.z * d.z);
        const double reach = (length_of(c.b - c.a) + 2.0 * c.radius) / length_of(d);
        const double begin = found ? std::max(0.0, std::min(hit.t, middle - reach))
                                   : std::max(0.0, middle - reach),
                     end = found ? hit.t : std::max(0.0, middle + reach);
        for (int k = 0; k < 12; ++k) {
            const double at = height(c, ray, begin + (end - begin) * k / 12);
            EXPECT_FALSE(start > 0.0 ? at < -room : at > room) << i << ": " << at << ' ' << room;
        }
        EXPECT_TRUE(found || start > 0.0) << "no way out of a closed surface";
    }
    std::cout << hits << " hits, " << inside << " from inside, at most " << worst
              << " of what is promised\n";
    EXPECT_GT(hits, 100 * thorough);
    EXPECT_GT(inside, 10 * thorough);
}

/// t of a ball against the quadratic in a hundred digits.
TEST(ShapeHits, RootsInAHundredDigits) {
    RandomD random(shape_hits_seed + 4);
    double worst = 0.0;
    std::size_t compared = 0, missed = 0;
    for (int i = 0; i < static_cast<int>(500 * thorough); ++i) {
        const CapsuleD c = capsule_at(places[i % 4], random, true);
        const RayD ray = ray_at(c, random, i);
        const auto wide = [](double x) { return Digits(x); };
        const Digits f[] = {wide(c.a.x) - ray.origin.x, wide(c.a.y) - ray.origin.y,
                            wide(c.a.z) - ray.origin.z},
                     d[] = {ray.direction.x, ray.direction.y, ray.direction.z};
        const Digits d2 = d[0] * d[0] + d[1] * d[1] + d[2] * d[2],
                     f2 = f[0] * f[0] + f[1] * f[1] + f[2] * f[2],
                     middle = (f[0] * d[0] + f[1] * d[1] + f[2] * d[2]) / d2,
                     room = wide(c.radius) * c.radius - (f2 - middle * middle * d2);
        HitD hit;
        const bool found = hit_of(c, true, ray, hit);
        const double distance = static_cast<double>(Digits(sqrt(f2)));
        const double lost = 0x1p-50 * (distance + c.radius);
        // How far the line passes the surface by, to first order.
        const double passes = static_cast<double>(room) / (2.0 * c.radius);
        if (passes < -lost) {
            EXPECT_FALSE(found) << i;
            ++missed;
        }
        if (passes <= 1e-6 * c.radius || std::fabs(distance - c.radius) <= lost) continue;
        const Digits half = sqrt(room / d2);
        const bool from_outside = f2 > wide(c.radius) * c.radius;
        const Digits wanted = from_outside ? Digits(middle - half) : Digits(middle + half);
        ASSERT_EQ(found, wanted >= 0) << i;
        if (!found) continue;
        // The surface may be a shallow one: its slope at the hit is half / radius.
        const double slope = static_cast<double>(Digits(half * sqrt(d2))) / c.radius;
        const double off =
            std::fabs(static_cast<double>(Digits((wanted - hit.t) * sqrt(d2)))) * slope;
        EXPECT_LE(off, lost) << i;
        worst = std::max(worst, off / lost);
        ++compared;
    }
    std::cout << compared << " hits, " << missed << " rays beside, off by at most " << worst
              << " of what is promised\n";
    EXPECT_GT(compared, 100 * thorough);
    EXPECT_GT(missed, 2 * thorough);
}

std::vector<Ray> random_rays(std::size_t count) {
    Random random(shape_hits_seed);
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

/// From so far that a step of double is longer than the scene, along an axis: what is across the
/// ray has all its digits. t in units of the scaled direction is beyond all floats.
TEST(ShapeHits, FromTheEndOfAllFloats) {
    const Capsule pipe{{-0x1.c5be4ep-1f, -0x1.00a458p-3f, 0x1.bbe5ecp-2f},
                       {0x1.ec0ebep+11f, 0x1.0d42a4p+12f, 0x1.57c2e4p+11f},
                       0x1.27bfccp-1f};
    const auto pipe_hit = [&](float x, float y, float speed) {
        Hit hit;
        const bool found = hit_capsule(pipe, Ray{{x, y, 0x1.ff933cp+127f}, 0, {0, 0, speed}}, hit);
        return found ? hit.t : infinity;
    };
    EXPECT_EQ(pipe_hit(0x1.a6ba7p-2f, 0x1.dfeb74p+0f, -0x1.504aa2p+9f), 0x1.856f02p+118f);
    EXPECT_LT(pipe_hit(0x1.a6ba7p-2f, 0x1.dfeb74p+0f, -1.0f), infinity);
    EXPECT_EQ(pipe_hit(0x1.a6ba7p-2f, 0x1.dfeb74p+0f, 1.0f), infinity);
    EXPECT_EQ(pipe_hit(-2.0f, 2.0f, -100.0f), infinity);
    const auto meets_ball = [&](float x) {
        Hit hit;
        return hit_ball(Vec3{0.4f, 1.9f, 5.0f}, 0.25f, Ray{{x, 1.9f, 3e38f}, 0, {0, 0, -700.0f}},
                        hit);
    };
    EXPECT_TRUE(meets_ball(0.64f));
    EXPECT_FALSE(meets_ball(0.66f));
}

double segment_distance(Double3 p, const Capsule& c) {
    const Double3 a(c.a), axis = Double3(c.b) - a;
    const double length2 = dot(axis, axis);
    const double s = length2 > 0 ? std::min(1.0, std::max(0.0, dot(p - a, axis) / length2)) : 0.0;
    return length(p - (a + axis * s));
}

/// A hit is on the surface, and the ray crosses none before it.
TEST(ShapeHits, FloatsAreOnTheSurface) {
    Random random(shape_hits_seed);
    std::size_t hits = 0, from_inside = 0;
    for (const Ray& ray : random_rays(200 * thorough)) {
        const Capsule one{random.in(0, 1), random.in(0, 1), random.between(0.01f, 0.4f)};
        Hit hit;
        const bool found = hit_capsule(one, ray, hit);
        const Double3 o(ray.origin), d(ray.direction);
        const auto side = [&](double t) { return segment_distance(o + d * t, one) - one.radius; };
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
    EXPECT_GT(hits, 10 * thorough);
    EXPECT_GT(from_inside, thorough);
}

}  // namespace
}  // namespace raydix::test
