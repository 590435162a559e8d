// Spheres, capsules, points and geometry of a user's own in scenes of both types: what is asked of
// a user's function and taken from it, ties, t at the ends of a number's range, places far away,
// boxes that hold what is promised.
#include <gtest/gtest.h>
#include <raydix/double.h>
#include <raydix/error.h>
#include <raydix/scene.h>
#include <raydix/shapes.h>
#include <raydix/user_geometry.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <functional>
#include <iostream>
#include <limits>
#include <span>
#include <type_traits>
#include <vector>

#include "base/double3.h"
#include "engine/shape_tree.h"
#include "support/double_scenes.h"
#include "support/exact.h"
#include "support/support.h"

namespace raydix::test {
namespace {

template <class Number>
struct Of {
    using Scene = BasicScene<Number>;
    using UserGeometry = BasicUserGeometry<Number>;
    using Box = BasicAabb<Number>;
    using Point = BasicVec3<Number>;
    using Sphere = BasicSphere<Number>;
    using Capsule = BasicCapsule<Number>;
    using Ray = BasicRay<Number>;
    using Hit = BasicHit<Number>;
    static constexpr Number inf = std::numeric_limits<Number>::infinity();
    static constexpr Number nan = std::numeric_limits<Number>::quiet_NaN();

    /// A scene of one geometry.
    template <class... What>
    static Scene scene_of(const What&... what) {
        Scene scene;
        scene.add(what...);
        scene.commit();
        return scene;
    }
    static Scene of_spheres(const std::vector<Sphere>& all) {
        return scene_of(std::span<const Sphere>(all));
    }
    static Scene of_capsules(const std::vector<Capsule>& all) {
        return scene_of(std::span<const Capsule>(all));
    }
    static Scene of_points(const std::vector<Point>& all, Number radius) {
        return scene_of(std::span<const Point>(all), radius);
    }
    /// `rays` many times over, so that they go in packets and streams too.
    static std::vector<Ray> often(const std::vector<Ray>& rays) {
        std::vector<Ray> all;
        for (int k = 0; k < 64; ++k) all.insert(all.end(), rays.begin(), rays.end());
        return all;
    }
};

template <class Number>
class ShapeEdges : public testing::Test {};
using Numbers = testing::Types<float, double>;
TYPED_TEST_SUITE(ShapeEdges, Numbers);

TYPED_TEST(ShapeEdges, AUsersFunctionSaysWhatIsHit) {
    using At = Of<TypeParam>;
    using Ray = typename At::Ray;
    using Hit = typename At::Hit;
    // Walls at x = far + prim, seen by a function that knows no boxes; the last two tie.
    constexpr TypeParam far = sizeof(TypeParam) == 4 ? TypeParam(0) : TypeParam(4.5e6);
    std::vector<typename At::Box> boxes;
    for (int i = 0; i < 5; ++i)
        boxes.push_back({{far + TypeParam(i), -1, -1}, {far + TypeParam(i), 1, 1}});
    boxes.push_back(boxes[2]);
    std::atomic<int> calls{0};
    const auto wall = [&](std::uint32_t prim, const Ray& ray, Hit& hit) {
        ++calls;
        if (prim < 2) return false;  // says no, whatever the box
        const std::uint32_t place = prim == 5 ? 2 : prim;
        hit.t = (far + TypeParam(place) - ray.origin.x) / ray.direction.x;
        hit.u = TypeParam(0.25);
        return true;
    };
    const auto scene = At::scene_of(typename At::UserGeometry(boxes, wall));
    const Ray ray{{far - 10, 0, 0}, 0, {2, 0, 0}, At::inf};
    const Hit hit = closest_hit(scene, ray);
    EXPECT_EQ(hit.t, 6);
    EXPECT_EQ(hit.prim, 2u) << "the lower id wins";
    EXPECT_EQ(hit.u, TypeParam(0.25));
    EXPECT_EQ(hit.v, 0);
    EXPECT_GT(calls.load(), 0);
    EXPECT_TRUE(any_hit(scene, ray));
    const auto limited = [&](TypeParam tmin, TypeParam tmax) {
        return closest_hit(scene, {ray.origin, tmin, ray.direction, tmax});
    };
    EXPECT_FALSE(limited(0, TypeParam(5.5)).hit());
    EXPECT_TRUE(limited(0, 6).hit()) << "closed";
    EXPECT_EQ(limited(6, 9).prim, 2u);
    EXPECT_EQ(limited(TypeParam(6.4), At::inf).prim, 3u);
    EXPECT_EQ(limited(-5, At::inf).prim, 2u);
    EXPECT_FALSE(closest_hit(scene, {{far - 10, 5, 0}, 0, {2, 0, 0}, At::inf}).hit())
        << "beside all boxes";
    std::vector<Ray> rays(1000, ray);
    rays[7].origin.x = At::nan;
    std::vector<Hit> hits(rays.size());
    const TraceCounts counts = trace(scene, rays, hits);
    EXPECT_EQ(counts.invalid_rays, 1u);
    EXPECT_EQ(counts.hits, rays.size() - 1);
    for (std::size_t i = 0; i < hits.size(); ++i) EXPECT_EQ(hits[i].hit(), i != 7) << i;
    EXPECT_THROW(trace(scene, rays, std::span(hits).first(3)), InputError);
}

TYPED_TEST(ShapeEdges, FewAndEqualBoxes) {
    using At = Of<TypeParam>;
    using Ray = typename At::Ray;
    const auto at_one = [](std::uint32_t, const Ray&, typename At::Hit& hit) {
        hit.t = 1;
        return true;
    };
    const Ray ray{{5, 5, 4}, 0, {0, 0, 1}, At::inf};
    for (const Quality quality : {Quality::fast, Quality::balanced, Quality::high})
        for (const std::size_t n : {0u, 1u, 2u, 50u}) {
            const std::vector<typename At::Box> equal(n, {{5, 5, 5}, {5, 5, 5}});
            typename At::Scene scene;
            scene.add(typename At::UserGeometry(equal, at_one));
            scene.commit({.quality = quality});
            const auto hit = closest_hit(scene, ray);
            EXPECT_EQ(hit.hit(), n != 0);
            if (n == 0) continue;
            EXPECT_EQ(hit.t, 1);
            EXPECT_EQ(hit.prim, 0u);
        }
}

/// A hit needs a finite t: rays that begin at infinity, and shapes so far away for the length of
/// the direction that t is beyond all numbers.
TYPED_TEST(ShapeEdges, AHitIsAtAFinitePlace) {
    using At = Of<TypeParam>;
    constexpr TypeParam inf = At::inf;
    std::vector<typename At::Ray> some{{{0, 0, 0}, inf, {0, 0, 1}, inf},
                                       {{0, 0, 10}, inf, {0, 0, 1}, inf},
                                       {{0, 0, 0}, inf, {1, 0, 0}, inf}};
    using Limits = std::numeric_limits<TypeParam>;
    const TypeParam little = Limits::min() / 2;
    some.push_back({{0, 0, 0}, 0, {0, 0, little}, inf});
    some.push_back({{0, 0, 0}, 0, {0, 0, Limits::denorm_min()}, inf});
    some.push_back({{0, 0, 0}, Limits::max() / 1024, {0, 0, little}, inf});
    const auto rays = At::often(some);
    const auto expect_none = [&](const typename At::Scene& scene) {
        for (const auto& hit : trace(scene, rays)) EXPECT_FALSE(hit.hit());
        std::vector<std::uint8_t> occluded(rays.size());
        EXPECT_EQ(trace_any(scene, rays, occluded).hits, 0u);
        for (const auto& ray : some) EXPECT_FALSE(closest_hit(scene, ray).hit());
    };
    expect_none(At::of_spheres({{{0, 0, 10}, 1}, {{0, 0, 10}, 0}}));
    expect_none(At::of_capsules({{{0, 0, 10}, {0, 0, 11}, 1}, {{0, -1, 10}, {0, 1, 10}, 0}}));
    expect_none(At::of_points({{0, 0, 10}, {0, 0, 20}}, TypeParam(0.5)));
}

/// Rays that begin on a shape without a radius, or less than any number before its surface.
TYPED_TEST(ShapeEdges, NoTIsMinusZero) {
    using At = Of<TypeParam>;
    using Point = typename At::Point;
    std::vector<typename At::Ray> some;
    for (const TypeParam tmin : {TypeParam(0), -TypeParam(0)})
        for (const Point d :
             {Point{0, 0, 1}, Point{0, 0, -1}, Point{-1, -2, -3}, Point{TypeParam(-1e-20), 0, 0}})
            some.push_back({{0, 0, 0}, tmin, d, At::inf});
    const auto rays = At::often(some);
    const auto expect_plus = [&](const typename At::Scene& scene) {
        const auto hits = trace(scene, rays);
        for (std::size_t i = 0; i < rays.size(); ++i)
            for (const auto& hit : {hits[i], closest_hit(scene, rays[i])}) {
                ASSERT_TRUE(hit.hit()) << i;
                EXPECT_EQ(hit.t, 0);
                EXPECT_FALSE(std::signbit(hit.t));
            }
    };
    constexpr TypeParam minus = -TypeParam(0);
    expect_plus(At::of_spheres({{{0, 0, 0}, 0}, {{minus, minus, minus}, 0}}));
    expect_plus(At::of_capsules({{{0, 0, 0}, {0, 0, 0}, 0}}));
    expect_plus(At::of_points({{0, 0, 0}}, 0));
    const std::vector<typename At::Box> boxes(3, {{-1, -1, -1}, {1, 1, 1}});
    expect_plus(At::scene_of(typename At::UserGeometry(
        boxes, [](std::uint32_t, const typename At::Ray&, typename At::Hit& hit) {
            hit.t = minus;
            return true;
        })));
}

TYPED_TEST(ShapeEdges, WhatIsNoShapeIsLeftOut) {
    using At = Of<TypeParam>;
    constexpr TypeParam nan = At::nan, inf = At::inf;
    const typename At::Ray down{{0, 0, 10}, 0, {0, 0, -1}, inf};
    const auto expect_first = [&](const typename At::Scene& scene, std::uint32_t prim) {
        const auto hit = closest_hit(scene, down);
        EXPECT_EQ(hit.prim, prim);
        EXPECT_EQ(hit.t, 9);
        EXPECT_EQ(scene.bounds().hi.z, 1);
    };
    expect_first(
        At::of_spheres({{{0, 0, 0}, -1}, {{0, nan, 0}, 1}, {{0, 0, 0}, nan}, {{0, 0, 0}, 1}}), 3);
    expect_first(At::of_capsules({{{0, nan, 0}, {0, 0, 0}, 1},
                                  {{0, 0, 0}, {0, 0, inf}, 1},
                                  {{0, 0, 0}, {0, 0, 0}, -inf},
                                  {{0, 0, 0}, {5, 0, 0}, 1}}),
                 3);
    expect_first(At::of_points({{0, 0, nan}, {0, 0, 0}}, 1), 1);
    EXPECT_FALSE(closest_hit(At::of_points({{0, 0, 0}}, -1), down).hit());
    EXPECT_TRUE(closest_hit(At::of_points({{0, 0, 0}}, 0), down).hit());
}

TYPED_TEST(ShapeEdges, ACapsulesHitKnowsItsPlaceAlongTheAxis) {
    using At = Of<TypeParam>;
    constexpr TypeParam far = sizeof(TypeParam) == 4 ? TypeParam(8) : TypeParam(4.5e6);
    const auto scene = At::of_capsules({{{far, 0, 0}, {far, 8, 0}, TypeParam(0.25)}});
    const auto hit = [&](TypeParam x, TypeParam y, typename At::Point d) {
        return closest_hit(scene, {{far + x, y, 0}, 0, d, At::inf});
    };
    EXPECT_EQ(hit(-2, 2, {1, 0, 0}).u, TypeParam(0.25));
    EXPECT_EQ(hit(-2, TypeParam(-0.125), {1, 0, 0}).u, 0);
    EXPECT_EQ(hit(-2, TypeParam(8.125), {1, 0, 0}).u, 1);
    EXPECT_EQ(hit(-2, 2, {1, 0, 0}).t, TypeParam(1.75));
    // Along the axis, inside and beside.
    EXPECT_EQ(hit(0, -2, {0, 1, 0}).t, TypeParam(1.75));
    EXPECT_FALSE(hit(TypeParam(-0.26), -2, {0, 1, 0}).hit());
}

/// Spheres whose radius is what floats err by where they are. Rays pass just inside and outside.
TEST(ShapeEdgesInFloat, GrainsFarFromTheRaysOrigin) {
    constexpr float distance = 1000, radius = 0x1p-13f;
    RandomD random(20190324);
    const auto direction = [&] { return normalized(Double3(random.direction())); };
    std::vector<Sphere> grains;
    std::vector<Ray> rays;
    std::vector<std::uint8_t> wanted;
    for (int i = 0; i < 2000; ++i) {
        const Double3 away = direction() * distance, beside = normalized(cross(away, direction()));
        const Double3 aim = away + beside * (radius * random.between(0.7, 1.3));
        grains.push_back({away.rounded(), radius});
        rays.push_back({{0, 0, 0}, 0, aim.rounded(), infinity});
        const Double3 d = normalized(Double3(rays.back().direction));
        wanted.push_back(length(cross(Double3(grains.back().center), d)) <= radius);
    }
    const Scene scene = Of<float>::of_spheres(grains);
    const std::vector<Hit> hits = trace(scene, rays);
    std::vector<std::uint8_t> found;
    for (std::size_t i = 0; i < rays.size(); ++i) {
        found.push_back(hits[i].prim == i);
        EXPECT_EQ(any_hit(scene, rays[i]), hits[i].hit()) << i;
    }
    EXPECT_EQ(found, wanted);
    EXPECT_GT(std::ranges::count(wanted, 1), 500);
}

TEST(ShapeEdgesInDouble, ABallFarFromTheOrigin) {
    // A metre large; rays pass its edge 2^-30 inside, and as much outside.
    const SceneD scene = Of<double>::of_spheres({{{4.5e6, 4.5e6, 4.5e6}, 0.5}});
    const auto from = [&](double x, double y, double tmin, Vec3d d) {
        return closest_hit(scene, {{4.5e6 + x, 4.5e6 + y, 4.5e6}, tmin, d});
    };
    EXPECT_EQ(from(-3, 0, 0, {1, 0, 0}).t, 2.5);
    EXPECT_TRUE(from(-3, 0.5 - 0x1p-30, 0, {1, 0, 0}).hit());
    EXPECT_FALSE(from(-3, 0.5 + 0x1p-30, 0, {1, 0, 0}).hit());
    // From inside it hits where it leaves, from the surface too.
    EXPECT_EQ(from(0, 0, 0, {0, 2, 0}).t, 0.25);
    EXPECT_EQ(from(-0.5, 0, 0, {1, 0, 0}).t, 0.0);
    EXPECT_EQ(from(-0.5, 0, 0.5, {1, 0, 0}).t, 1.0);
    // Directions whose squares overflow or vanish.
    for (const double d : {0x1p-900, 0x1p900}) EXPECT_EQ(from(-3, 0, 0, {d, 0, 0}).t, 2.5 / d);
    // A micrometre at a thousand kilometres.
    const SceneD grain = Of<double>::of_spheres({{{1e6, 0, 0}, 1e-6}});
    EXPECT_NEAR(closest_hit(grain, {{0, 0, 0}, 0, {1, 0, 0}}).t, 1e6 - 1e-6, 2.4e-10);
}

TEST(ShapeEdgesInDouble, BoxesHoldTheShapesExactly) {
    constexpr double inf = Of<double>::inf;
    RandomD random(20190323);
    for (int i = 0; i < 2000; ++i) {
        const Vec3d p = std::ldexp(1.0, static_cast<int>(random.below(60)) - 20) *
                        random.in({{-1, -1, -1}, {1, 1, 1}});
        const double r = std::ldexp(random.unit(), static_cast<int>(random.below(80)) - 50);
        const std::vector<SphereD> balls{{p, r}};
        const AabbD box = boxes_of<double>(std::span<const SphereD>(balls))[0];
        EXPECT_LE(Exact(box.lo.x), Exact(p.x) - Exact(r));
        EXPECT_GE(Exact(box.hi.z), Exact(p.z) + Exact(r));
        // And not a step more.
        EXPECT_GT(Exact(std::nextafter(box.lo.x, inf)), Exact(p.x) - Exact(r));
        EXPECT_LT(Exact(std::nextafter(box.hi.z, -inf)), Exact(p.z) + Exact(r));
    }
}

using Wide = long double;

double magnitude(Vec3d p) { return std::max({std::fabs(p.x), std::fabs(p.y), std::fabs(p.z)}); }

/// A function that goes as far as is promised: its hits are where the ray enters or leaves the box
/// made larger, and t is off. Different primitives say different things.
struct Liar {
    std::span<const AabbD> boxes;

    bool operator()(std::uint32_t prim, const RayD& ray, HitD& hit) const {
        const AabbD& box = boxes[prim];
        const Wide room = 0.99L * 0x1p-44L * std::max(magnitude(box.lo), magnitude(box.hi));
        Wide enter = 0.0L, leave = std::numeric_limits<Wide>::infinity();
        const auto axis = [&](double lo, double hi, double o, double d) {
            if (d == 0.0) {
                if (lo - room > o || hi + room < o) leave = -1.0L;
                return;
            }
            const Wide a = (lo - room - o) / d, b = (hi + room - o) / d;
            enter = std::max(enter, std::min(a, b));
            leave = std::min(leave, std::max(a, b));
        };
        axis(box.lo.x, box.hi.x, ray.origin.x, ray.direction.x);
        axis(box.lo.y, box.hi.y, ray.origin.y, ray.direction.y);
        axis(box.lo.z, box.hi.z, ray.origin.z, ray.direction.z);
        if (!(enter <= leave)) return false;
        const Wide off = 0.99L * 0x1p-41L;
        hit.t = static_cast<double>(prim % 3 == 0   ? enter * (1 - off)
                                    : prim % 3 == 1 ? leave * (1 + off)
                                                    : enter + (leave - enter) / 2);
        if (hit.t < ray.tmin && prim % 2 == 0) hit.t = static_cast<double>(leave * (1 + off));
        return hit.t >= ray.tmin && hit.t <= ray.tmax;
    }
};

/// Most boxes are points at one place, the tree's center, where floats take nothing away: no node
/// is larger there than it was made.
std::vector<AabbD> boxes_around(Vec3d place, double size, RandomD& random) {
    std::vector<AabbD> boxes(80, {place, place});
    for (int i = 0; i < 39; ++i) {
        const Vec3d lo = place + size * random.in({{-1, -1, -1}, {1, 1, 1}});
        boxes.push_back({lo, lo + 0.1 * size * random.in({{0, 0, 0}, {1, 1, 1}})});
        if (i % 3 == 0) boxes.back().lo.x = place.x, boxes.back().hi.x = place.x + size;
        if (i % 3 == 1) boxes.back().hi.y = place.y, boxes.back().lo.y = place.y - size;
    }
    return boxes;
}

/// Past corners of boxes by about what is promised.
std::vector<RayD> rays_past_corners(const std::vector<AabbD>& boxes, const Liar& liar, double size,
                                    RandomD& random) {
    std::vector<RayD> rays;
    for (std::size_t i = 0; i < 200 * thorough; ++i) {
        const AabbD& box = boxes[random.below(boxes.size())];
        const Vec3d corner{i & 1 ? box.lo.x : box.hi.x, i & 2 ? box.lo.y : box.hi.y,
                           i & 4 ? box.lo.z : box.hi.z};
        const double distance = size * std::ldexp(1.0, static_cast<int>(random.below(20)) - 6);
        Vec3d d = random.direction();
        if (i % 5 == 0) d = {0, 0, 1};
        if (i % 5 == 1) d.x = 0.0;
        const double beside = 0x1p-44 * (magnitude(corner) + size);
        const Vec3d aim = corner + beside * random.in({{-2, -2, -2}, {2, 2, 2}});
        RayD ray{aim - distance * d, 0, d * std::ldexp(1.0, static_cast<int>(i % 7) - 3)};
        // Limits that a hit just meets.
        HitD hit;
        if (i % 3 != 0 && liar(static_cast<std::uint32_t>(random.below(80)), ray, hit))
            (i % 3 == 1 ? ray.tmin : ray.tmax) = hit.t;
        rays.push_back(ray);
    }
    return rays;
}

TEST(ShapeEdgesInDouble, BoxesAreEnteredAsEarlyAsPromised) {
    constexpr std::uint64_t seed = 20240229;
    RandomD random(seed);
    std::size_t hits = 0;
    for (const auto& [place, size] : {std::pair{Vec3d{0, 0, 0}, 1.0},
                                      {utm_place, 1.0},
                                      {Vec3d{0.4e12, -0.7e12, 0.1e12}, 1e11}}) {
        const std::vector<AabbD> boxes = boxes_around(place, size, random);
        const Liar liar{boxes};
        const std::vector<RayD> rays = rays_past_corners(boxes, liar, size, random);
        std::vector<HitD> wanted(rays.size());
        for (std::size_t i = 0; i < rays.size(); ++i) {
            for (std::uint32_t prim = 0; prim < boxes.size(); ++prim) {
                HitD hit;
                if (liar(prim, rays[i], hit) && hit.t < wanted[i].t)
                    wanted[i] = {hit_of_tree(TreeHitD{hit.t, prim, hit.u, hit.v}), 0, 0};
            }
            hits += wanted[i].hit();
        }
        for (const Quality quality : {Quality::fast, Quality::balanced, Quality::high}) {
            SceneD scene;
            scene.add(UserGeometryD(boxes, liar));
            scene.commit({.quality = quality});
            const std::vector<HitD> found = trace(scene, rays);
            std::size_t wrong = 0;
            for (std::size_t i = 0; i < rays.size(); ++i) {
                wrong += found[i] != wanted[i];
                wrong += closest_hit(scene, rays[i]) != wanted[i];
                wrong += any_hit(scene, rays[i]) != wanted[i].hit();
            }
            EXPECT_EQ(wrong, 0u) << "quality " << static_cast<int>(quality) << ' ' << place.x
                                 << ", seed " << seed;
        }
    }
    std::cout << hits << " hits\n";
    EXPECT_GT(hits, 50 * thorough);
}

/// Two primitives one behind the other, whose t are off so that the farther one is hit first.
TEST(ShapeEdgesInDouble, TMayBeOff) {
    constexpr double off = 0x1p-41;
    std::vector<AabbD> boxes;
    for (const double z : {10.0 * (1 - 0.9 * off), 10.0}) boxes.push_back({{0, 0, z}, {0, 0, z}});
    const SceneD scene =
        Of<double>::scene_of(UserGeometryD(boxes, [](std::uint32_t prim, const RayD&, HitD& hit) {
            hit.t = 10.0 * (1 - (prim == 0 ? 0.9 : 0.99) * 0x1p-41);
            return true;
        }));
    EXPECT_EQ(closest_hit(scene, {{0, 0, 0}, 0, {0, 0, 1}}).prim, 1u);
}

}  // namespace
}  // namespace raydix::test
