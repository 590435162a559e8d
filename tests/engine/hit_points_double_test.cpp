// src/engine/hit_points.cpp in double against maps that are put together in long double.
#include <gtest/gtest.h>
#include <raydix/scene.h>
#include <raydix/surface.h>

#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <string>
#include <vector>

#include "engine/double_world.h"
#include "engine/long_double_maps.h"

namespace raydix {
namespace {

using test::Column, test::Real, test::column, test::crossed, test::LongMap, test::mapped,
    test::minus, test::moved, test::one_triangle, test::product, test::RandomWorlds, test::times,
    test::WorldD;

/// A mesh on a path.
struct Placed {
    std::uint32_t instance, geometry;
    const MeshD* mesh;
    LongMap map;
};

/// All that have triangles.
void add_meshes(const WorldD& world, std::uint32_t number, const LongMap& map,
                std::vector<Placed>& out) {
    std::uint32_t next = number + 1;
    for (const WorldD::Item& item : world.items) {
        if (item.inside) {
            add_meshes(*item.inside, next, map.after(LongMap(item.transform)), out);
            next += 1 + static_cast<std::uint32_t>(item.inside->paths());
        } else if (!item.mesh.triangles.empty()) {
            out.push_back({number, item.id, &item.mesh, map});
        }
    }
}

HitD hit_at(std::uint32_t geometry, std::uint32_t instance = 0, std::uint32_t prim = 0) {
    HitD hit;
    hit.t = 1;
    hit.prim = prim;
    hit.u = 0.25, hit.v = 0.5;
    hit.geometry = geometry;
    hit.instance = instance;
    return hit;
}

std::vector<HitD> hits_on(RandomWorlds& random, const std::vector<Placed>& placed, int count,
                          std::vector<const Placed*>& on) {
    std::vector<HitD> hits;
    for (int i = 0; i < count; ++i) {
        on.push_back(&placed[random.below(placed.size())]);
        HitD hit =
            hit_at(on.back()->geometry, on.back()->instance,
                   random.under(static_cast<std::uint32_t>(on.back()->mesh->triangles.size())));
        hit.u = random.between(0, 1);
        hit.v = random.between(0, 1) * (1 - hit.u);
        hits.push_back(i % 9 == 8 ? HitD{} : hit);
    }
    return hits;
}

std::array<Column, 3> corners_of(const Placed& on, const HitD& hit) {
    const Triangle& t = on.mesh->triangles[hit.prim];
    const auto& v = on.mesh->vertices;
    return {column(v[t[0]]), column(v[t[1]]), column(v[t[2]])};
}

/// Within `slack` of what it should be, and not NaN.
void expect_near(Vec3d is, const Column& wanted, const Column& slack) {
    const Column got = column(is);
    for (std::size_t k = 0; k < 3; ++k)
        ASSERT_LE(std::fabs(got[k] - wanted[k]), slack[k] + 0x1p-1000L) << k;
}

void expect_point(const Placed& on, const HitD& hit, Vec3d point) {
    const auto corners = corners_of(on, hit);
    const Real u = hit.u, v = hit.v;
    Column at{}, size{};
    for (std::size_t k = 0; k < 3; ++k) {
        at[k] = (1 - u - v) * corners[0][k] + u * corners[1][k] + v * corners[2][k];
        for (const Column& corner : corners) size[k] += std::fabs(corner[k]);
    }
    expect_near(point, mapped(on.map.m, at),
                times(mapped(on.map.most, size), (on.map.levels + 1) * 0x1p-50L));
}

void expect_normal(const Placed& on, const HitD& hit, Vec3d normal) {
    const auto corners = corners_of(on, hit);
    const Column a = minus(corners[1], corners[0]), b = minus(corners[2], corners[0]),
                 way = crossed(a, b);
    const Real thin = std::sqrt(product(a, a) * product(b, b) / product(way, way));
    const Real slack = 0x1p-49L * (thin + on.map.levels) * on.map.condition;
    expect_near(normal, on.map.turned(way), {slack, slack, slack});
}

bool is_nan(Vec3d p) { return std::isnan(p.x) && std::isnan(p.y) && std::isnan(p.z); }

TEST(HitPointsD, AreThoseOfMapsInLongDouble) {
    for (const double distance : {0.0, 1e7})
        for (const double shear : {0.0, 1e4})
            for (const std::uint32_t levels : {0u, 1u, 3u})
                for (const Usage usage : {Usage::fixed, Usage::moving}) {
                    SCOPED_TRACE("distance " + std::to_string(distance) + " shear " +
                                 std::to_string(shear) + " levels " + std::to_string(levels));
                    RandomWorlds random(100 + levels);
                    const auto world =
                        random.world({levels, 5, shear, distance, {.usage = usage, .threads = 2}});
                    std::vector<Placed> placed;
                    add_meshes(*world, 0, {}, placed);
                    std::vector<const Placed*> on;
                    const std::vector<HitD> hits = hits_on(random, placed, 600, on);
                    const std::vector<Vec3d> points = positions(world->scene, hits),
                                             ways = normals(world->scene, hits, 2);
                    for (std::size_t i = 0; i < hits.size(); ++i) {
                        if (!hits[i].hit()) {
                            EXPECT_TRUE(is_nan(points[i]) && is_nan(ways[i]));
                            continue;
                        }
                        expect_point(*on[i], hits[i], points[i]);
                        expect_normal(*on[i], hits[i], ways[i]);
                        if (HasFatalFailure()) return;
                    }
                }
}

TEST(HitPointsD, LieWhereRaysHit) {
    RandomWorlds random(3);
    const auto world = random.world({2, 6, 0, 1e6, {}});
    const std::vector<RayD> rays = random.rays(3000, world->home);
    const std::vector<HitD> hits = trace(world->scene, rays);
    const std::vector<Vec3d> points = positions(world->scene, hits),
                             ways = normals(world->scene, hits);
    std::size_t found = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
        if (!hits[i].hit()) continue;
        ++found;
        const Double3 at = Double3(rays[i].origin) + Double3(rays[i].direction) * hits[i].t;
        EXPECT_LT(length(at - Double3(points[i])), 1e-7) << i;
        EXPECT_NEAR(length(Double3(ways[i])), 1, 1e-15);
    }
    EXPECT_GT(found, 200u);
}

TEST(HitPointsD, HaveTheDigitsOfDoubles) {
    SceneD inner(one_triangle(0x1p-40)), scene;
    TransformD there = moved(1e9, -1e9, 3);
    there.m[2][2] = -1;  // mirrored: the outside stays outside
    scene.add(inner, there);
    scene.commit();
    const HitD hit = hit_at(0, 1);
    const Vec3d point = positions(scene, {&hit, 1})[0], way = normals(scene, {&hit, 1})[0];
    EXPECT_EQ(point.x, 1e9 + 0.25);
    EXPECT_EQ(point.y, -1e9 + 0.5);
    EXPECT_EQ(point.z, 3 - 0x1p-40);
    EXPECT_EQ(way.x, 0);
    EXPECT_EQ(way.y, 0);
    EXPECT_EQ(way.z, -1);
}

/// Normals of very flat triangles, through maps whose inverses have very large entries; none
/// without area.
TEST(HitPointsD, NormalsNeedOnlyAnArea) {
    MeshD mesh;
    mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 0, -1e-140}, {2, 0, 0}};
    mesh.triangles = {{0, 1, 2}, {0, 1, 3}};
    SceneD inner(mesh), scene;
    TransformD tiny;
    for (std::size_t k = 0; k < 3; ++k) tiny.m[k][k] = 1e-150;
    scene.add(inner, tiny);
    scene.commit();
    const HitD alone = hit_at(0);
    const std::vector<HitD> hits{hit_at(0, 1), hit_at(0, 1, 1)};
    const std::vector<Vec3d> ways = normals(scene, hits), own = normals(inner, {&alone, 1});
    for (const Vec3d& way : {ways[0], own[0]}) {
        EXPECT_EQ(way.x, 0);
        EXPECT_NEAR(way.y, 1, 1e-15);
        EXPECT_EQ(way.z, 0);
    }
    EXPECT_TRUE(is_nan(ways[1]));
    EXPECT_NEAR(positions(scene, hits)[1].x, 1.25e-150, 1e-164);
}

TEST(HitPointsD, AreTheSameForEveryThreadCount) {
    RandomWorlds random(5);
    const auto world = random.world({2, 5, 100, 0, {}});
    std::vector<Placed> placed;
    add_meshes(*world, 0, {}, placed);
    std::vector<const Placed*> on;
    const std::vector<HitD> hits = hits_on(random, placed, 20'000, on);
    const std::vector<Vec3d> points = positions(world->scene, hits, 1),
                             ways = normals(world->scene, hits, 1);
    const std::vector<Vec3d> p = positions(world->scene, hits, 3),
                             n = normals(world->scene, hits, 3);
    EXPECT_EQ(std::memcmp(p.data(), points.data(), p.size() * sizeof(Vec3d)), 0);
    EXPECT_EQ(std::memcmp(n.data(), ways.data(), n.size() * sizeof(Vec3d)), 0);
}

}  // namespace
}  // namespace raydix
