// Rays through spheres, capsules and points with a radius in double: against a look at all of them,
// against the surfaces in rational arithmetic and the roots in a hundred digits.
#include <gtest/gtest.h>
#include <raydix/raydix.h>

#include <boost/multiprecision/cpp_bin_float.hpp>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <limits>

#include "support/double_scenes.h"
#include "support/support.h"

namespace raydix::test {
namespace {

constexpr std::uint64_t seed = 20190321;
constexpr double inf = std::numeric_limits<double>::infinity();
constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr Builder all_builders[] = {
    Builder::karras, Builder::lauterbach, Builder::garanzha, Builder::apetrei, Builder::ploc,
    Builder::hploc,  Builder::binned,     Builder::sweep,    Builder::split,   Builder::sbvh};

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

std::vector<RayD> random_rays(const Place& place, std::size_t count) {
    RandomD random(seed);
    const auto in = [&](double lo, double hi) {
        return place.at + place.size * random.in({{lo, lo, lo}, {hi, hi, hi}});
    };
    std::vector<RayD> rays;
    for (std::size_t i = 0; i < count; ++i) {
        const Vec3d from = i % 2 ? in(0, 1) : in(-3, 4);
        RayD ray{from, 0, in(0, 1) - from};
        if (i % 5 == 0) ray.direction = {0, i % 10 ? -2.0 : 1.0, 0};
        if (i % 7 == 0) ray.tmax = random.between(0.3, 1.0);
        if (i % 9 == 0) ray.tmin = random.between(0.0, 0.5);
        if (i % 11 == 0) ray.direction = ray.direction * std::ldexp(1.0, i % 22 ? 700 : -700);
        rays.push_back(ray);
    }
    rays[3].direction = {0, 0, 0};
    rays[5].origin.y = nan;
    return rays;
}

void expect_brute_force(const std::string& name, const std::vector<AabbD>& boxes,
                        const IntersectPrimitiveD& intersect, const std::vector<RayD>& rays) {
    std::vector<HitD> expected(rays.size());
    std::size_t hits = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
        if (i == 3 || i == 5) continue;  // invalid
        for (std::uint32_t prim = 0; prim < boxes.size(); ++prim) {
            HitD hit;
            if (boxes[prim].lo.x <= boxes[prim].hi.x && intersect(prim, rays[i], hit) &&
                hit.t < expected[i].t)
                expected[i] = hit_of_tree(TreeHitD{hit.t, prim, hit.u, hit.v});
        }
        hits += expected[i].hit();
    }
    std::cout << name << ": " << rays.size() << " rays, " << hits << " hits\n";
    EXPECT_GT(hits, rays.size() / 20);
    for (const Builder builder : all_builders) {
        for (const int max_leaf : {1, 4, 17}) {
            const BoxBvhD bvh = build_bvh(boxes, {.builder = builder, .max_leaf = max_leaf});
            for (const int threads : {1, 2, 7}) {
                std::vector<HitD> found(rays.size());
                std::vector<std::uint8_t> occluded(rays.size(), 7);
                const TraceCounts counts = trace(bvh, intersect, rays, found, {.threads = threads});
                EXPECT_EQ(counts.hits, hits);
                EXPECT_EQ(counts.invalid_rays, 2u);
                EXPECT_EQ(found, expected)
                    << name << ' ' << builder_name(builder) << ", seed " << seed;
                trace_any(bvh, intersect, rays, occluded, {.threads = threads});
                for (std::size_t i = 0; i < rays.size(); ++i)
                    EXPECT_EQ(occluded[i] != 0, expected[i].hit()) << i;
            }
            EXPECT_EQ(closest_hit(bvh, intersect, rays[1]), expected[1]);
            EXPECT_EQ(any_hit(bvh, intersect, rays[1]), expected[1].hit());
        }
    }
}

TEST(DoubleShapes, SpheresCapsulesAndPointsAreBruteForce) {
    for (const Place& place : places) {
        const std::vector<RayD> rays = random_rays(place, 20 + 10 * thorough);
        RandomD random(seed + 1);
        const auto in = [&](double lo, double hi) {
            return place.size * random.in({{lo, lo, lo}, {hi, hi, hi}});
        };
        std::vector<SphereD> balls;
        std::vector<CapsuleD> capsules;
        std::vector<Vec3d> points;
        for (int i = 0; i < 300; ++i) {
            const double small = place.size * random.between(0.0, 0.08);
            const Vec3d a = place.at + in(0, 1);
            points.push_back(a);
            balls.push_back({a, small});
            const Vec3d b = i % 5 == 0   ? a
                            : i % 5 == 1 ? a + Vec3d{0, 0.2 * place.size, 0}
                                         : a + in(-0.15, 0.15);
            capsules.push_back({a, b, 0.6 * small});
        }
        balls.push_back(balls[0]);  // the same again: the lower id wins
        capsules.push_back(capsules[7]);
        for (const double bad : {nan, inf, -1.0, -inf}) {
            balls.push_back({place.at, bad});
            capsules.push_back({place.at, place.at, bad});
        }
        balls.push_back({{0, nan, 0}, 1});
        capsules.push_back({{nan, 0, 0}, {0, 0, 0}, 1});
        capsules.push_back({{0, 0, 0}, {0, 0, inf}, 1});
        EXPECT_EQ(build_bvh(boxes_of(balls)).left_out(), 5u);
        EXPECT_EQ(build_bvh(boxes_of(capsules)).left_out(), 6u);
        expect_brute_force("spheres", boxes_of(balls), intersect_spheres(balls), rays);
        expect_brute_force("capsules", boxes_of(capsules), intersect_capsules(capsules), rays);
        const double r = 0.05 * place.size;
        expect_brute_force("points", boxes_of(points, r), intersect_points(points, r), rays);
        EXPECT_EQ(build_bvh(boxes_of(points, -1.0)).left_out(), points.size());
        EXPECT_EQ(build_bvh(boxes_of(points, 0.0)).left_out(), 0u);
    }
}

TEST(DoubleShapes, BoxesHoldTheShapesExactly) {
    RandomD random(seed + 2);
    for (int i = 0; i < 2000; ++i) {
        const Vec3d p = std::ldexp(1.0, static_cast<int>(random.below(60)) - 20) *
                        random.in({{-1, -1, -1}, {1, 1, 1}});
        const double r = std::ldexp(random.unit(), static_cast<int>(random.below(80)) - 50);
        const std::vector<SphereD> balls{{p, r}};
        const AabbD box = boxes_of(balls)[0];
        EXPECT_LE(Exact(box.lo.x), Exact(p.x) - Exact(r));
        EXPECT_GE(Exact(box.hi.z), Exact(p.z) + Exact(r));
        // And not a step more.
        EXPECT_GT(Exact(std::nextafter(box.lo.x, inf)), Exact(p.x) - Exact(r));
        EXPECT_LT(Exact(std::nextafter(box.hi.z, -inf)), Exact(p.z) + Exact(r));
    }
}

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

/// What the header promises.
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
    const std::vector<CapsuleD> capsules{c};
    const std::vector<SphereD> balls{{c.a, c.radius}};
    return ball ? intersect_spheres(balls)(0, ray, hit) : intersect_capsules(capsules)(0, ray, hit);
}

/// What is hit is on the surface; between the start and there, or the end of a ray that misses, the
/// ray stays on one side of it.
TEST(DoubleShapes, HitsAreOnTheSurface) {
    RandomD random(seed + 3);
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
TEST(DoubleShapes, RootsInAHundredDigits) {
    RandomD random(seed + 4);
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

TEST(DoubleShapes, ABallFarFromTheOrigin) {
    // A metre large; the ray passes its edge 1e-9 of its radius inside, and as much outside.
    const std::vector<SphereD> ball{{{4.5e6, 4.5e6, 4.5e6}, 0.5}};
    const IntersectPrimitiveD intersect = intersect_spheres(ball);
    const BoxBvhD bvh = build_bvh(boxes_of(ball));
    const HitD hit = closest_hit(bvh, intersect, {{4.5e6 - 3.0, 4.5e6, 4.5e6}, 0, {1, 0, 0}});
    EXPECT_EQ(hit.t, 2.5);
    const double step = 0x1p-30;
    EXPECT_TRUE(any_hit(bvh, intersect, {{4.5e6 - 3.0, 4.5e6 + 0.5 - step, 4.5e6}, 0, {1, 0, 0}}));
    EXPECT_FALSE(any_hit(bvh, intersect, {{4.5e6 - 3.0, 4.5e6 + 0.5 + step, 4.5e6}, 0, {1, 0, 0}}));
    // From inside it hits where it leaves, from the surface too.
    EXPECT_EQ(closest_hit(bvh, intersect, {{4.5e6, 4.5e6, 4.5e6}, 0, {0, 2, 0}}).t, 0.25);
    EXPECT_EQ(closest_hit(bvh, intersect, {{4.5e6 - 0.5, 4.5e6, 4.5e6}, 0, {1, 0, 0}}).t, 0.0);
    EXPECT_EQ(closest_hit(bvh, intersect, {{4.5e6 - 0.5, 4.5e6, 4.5e6}, 0.5, {1, 0, 0}}).t, 1.0);
    // Directions whose squares overflow or vanish.
    for (const double d : {0x1p-900, 0x1p900})
        EXPECT_EQ(closest_hit(bvh, intersect, {{4.5e6 - 3.0, 4.5e6, 4.5e6}, 0, {d, 0, 0}}).t,
                  2.5 / d);
    // A micrometre at a thousand kilometres.
    const std::vector<SphereD> grain{{{1e6, 0, 0}, 1e-6}};
    EXPECT_NEAR(
        closest_hit(build_bvh(boxes_of(grain)), intersect_spheres(grain), {{0, 0, 0}, 0, {1, 0, 0}})
            .t,
        1e6 - 1e-6, 2.4e-10);
}

TEST(DoubleShapes, PlaceAlongTheAxis) {
    const std::vector<CapsuleD> pipe{{{4.5e6, 0, 0}, {4.5e6, 8, 0}, 0.25}};
    const BoxBvhD bvh = build_bvh(boxes_of(pipe));
    const auto u = [&](double y) {
        return closest_hit(bvh, intersect_capsules(pipe), {{4.5e6 - 2, y, 0}, 0, {1, 0, 0}}).u;
    };
    EXPECT_EQ(u(2.0), 0.25);
    EXPECT_EQ(u(-0.125), 0.0);
    EXPECT_EQ(u(8.125), 1.0);
    EXPECT_EQ(closest_hit(bvh, intersect_capsules(pipe), {{4.5e6 - 2, 2, 0}, 0, {1, 0, 0}}).t,
              1.75);
    // Along the axis, inside and beside.
    EXPECT_EQ(closest_hit(bvh, intersect_capsules(pipe), {{4.5e6, -2, 0}, 0, {0, 1, 0}}).t, 1.75);
    EXPECT_FALSE(any_hit(bvh, intersect_capsules(pipe), {{4.5e6 - 0.26, -2, 0}, 0, {0, 1, 0}}));
}

/// As in float: rays that begin at infinity, and t that no double holds.
TEST(ShapesDouble, AHitIsAtAFinitePlace) {
    const std::vector<SphereD> balls{{{0, 0, 10}, 1}, {{0, 0, 10}, 0}};
    const std::vector<CapsuleD> capsules{{{0, 0, 10}, {0, 0, 11}, 1}, {{0, -1, 10}, {0, 1, 10}, 0}};
    const std::vector<Vec3d> points{{0, 0, 10}, {0, 0, 20}};
    const std::vector<RayD> rays{
        {{0, 0, 0}, inf, {0, 0, 1}, inf},    {{0, 0, 10}, inf, {0, 0, 1}, inf},
        {{0, 0, 0}, inf, {1, 0, 0}, inf},    {{0, 0, 0}, 0, {0, 0, 1e-308}, inf},
        {{0, 0, 0}, 0, {0, 0, 5e-324}, inf}, {{0, 0, 0}, 1e300, {0, 0, 1e-308}, inf}};
    const auto expect_none = [&](const std::vector<AabbD>& boxes,
                                 const IntersectPrimitiveD& intersect) {
        for (const int max_leaf : {1, 4}) {
            const BoxBvhD bvh = build_bvh(boxes, {.max_leaf = max_leaf});
            std::vector<HitD> hits(rays.size());
            std::vector<std::uint8_t> occluded(rays.size());
            EXPECT_EQ(trace(bvh, intersect, rays, hits).hits, 0u);
            EXPECT_EQ(trace_any(bvh, intersect, rays, occluded).hits, 0u);
            for (const RayD& ray : rays) {
                EXPECT_FALSE(closest_hit(bvh, intersect, ray).hit());
                HitD hit;
                for (const std::uint32_t prim : {0u, 1u}) EXPECT_FALSE(intersect(prim, ray, hit));
            }
        }
    };
    expect_none(boxes_of(balls), intersect_spheres(balls));
    expect_none(boxes_of(capsules), intersect_capsules(capsules));
    expect_none(boxes_of(points, 0.5), intersect_points(points, 0.5));
}

TEST(ShapesDouble, NoTIsMinusZero) {
    const auto expect_plus = [](const std::vector<AabbD>& boxes,
                                const IntersectPrimitiveD& intersect) {
        const BoxBvhD bvh = build_bvh(boxes);
        for (const double tmin : {0.0, -0.0})
            for (const Vec3d d : {Vec3d{0, 0, 1}, Vec3d{0, 0, -1}, Vec3d{-1, -2, -3}}) {
                const HitD hit = closest_hit(bvh, intersect, {{0, 0, 0}, tmin, d});
                ASSERT_TRUE(hit.hit());
                EXPECT_EQ(hit.t, 0.0);
                EXPECT_FALSE(std::signbit(hit.t));
            }
    };
    const std::vector<SphereD> balls{{{0, 0, 0}, 0}};
    expect_plus(boxes_of(balls), intersect_spheres(balls));
    const std::vector<CapsuleD> capsules{{{0, 0, 0}, {0, 0, 0}, 0}};
    expect_plus(boxes_of(capsules), intersect_capsules(capsules));
    const std::vector<Vec3d> points{{0, 0, 0}};
    expect_plus(boxes_of(points, 0.0), intersect_points(points, 0.0));
}

}  // namespace
}  // namespace raydix::test
