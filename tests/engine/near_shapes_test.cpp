// Distance and overlap on scenes of spheres and capsules, as they are and as images under
// instances.
#include <gtest/gtest.h>
#include <raydix/error.h>
#include <raydix/overlap.h>
#include <raydix/scene_queries.h>
#include <raydix/user_geometry.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "engine/extent.h"
#include "engine/float_world.h"
#include "engine/near_shapes.h"
#include "support/support.h"

namespace raydix::test {
namespace {

TEST(NearShapes, SpheresAndCapsulesAreClosedSets) {
    Scene scene;
    const std::vector<Sphere> spheres{{{0, 0, 0}, 1}, {{10, 0, 0}, 0}, {{0, 0, 0}, -1}};
    const std::vector<Capsule> capsules{{{0, 5, 0}, {4, 5, 0}, 1}};
    const std::vector<Vec3> points{{0, -9, 0}};
    scene.add(std::span<const Sphere>(spheres));
    scene.add(std::span<const Capsule>(capsules));
    scene.add(std::span<const Vec3>(points), 0.5f);
    scene.commit();
    const SceneClosestPoint outside = closest_point(scene, {-3, 0, 0});
    EXPECT_EQ(outside.distance, 2.0f);
    EXPECT_EQ(outside.position.x, -1.0f);
    EXPECT_EQ(outside.geometry, 0u);
    const SceneClosestPoint inside = closest_point(scene, {0.25f, 0.5f, 0});
    EXPECT_EQ(inside.distance, 0.0f);
    EXPECT_EQ(inside.position.y, 0.5f);
    const SceneClosestPoint along = closest_point(scene, {3, 8, 0});
    EXPECT_EQ(along.geometry, 1u);
    EXPECT_EQ(along.distance, 2.0f);
    EXPECT_EQ(along.u, 0.75f);
    EXPECT_EQ(closest_point(scene, {0, -8, 0}).geometry, 2u);
    EXPECT_EQ(closest_point(scene, {10, 0.5f, 0}).prim, 1u);
    EXPECT_TRUE(touches(scene, Segment{{-3, 1, 0}, {3, 1, 0}}));
    EXPECT_FALSE(touches(scene, Segment{{-3, 1.01f, 0}, {3, 1.01f, 0}}));
    EXPECT_TRUE(touches(scene, Segment{{2, 5, -9}, {2, 5, 9}}));
    EXPECT_TRUE(touches(scene, Sphere{{-3, 0, 0}, 2}));
    EXPECT_FALSE(touches(scene, Sphere{{-3, 0, 0}, 1.99f}));
}

/// In a world of instances: each shape by itself gives the answer of all.
TEST(NearShapes, ImagesAnswerAsEachOfThemDoes) {
    RandomScenes random(12);
    for (int round = 0; round < static_cast<int>(1 + thorough / 3); ++round) {
        std::vector<Capsule> capsules;
        for (int k = 0; k < 30; ++k) {
            capsules.push_back({random.in(-1, 1), random.in(-1, 1), random.between(0, 0.3f)});
            if (k % 3 == 0) capsules.back().b = capsules.back().a;
        }
        Scene inner, scene;
        inner.add(std::span<const Capsule>(capsules));
        inner.commit();
        std::vector<Transform> transforms;
        for (int k = 0; k < 4; ++k) {
            transforms.push_back(random.transform(3, round % 2 == 0 ? 0.0f : 20.0f));
            scene.add(inner, transforms.back());
        }
        scene.commit();
        std::vector<Vec3> queries;
        for (int k = 0; k < 100; ++k) queries.push_back(random.in(-5, 5));
        const auto found = closest_points(scene, queries);
        for (std::size_t i = 0; i < queries.size(); ++i) {
            float best = infinity;
            for (const Transform& t : transforms)
                for (const Capsule& capsule : capsules)
                    best = std::min(best, closest_on_image(affine_of(t), capsule, queries[i]).d2);
            ASSERT_EQ(found[i].distance, std::sqrt(best)) << "round " << round << ", query " << i;
        }
    }
}

/// The point is in the image, and none in it is much nearer: neither at random nor around it.
TEST(NearShapes, PointsOfImagesAreTheClosest) {
    RandomScenes random(13);
    for (int round = 0; round < 100 * static_cast<int>(thorough); ++round) {
        const Transform transform = random.transform(2, round % 3 == 0 ? 5.0f : 0.0f);
        const Affine map = affine_of(transform), inverse = *inverse_of(map);
        Capsule capsule{random.in(-1, 1), random.in(-1, 1), random.between(0.05f, 0.5f)};
        if (round % 4 == 0) capsule.b = capsule.a;
        const Vec3 q = random.in(-4, 4);
        const ShapePoint p = closest_on_image(map, capsule, q);
        const auto within = [&](Double3 inside) {
            const Double3 a(capsule.a), axis = Double3(capsule.b) - a;
            const double length2 = dot(axis, axis);
            const double u =
                length2 > 0 ? std::clamp(dot(inside - a, axis) / length2, 0.0, 1.0) : 0.0;
            return length(inside - a - axis * u) / capsule.radius;
        };
        // The map may flatten to a part of 2^-12 or so: rounding of the point counts as much more.
        const double stretch = norm_of(inverse);
        ASSERT_LE(within(inverse.point(Double3(p.position))),
                  1 + 1e-5 * stretch * (1 + norm_of(map)) / capsule.radius);
        const double d = std::sqrt(double{p.d2});
        for (int k = 0; k < 300; ++k) {
            const double s = random.between(0, 1);
            Double3 w(random.in(-1, 1));
            w = w * (double{capsule.radius} / std::max(length(w), 1e-9));
            if (k % 2 == 0) {
                // Near the point that was found.
                const Double3 on_axis =
                    Double3(capsule.a) + (Double3(capsule.b) - Double3(capsule.a)) * double{p.u};
                const Double3 off = inverse.point(Double3(p.position)) - on_axis + w * 0.02;
                w = off * std::min(1.0, double{capsule.radius} / std::max(length(off), 1e-9));
                const Double3 other = map.point(on_axis + w);
                ASSERT_GE(length(other - Double3(q)), d - 1e-5);
            } else {
                const Double3 on_axis =
                    Double3(capsule.a) + (Double3(capsule.b) - Double3(capsule.a)) * s;
                ASSERT_GE(length(map.point(on_axis + w) - Double3(q)), d - 1e-5);
            }
        }
    }
}

/// Spheres as flat as paper, whose own axes lie askew: distances of the disc that is left.
TEST(NearShapes, FlatImagesKeepTheirDistances) {
    RandomScenes random(14);
    struct {
        Double3 query;
        double distance;
    } const cases[] = {{{0.3, 0.2, 0.5}, 0.5}, {{0.3, 0.2, -1e-3}, 1e-3},
                       {{2, 0, 0}, 1},         {{-3, 4, 0}, 4},
                       {{0, 5, 3}, 5},         {{0, 0.5, 0}, 0}};
    for (int round = 0; round < 100 * static_cast<int>(thorough); ++round) {
        // Three directions at right angles: columns of the map are these, made flat along z.
        const Double3 a(random.in(-1, 1)), b(random.in(-1, 1));
        const Double3 x = a * (1 / length(a)), z = cross(x, b) * (1 / length(cross(x, b))),
                      y = cross(z, x);
        for (const double flat : {1e-4, 3e-8, 1e-8, 3e-9, 1e-12, 1e-30}) {
            const Affine map{x, y, z * flat, {}};
            const BallImage ball(map, 2), half(map, 1);
            for (const auto& at : cases) {
                const Double3 p = half.closest(at.query);
                EXPECT_NEAR(length(p - at.query), at.distance, 2 * flat + 1e-13)
                    << flat << ", round " << round;
                EXPECT_LE(std::fabs(p.z), flat + 1e-15);
                EXPECT_NEAR(length(ball.closest(at.query * 2.0) - p * 2.0), 0.0, 1e-7);
            }
        }
    }
}

std::string message_of(const auto& call) {
    try {
        call();
    } catch (const InputError& error) {
        return error.what();
    }
    return {};
}

TEST(NearShapes, WhatHasNoAnswerIsNamed) {
    Scene inner, scene;
    const std::vector<Sphere> spheres{{{0, 0, 0}, 1}};
    const std::vector<Aabb> boxes{{{0, 0, 0}, {1, 1, 1}}};
    inner.add(one_triangle(0));
    inner.add(std::span<const Sphere>(spheres), {.mask = 6, .id = 3});
    inner.commit();
    scene.add(inner, moved(1, 0, 0), {.mask = 3});
    scene.commit();
    const SphereSweep sweep{{{0, 0, 9}, 0, {0, 0, -1}}, 1};
    EXPECT_NE(message_of([&] {
                  static_cast<void>(sweep_sphere(scene, sweep));
              }).find("geometry 3 (spheres) on path 1 of instances"),
              std::string::npos);
    EXPECT_TRUE(sweep_sphere(scene, sweep, 1).hit());  // does not see them
    EXPECT_EQ(closest_point(scene, {1, 0, 5}).geometry, 3u);
    inner.add(UserGeometry(boxes, [](std::uint32_t, const Ray&, Hit&) { return false; }),
              {.mask = 2, .id = 8});
    inner.commit();
    scene.commit();
    for (const std::string& message : {message_of([&] {
                                           static_cast<void>(closest_point(scene, {0, 0, 0}));
                                       }),
                                       message_of([&] {
                                           static_cast<void>(touches(scene, Sphere{{0, 0, 0}, 1}));
                                       })})
        EXPECT_NE(message.find("geometry 8 (user geometry) on path 1 of instances"),
                  std::string::npos)
            << message;
    EXPECT_EQ(closest_point(scene, {1, 0, 5}, infinity, 1).geometry, 0u);
}

/// Six levels of 32 instances, each with a mask of its own: 2^30 paths, but seven scenes.
TEST(NearShapes, WhatMasksHideOnManyPathsIsFoundAtOnce) {
    constexpr std::uint32_t levels = 6, each = 32;
    const std::vector<Sphere> spheres{{{0, 0, 0}, 1}};
    const std::vector<Aabb> boxes{{{0, 0, 0}, {1, 1, 1}}};
    std::vector<Scene> scenes(levels + 1);
    scenes[0].add(std::span<const Sphere>(spheres));
    scenes[0].add(UserGeometry(boxes, [](std::uint32_t, const Ray&, Hit&) { return false; }),
                  {.mask = 1});
    scenes[0].commit();
    float step = 4;
    for (std::uint32_t level = 0; level < levels; ++level) {
        for (std::uint32_t k = 0; k < each; ++k)
            scenes[level + 1].add(scenes[level], moved(step * static_cast<float>(k), 0, 0),
                                  {.mask = 2 + (k << 8)});
        step *= each;
        scenes[level + 1].commit();
    }
    const Scene& all = scenes[levels];
    for (int round = 0; round < 2; ++round) {
        EXPECT_EQ(closest_point(all, {0, 0, 3}, infinity, 2).distance, 2.0f);
        EXPECT_NE(message_of([&] {
                      static_cast<void>(closest_point(all, {0, 0, 3}, infinity, 3));
                  }).find("user geometry"),
                  std::string::npos);
    }
    const SphereSweep sweep{{{0, 0, 9}, 0, {0, 0, -1}}, 1};
    EXPECT_NE(message_of([&] { static_cast<void>(sweep_sphere(all, sweep, 2)); }).find("spheres"),
              std::string::npos);
}

/// Wherever in memory the trees of shapes are.
TEST(NearShapes, TheFirstGeometryIsNamed) {
    Scene inner, scene, outer;
    const std::vector<Sphere> spheres{{{0, 0, 0}, 1}};
    inner.add(spheres, {.id = 9});
    inner.commit();
    for (std::uint32_t id = 2; id < 8; ++id) scene.add(spheres, {.id = id});
    scene.add(inner, {}, {.id = 1});
    const SphereSweep sweep{{{0, 0, 9}, 0, {0, 0, -1}}, 1};
    const auto named = [&](const Scene& in) {
        return message_of([&] { static_cast<void>(sweep_sphere(in, sweep)); });
    };
    for (std::uint32_t k = 0; k < 12; ++k) {  // each of them is made last once
        scene.update(2 + (k * 5) % 6, spheres);
        scene.commit();
        EXPECT_EQ(named(scene),
                  "sweeps: geometry 2 (spheres) cannot be swept against: only triangles can");
    }
    outer.add(inner, {});
    outer.add(scene, {});
    outer.commit();
    EXPECT_EQ(named(outer),
              "sweeps: geometry 9 (spheres) on path 1 of instances cannot be swept against: only "
              "triangles can");
}

}  // namespace
}  // namespace raydix::test
