// src/engine/hit_points.cpp against maps that are put together in long double.
#include <gtest/gtest.h>
#include <raydix/scene.h>
#include <raydix/surface.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <string>
#include <vector>

#include "build/shapes.h"
#include "engine/affine.h"
#include "engine/long_double_maps.h"
#include "support/random.h"
#include "support/support.h"

namespace raydix {
namespace {

using test::Column, test::Real, test::column, test::crossed, test::mapped, test::minus, test::times;
using Map = test::LongMap;

/// A mesh on a path, as a commit has it.
struct Placed {
    std::uint32_t instance, geometry;
    Mesh mesh;
    Map map;
};

/// A scene, and its meshes on all paths.
struct World {
    Scene scene;
    std::uint32_t paths = 0;
    std::vector<Placed> placed;

    void add(const World& inner, const Transform& transform, const GeometryOptions& options = {}) {
        scene.add(inner.scene, transform, options);
        const std::uint32_t number = ++paths;
        const Map map(transform);
        for (const Placed& p : inner.placed)
            placed.push_back({number + p.instance, p.geometry, p.mesh, map.after(p.map)});
        paths += inner.paths;
    }
    void add(const Mesh& mesh, const GeometryOptions& options = {}) {
        placed.push_back({0, scene.add(mesh, options), mesh, {}});
    }
};

class RandomPlaces : public test::Random {
public:
    using test::Random::Random;
    std::uint32_t below(std::size_t n) {
        return static_cast<std::uint32_t>(test::Random::below(n));
    }
    /// One in two mirrors.
    Transform transform(float shear) {
        Transform t;
        for (auto& row : t.m) {
            for (float& x : row) x = between(-1, 1);
            row[3] *= 5;
        }
        if (shear > 1)
            for (std::size_t k = 0; k < 3; ++k) t.m[0][k] += between(-shear, shear) * t.m[1][k];
        return inverse_of(affine_of(t)) ? t : transform(shear);
    }
    Hit hit_on(const Placed& on) {
        Hit hit;
        hit.t = 1;
        hit.prim = below(on.mesh.triangles.size());
        hit.u = between(0, 1);
        hit.v = between(0, 1) * (1 - hit.u);
        hit.geometry = on.geometry;
        hit.instance = on.instance;
        return hit;
    }
};

struct Recipe {
    int levels;
    float shear;
    Usage usage = Usage::fixed;
};

/// Ids have holes.
World random_world(RandomPlaces& random, const Recipe& recipe, int level = 0) {
    World world;
    std::vector<World> inner;
    if (level < recipe.levels)
        for (int k = 0; k < 2; ++k) inner.push_back(random_world(random, recipe, level + 1));
    std::uint32_t id = 0;
    for (int k = 0; k < 5; ++k, ++id) {
        id += random.below(3);
        const GeometryOptions options{.mask = 1u << random.below(2), .id = id};
        if (!inner.empty() && random.below(3) != 0)
            world.add(inner[random.below(2)], random.transform(recipe.shear), options);
        else
            world.add(test::random_soup(1 + random.below(20), id + 50, 0.7f), options);
    }
    world.scene.commit({.usage = recipe.usage});
    return world;
}

std::array<Column, 3> corners_of(const Placed& on, std::uint32_t prim) {
    const Triangle& t = on.mesh.triangles[prim];
    return {column(on.mesh.vertices[t[0]]), column(on.mesh.vertices[t[1]]),
            column(on.mesh.vertices[t[2]])};
}

/// The distance from `is` to `wanted`, in parts of what it may be: rounding to float, and `slack`.
Real off(Vec3 is, const Column& wanted, const Column& slack) {
    const Column got = column(is);
    Real most = 0;
    for (std::size_t k = 0; k < 3; ++k) {
        const Real may = 0x1.001p-24L * std::fabs(wanted[k]) + slack[k] + 0x1p-149L;
        most = std::max(most, std::fabs(got[k] - wanted[k]) / may);
        if (std::isnan(got[k])) return std::numeric_limits<Real>::infinity();
    }
    return most;
}

Real off_point(const Placed& on, const Hit& hit, Vec3 point) {
    const auto corners = corners_of(on, hit.prim);
    const Real u = hit.u, v = hit.v;
    Column at{}, size{};
    for (std::size_t k = 0; k < 3; ++k) {
        at[k] = (1 - u - v) * corners[0][k] + u * corners[1][k] + v * corners[2][k];
        for (const Column& corner : corners) size[k] += std::fabs(corner[k]);
    }
    return off(point, mapped(on.map.m, at), times(mapped(on.map.most, size), 0x1p-46L));
}

Real off_normal(const Placed& on, const Hit& hit, Vec3 normal) {
    const auto corners = corners_of(on, hit.prim);
    const Column wanted =
        on.map.turned(crossed(minus(corners[1], corners[0]), minus(corners[2], corners[0])));
    const Real slack = 0x1p-46L * on.map.condition;
    return off(normal, wanted, {slack, slack, slack});
}

void expect_right(World& world, RandomPlaces& random, int count) {
    std::vector<Hit> hits;
    std::vector<const Placed*> on;
    for (int i = 0; i < count; ++i) {
        on.push_back(&world.placed[random.below(world.placed.size())]);
        hits.push_back(random.hit_on(*on.back()));
        if (i % 9 == 8) hits.back() = {};
    }
    const std::vector<Vec3> points = positions(world.scene, hits),
                            ways = normals(world.scene, hits, 2);
    std::size_t misses = 0;
    for (std::size_t i = 0; i < hits.size(); ++i) {
        if (!hits[i].hit()) {
            ++misses;
            for (const Vec3& p : {points[i], ways[i]})
                EXPECT_TRUE(std::isnan(p.x) && std::isnan(p.y) && std::isnan(p.z));
            continue;
        }
        ASSERT_LE(off_point(*on[i], hits[i], points[i]), 1) << i;
        ASSERT_LE(off_normal(*on[i], hits[i], ways[i]), 1) << i;
    }
    EXPECT_EQ(misses, hits.size() / 9);
}

TEST(HitPoints, AreThoseOfMapsInLongDouble) {
    for (const std::uint64_t start : {1, 2, 3})
        for (const float shear : {1.0f, 100.0f, 10000.0f})
            for (const int levels : {0, 1, 3})
                for (const Usage usage : {Usage::fixed, Usage::moving}) {
                    SCOPED_TRACE("start " + std::to_string(start) + " levels " +
                                 std::to_string(levels) + " shear " + std::to_string(shear));
                    RandomPlaces random(start * 1000 + static_cast<std::uint64_t>(levels));
                    World world = random_world(random, {levels, shear, usage});
                    expect_right(world, random, 900);
                }
}

/// Paths of all instances are equally long here, and of one they are not.
TEST(HitPoints, FindsAnyPath) {
    RandomPlaces random(7);
    World leaf, row, uneven;
    leaf.add(test::random_soup(3, 1));
    leaf.scene.commit();
    for (int k = 0; k < 50; ++k) row.add(leaf, random.transform(1));
    row.scene.commit();
    for (int k = 0; k < 30; ++k) {
        uneven.add(k % 7 == 3 ? row : leaf, random.transform(1));
        if (k % 5 == 0) uneven.add(test::random_soup(2, 9));
    }
    uneven.scene.commit();
    for (World* const world : {&row, &uneven}) {
        std::vector<Hit> hits;
        for (const Placed& on : world->placed) hits.push_back(random.hit_on(on));
        const std::vector<Vec3> points = positions(world->scene, hits);
        for (std::size_t i = 0; i < hits.size(); ++i)
            ASSERT_LE(off_point(world->placed[i], hits[i], points[i]), 1) << i;
    }
}

TEST(HitPoints, LieWhereRaysHit) {
    RandomPlaces random(11);
    const World world = random_world(random, {2, 1});
    std::vector<Ray> rays;
    for (int i = 0; i < 4000; ++i) {
        const Vec3 from = random.in(-6, 6), to = random.in(-2, 2);
        rays.push_back({from, 0, {to.x - from.x, to.y - from.y, to.z - from.z}});
    }
    const std::vector<Hit> hits = trace(world.scene, rays);
    const std::vector<Vec3> points = positions(world.scene, hits),
                            ways = normals(world.scene, hits);
    std::size_t found = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
        if (!hits[i].hit()) continue;
        ++found;
        const Double3 at = Double3(rays[i].origin) + Double3(rays[i].direction) * double{hits[i].t};
        EXPECT_LT(length(at - Double3(points[i])), 1e-3) << i;
        EXPECT_NEAR(length(Double3(ways[i])), 1, 1e-6);
    }
    EXPECT_GT(found, 200u);
}

/// The outside of a box stays outside, whatever it goes through.
TEST(HitPoints, MirrorsKeepTheOutsideOutside) {
    Mesh box;
    test::add_box(box, {-1, -1, -1}, {1, 1, 1});
    Scene inner(box);
    RandomPlaces random(3);
    std::size_t mirrored = 0;
    for (int k = 0; k < 40; ++k) {
        const Transform one = random.transform(10), two = random.transform(1);
        Scene middle, outer;
        middle.add(inner, one);
        middle.commit();
        outer.add(middle, two);
        outer.commit();
        const Affine a = affine_of(one), b = affine_of(two);
        mirrored += dot(a.x, cross(a.y, a.z)) * dot(b.x, cross(b.y, b.z)) < 0;
        std::vector<Hit> hits;
        for (std::uint32_t prim = 0; prim < box.triangles.size(); ++prim) {
            Hit hit;
            hit.t = 1, hit.prim = prim, hit.u = hit.v = 0.3f;
            hit.geometry = 0;
            hits.push_back(hit);
        }
        const std::vector<Vec3> own = normals(inner, hits), own_points = positions(inner, hits);
        // test::add_box says which side is which; all the same.
        const double side = dot(Double3(own[0]), Double3(own_points[0]));
        for (Hit& hit : hits) hit.instance = 2;
        const std::vector<Vec3> ways = normals(outer, hits), points = positions(outer, hits);
        const Double3 middle_of_it = b.point(a.point({0, 0, 0}));
        for (std::size_t i = 0; i < hits.size(); ++i) {
            EXPECT_GT(side * dot(Double3(own[i]), Double3(own_points[i])), 0);
            EXPECT_GT(side * dot(Double3(ways[i]), Double3(points[i]) - middle_of_it), 0);
        }
    }
    EXPECT_GT(mirrored, 8u);
    EXPECT_LT(mirrored, 32u);
}

TEST(HitPoints, AreTheSameForEveryThreadCount) {
    RandomPlaces random(5);
    World world = random_world(random, {2, 100});
    std::vector<Hit> hits;
    for (int i = 0; i < 30'000; ++i)
        hits.push_back(random.hit_on(world.placed[random.below(world.placed.size())]));
    const std::vector<Vec3> points = positions(world.scene, hits, 1),
                            ways = normals(world.scene, hits, 1);
    for (const int threads : {2, 7}) {
        const std::vector<Vec3> p = positions(world.scene, hits, threads),
                                n = normals(world.scene, hits, threads);
        EXPECT_EQ(std::memcmp(p.data(), points.data(), p.size() * sizeof(Vec3)), 0);
        EXPECT_EQ(std::memcmp(n.data(), ways.data(), n.size() * sizeof(Vec3)), 0);
    }
}

/// The deepest that a scene may be, with maps that would leave the range of doubles if their
/// normals were not brought back to unit length on the way.
TEST(HitPoints, KeepNormalsThroughAllLevels) {
    std::vector<Scene> scenes;
    scenes.emplace_back(Mesh{{}, {{0, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {{0, 1, 2}}});
    for (std::uint32_t level = 0; level < Scene::max_levels; ++level) {
        Transform t;
        const float by = 1e-6f;
        for (std::size_t k = 0; k < 3; ++k) t.m[k][k] = by;
        t.m[2][2] = -by;
        Scene outer;
        outer.add(scenes.back(), t);
        outer.commit();
        scenes.push_back(std::move(outer));
    }
    Hit hit;
    hit.prim = hit.geometry = 0, hit.instance = Scene::max_levels;
    const Vec3 normal = normals(scenes.back(), {&hit, 1})[0];
    EXPECT_EQ(normal.x, 1);
    EXPECT_EQ(normal.y, 0);
    EXPECT_EQ(normal.z, 0);
}

}  // namespace
}  // namespace raydix
