// src/engine/hit_points.cpp: what calls promise in float and in double alike.
#include <gtest/gtest.h>
#include <raydix/error.h>
#include <raydix/scene.h>
#include <raydix/surface.h>

#include <cmath>
#include <cstdint>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "support/message.h"

namespace raydix::test {
namespace {

/// What scenes of a number type are made of, and are asked.
template <class Scalar>
struct KindOf {
    using Scene = BasicScene<Scalar>;
    using Mesh = typename Scene::Mesh;
    using Transform = typename Scene::Transform;
    using Hit = typename Scene::Hit;
    using Point = BasicVec3<Scalar>;

    static Hit hit_on(std::uint32_t geometry, std::uint32_t instance = 0, std::uint32_t prim = 0) {
        Hit hit;
        hit.prim = prim;
        hit.geometry = geometry;
        hit.instance = instance;
        return hit;
    }
    static Mesh triangle_at(Scalar x) {
        return {{}, {{x, 0, 0}, {x, 1, 0}, {x, 0, 1}}, {{0, 1, 2}}};
    }
    static Scalar x_of(const Scene& scene, const Hit& hit) {
        return positions(scene, {&hit, 1})[0].x;
    }
};

template <class Scalar>
class HitPointsOf : public ::testing::Test {};
using Scalars = ::testing::Types<float, double>;
TYPED_TEST_SUITE(HitPointsOf, Scalars);

TYPED_TEST(HitPointsOf, RightHandRule) {
    using Kind = KindOf<TypeParam>;
    typename Kind::Mesh mesh;
    mesh.vertices = {{0, 0, 5}, {1, 0, 5}, {0, 1, 5}};
    mesh.triangles = {{0, 1, 2}, {0, 2, 1}, {0, 1, 1}};
    const typename Kind::Scene scene(mesh);
    std::vector<typename Kind::Hit> hits;
    for (std::uint32_t prim = 0; prim < 3; ++prim) {
        hits.push_back(Kind::hit_on(0, 0, prim));
        hits.back().u = TypeParam(0.25), hits.back().v = TypeParam(0.5);
    }
    const std::vector<typename Kind::Point> ways = normals(scene, hits),
                                            points = positions(scene, hits);
    EXPECT_EQ(ways[0].x, 0);
    EXPECT_EQ(ways[0].y, 0);
    EXPECT_EQ(ways[0].z, 1);
    EXPECT_EQ(ways[1].z, -1);
    EXPECT_EQ(points[0].x, 0.25);
    EXPECT_EQ(points[0].y, 0.5);
    EXPECT_EQ(points[0].z, 5);
    EXPECT_EQ(points[1].x, 0.5);
    // No area: a point, but no normal.
    EXPECT_EQ(points[2].x, 0.75);
    EXPECT_TRUE(std::isnan(ways[2].x) && std::isnan(ways[2].y) && std::isnan(ways[2].z));
}

TYPED_TEST(HitPointsOf, TheLastCommit) {
    using Kind = KindOf<TypeParam>;
    using Scene = typename Kind::Scene;
    const auto triangle_at = Kind::triangle_at;
    const auto hit_on = [](std::uint32_t geometry, std::uint32_t instance = 0) {
        return Kind::hit_on(geometry, instance);
    };
    const auto x_of = Kind::x_of;
    for (const Usage usage : {Usage::fixed, Usage::moving}) {
        const SceneOptions options{.usage = usage};
        const typename Kind::Mesh shared_before = triangle_at(30), shared_after = triangle_at(31);
        Scene inner;
        inner.add(triangle_at(1));
        inner.commit(options);
        Scene scene;
        const std::uint32_t updated = scene.add(triangle_at(10)),
                            removed = scene.add(triangle_at(20)),
                            shared = scene.share(shared_before);
        typename Kind::Transform moved;
        moved.m[0][3] = 100;
        const std::uint32_t instance = scene.add(inner, moved);
        scene.commit(options);

        scene.update(updated, triangle_at(11));
        scene.update(updated, triangle_at(12));
        scene.update(shared, shared_after);
        scene.remove(removed);
        moved.m[0][3] = 200;
        scene.set_transform(instance, moved);
        const std::uint32_t late = scene.add(triangle_at(50));
        inner.update(0, triangle_at(2));
        inner.commit(options);

        EXPECT_EQ(x_of(scene, hit_on(updated)), 10);
        EXPECT_EQ(x_of(scene, hit_on(removed)), 20);
        EXPECT_EQ(x_of(scene, hit_on(shared)), 30);
        EXPECT_EQ(x_of(scene, hit_on(0, 1)), 101);
        EXPECT_EQ(x_of(inner, hit_on(0)), 2);
        EXPECT_THROW((void)x_of(scene, hit_on(late)), InputError);

        scene.commit(options);
        EXPECT_EQ(x_of(scene, hit_on(updated)), 12);
        EXPECT_EQ(x_of(scene, hit_on(shared)), 31);
        EXPECT_EQ(x_of(scene, hit_on(0, 1)), 202);
        EXPECT_EQ(x_of(scene, hit_on(late)), 50);
        EXPECT_THROW((void)x_of(scene, hit_on(removed)), InputError);

        // A scene that is gone lives on where it was placed.
        { Scene(std::move(inner)); }
        EXPECT_EQ(x_of(scene, hit_on(0, 1)), 202);
    }
}

TYPED_TEST(HitPointsOf, TheFirstHitThatIsNowhereIsNamed) {
    using Kind = KindOf<TypeParam>;
    using Scene = typename Kind::Scene;
    using Mesh = typename Kind::Mesh;
    using Hit = typename Kind::Hit;
    Scene inner, scene;
    inner.add(Kind::triangle_at(0), {.mask = 1, .id = 3});
    inner.commit();
    scene.add(Kind::triangle_at(1));
    scene.add(inner, {});
    scene.add(Mesh{});
    scene.commit();
    std::vector<Hit> hits(20'000, Kind::hit_on(0));
    hits[5] = {};
    const auto message = [&](std::uint32_t geometry, std::uint32_t instance = 0,
                             std::uint32_t prim = 0) {
        hits[17'000] = hits[19'000] = Kind::hit_on(geometry, instance, prim);
        const std::string of_points = message_of([&] { (void)positions(scene, hits); });
        EXPECT_EQ(of_points, message_of([&] { (void)normals(scene, hits); }));
        return of_points;
    };
    EXPECT_EQ(message(0), "no error");
    EXPECT_EQ(message(3, 1), "no error");
    EXPECT_EQ(message(0, 2), "hit 17000: the scene has no path 2 of instances");
    EXPECT_EQ(message(7), "hit 17000: the scene has no mesh 7");
    EXPECT_EQ(message(1), "hit 17000: the scene has no mesh 1");
    EXPECT_EQ(message(no_primitive), "hit 17000: the scene has no mesh 4294967295");
    EXPECT_EQ(message(2, 1), "hit 17000: the scene has no mesh 2 on path 1 of instances");
    EXPECT_EQ(message(2), "hit 17000: mesh 2 has 0 triangles; there is no triangle 0");
    EXPECT_EQ(message(3, 1, 1),
              "hit 17000: mesh 3 on path 1 of instances has 1 triangles; there is no triangle 1");

    EXPECT_EQ(message_of([&] { (void)positions(Scene(), hits); }), "scene: it was never committed");
    std::vector<typename Kind::Point> room(3);
    EXPECT_EQ(message_of([&] { positions(scene, hits, room); }),
              "positions: 20000 hits, but room for 3");
    EXPECT_EQ(message_of([&] { normals(scene, {}, room); }), "normals: 0 hits, but room for 3");
    EXPECT_NE(message_of([&] { (void)positions(scene, {}, -1); }), "no error");
    EXPECT_TRUE(positions(scene, {}).empty());
    EXPECT_TRUE(normals(Scene(Mesh{}), {}).empty());

    Scene ball, outer;
    const std::vector<typename Scene::Sphere> spheres(3);
    ball.add(spheres);
    ball.commit();
    outer.add(ball, {});
    outer.commit();
    const std::vector<typename Scene::Ray> rays(1);
    const std::vector<Hit> past{Kind::hit_on(0, 0, 3)}, inside{Kind::hit_on(0, 1, 3)},
        there{Kind::hit_on(0, 0, 2)};
    EXPECT_EQ(message_of([&] { (void)positions(ball, rays, past); }),
              "hit 0: geometry 0 (spheres) has 3 primitives; there is no primitive 3");
    EXPECT_EQ(message_of([&] { (void)normals(outer, rays, inside); }),
              "hit 0: geometry 0 (spheres) on path 1 of instances has 3 primitives; there is no "
              "primitive 3");
    EXPECT_EQ(message_of([&] { (void)positions(ball, there); }),
              "hit 0: geometry 0 (spheres) has no triangles: give the rays too");
}

}  // namespace
}  // namespace raydix::test
