// Scenes at the edges of what they may hold: the range of coordinates, meshes without area, rays
// that floats only just hold.
#include <gtest/gtest.h>
#include <raydix/bvh.h>
#include <raydix/double.h>
#include <raydix/overlap.h>
#include <raydix/scene.h>
#include <raydix/scene_pairs.h>
#include <raydix/scene_queries.h>
#include <raydix/solid.h>
#include <raydix/trace.h>
#include <raydix/wide.h>

#include <cmath>
#include <cstring>
#include <type_traits>
#include <vector>

#include "support/float_control.h"
#include "support/random.h"
#include "support/support.h"

namespace raydix {
namespace {

/// Boxes of parts are a little larger than what is in them, and no mesh is left out for that.
TEST(Scene, MeshesMayReachTheEdgeOfTheRange) {
    constexpr float edge = 1e12f;
    for (const Usage usage : {Usage::fixed, Usage::moving}) {
        Scene scene;
        std::vector<Ray> rays;
        for (std::uint32_t k = 0; k < 12; ++k) {
            const std::size_t axis = k % 3;
            const float side = k % 2 == 0 ? edge : -edge, by = 0.01f * edge * float(k + 1);
            const auto corner = [&](float a, float b) {
                float c[3];
                c[axis] = side, c[(axis + 1) % 3] = a, c[(axis + 2) % 3] = b;
                return Vec3{c[0], c[1], c[2]};
            };
            Mesh mesh;
            mesh.vertices = {corner(by, by), corner(by + 2e9f, by), corner(by, by + 2e9f)};
            mesh.triangles = {{0, 1, 2}};
            scene.add(mesh, {.mask = 1u << k, .id = {}});
            rays.push_back({{0, 0, 0}, 0, corner(by + 5e8f, by + 5e8f)});
            EXPECT_TRUE(closest_hit(Scene(mesh), rays.back()).hit()) << k;
        }
        scene.commit({.usage = usage});
        const std::vector<Hit> hits = trace(scene, rays);
        for (std::uint32_t k = 0; k < rays.size(); ++k) EXPECT_EQ(hits[k].geometry, k);
    }
}

/// Trees without triangles are nowhere, not at the origin.
TEST(Scene, MeshesWithoutAreaAreNowhere) {
    Mesh flat;
    flat.vertices = {{5, 5, 5}, {6, 6, 6}, {7, 7, 7}};
    flat.triangles = {{0, 1, 2}};
    const Mesh far = test::random_soup(5, 3, 0.5f);
    const Ray through{{0, 0, -1}, 0, {0, 0, 1}};
    for (const Usage usage : {Usage::fixed, Usage::moving})
        for (const bool compact : {false, true}) {
            const SceneOptions options{.usage = usage, .compact = compact};
            const Scene empty(flat, options);
            Scene scene;
            scene.add(flat, {.mask = 1, .id = {}});
            scene.add(flat, {.mask = 2, .id = {}});
            scene.add(empty, Transform{});
            scene.commit(options);
            EXPECT_FALSE(closest_hit(empty, through).hit());
            EXPECT_FALSE(any_hit(scene, through));
            EXPECT_GT(scene.bounds().lo.x, scene.bounds().hi.x);
            scene.add(far);
            scene.commit(options);
            EXPECT_EQ(closest_hit(Scene(far), through).t, closest_hit(scene, through).t);
            EXPECT_EQ(scene.bounds().lo.x, Scene(far).bounds().lo.x);
        }
}

/// A direction near the largest float leaves t and its smaller components in the range of floats,
/// through a tree over parts as through one tree.
TEST(Scene, DirectionsMayBeAsLongAsFloatsAre) {
    const Mesh mesh = test::random_soup(60, 8, 0.7f);
    test::Random random(5);
    std::vector<Ray> rays;
    for (int i = 0; i < 2000; ++i) {
        const Vec3 at = random.in(0, 1), from = random.in(-1, 2);
        const float far = (i % 2 == 0 ? 1.0f : -1.0f) * random.between(0.5e38f, 3.4e38f);
        Ray ray{at, 0, {at.x - from.x, at.y - from.y, at.z - from.z}};
        float* const origin = &ray.origin.x;
        float* const direction = &ray.direction.x;
        const std::size_t axis = random.below(3);
        direction[axis] = -far;  // small components beside it
        if (i % 3 == 0) origin[axis] = far;
        rays.push_back(ray);
    }
    const std::vector<Hit> wanted = trace_brute_force(mesh, rays);
    Scene scene, instance;
    scene.add(mesh);
    scene.add(Scene(test::random_soup(5, 3)), {{{{1, 0, 0, 9}, {0, 1, 0, 9}, {0, 0, 1, 9}}}});
    scene.commit();
    instance.add(Scene(mesh), Transform{});
    instance.commit();
    std::size_t found = 0;
    for (const SimdPath path : {SimdPath::automatic, SimdPath::single, SimdPath::packet,
                                SimdPath::stream, SimdPath::sorted}) {
        SceneTraceOptions options;
        options.path = path;
        const std::vector<Hit> hits = trace(scene, rays, options),
                               inside = trace(instance, rays, options);
        for (std::size_t i = 0; i < rays.size(); ++i) {
            Hit expected = wanted[i];
            found += expected.hit();
            ASSERT_EQ(std::memcmp(&hits[i], &expected, sizeof expected), 0) << i;
            if (expected.hit()) expected.instance = 1;
            ASSERT_EQ(std::memcmp(&inside[i], &expected, sizeof expected), 0) << i;
        }
    }
    for (std::size_t i = 0; i < rays.size(); ++i) {
        const Hit hit = closest_hit(scene, rays[i]);
        EXPECT_EQ(std::memcmp(&hit, &wanted[i], sizeof hit), 0) << i;
        EXPECT_EQ(any_hit(instance, rays[i]), wanted[i].hit()) << i;
    }
    EXPECT_GT(found, 500u);
}

constexpr SimdPath all_paths[] = {SimdPath::automatic, SimdPath::single, SimdPath::packet,
                                  SimdPath::stream, SimdPath::sorted};

/// Every way to ask a scene for closest hits says `wanted`. `instance`: of each of them that hits.
void expect_hits(const Scene& scene, const std::vector<Ray>& rays, std::vector<Hit> wanted,
                 std::uint32_t instance) {
    for (Hit& hit : wanted)
        if (hit.hit()) hit.instance = instance;
    const std::vector<std::uint32_t> masks(rays.size(), 1);
    const auto all_count = [](std::size_t, const Ray&, const Hit&) { return true; };
    const auto differ = [](const Hit& a, const Hit& b) {
        return std::memcmp(&a, &b, sizeof a) != 0;
    };
    for (const SimdPath path : all_paths)
        for (const bool masked : {false, true})
            for (const bool filtered : {false, true}) {
                SceneTraceOptions options;
                options.path = path;
                if (masked) options.masks = masks;
                if (filtered) options.filter = all_count;
                const std::vector<Hit> hits = trace(scene, rays, options);
                std::vector<std::uint8_t> any(rays.size());
                trace_any(scene, rays, any, options);
                for (std::size_t i = 0; i < rays.size(); ++i) {
                    ASSERT_FALSE(differ(hits[i], wanted[i]))
                        << i << ": t " << hits[i].t << ", not " << wanted[i].t << "; path "
                        << int(path) << (masked ? ", masks" : "") << (filtered ? ", filter" : "");
                    ASSERT_EQ(any[i] != 0, wanted[i].hit()) << i;
                }
            }
    const AllHits all = trace_all(scene, rays),
                  all_masked = trace_all(scene, rays, {.masks = masks});
    for (std::size_t i = 0; i < rays.size(); ++i) {
        ASSERT_FALSE(differ(closest_hit(scene, rays[i]), wanted[i])) << i;
        ASSERT_FALSE(differ(closest_hit(scene, rays[i], all_count), wanted[i])) << i;
        ASSERT_EQ(any_hit(scene, rays[i]), wanted[i].hit()) << i;
        for (const AllHits* const found : {&all, &all_masked}) {
            const bool some = found->offsets[i] != found->offsets[i + 1];
            ASSERT_EQ(some, wanted[i].hit()) << i;
            if (some) {
                ASSERT_EQ(found->hits[found->offsets[i]].t, wanted[i].t) << i;
            }
        }
    }
}

/// One mesh, one mesh beside something else, one mesh as an instance.
struct ThreeScenes {
    Scene one, beside, shown;
    ThreeScenes(const Mesh& mesh, bool compact) : one(mesh, {.compact = compact}) {
        Mesh other = test::random_soup(3, 4);
        for (Vec3& p : other.vertices) p = {p.x + 900, p.y + 900, p.z + 900};
        beside.add(mesh);
        beside.add(other, {.mask = 2, .id = {}});
        beside.commit({.usage = Usage::moving, .compact = compact});
        shown.add(one, Transform{});
        shown.commit();
    }
};

/// What floats round t to depends on the scale of a direction where both are that small: it is the
/// one of a ray on its own, whatever way the ray goes.
TEST(Scene, SubnormalDirectionsBesideSubnormalPlaces) {
    test::Random random(11);
    Mesh mesh;
    for (std::uint32_t k = 0; k < 8; ++k) {
        const auto corner = [&](float x, float y) {
            return Vec3{x, y, std::ldexp(random.between(1, 2), -128 - static_cast<int>(k))};
        };
        mesh.vertices.push_back(corner(-1, -1));
        mesh.vertices.push_back(corner(1, -1));
        mesh.vertices.push_back(corner(0, 2));
        mesh.triangles.push_back({3 * k, 3 * k + 1, 3 * k + 2});
    }
    std::vector<Ray> rays;
    for (int i = 0; i < 400; ++i) {
        const float along = std::ldexp(random.between(1, 2), -149 + i % 26);
        const Vec3 from{random.between(-0.5f, 0.5f), random.between(-0.5f, 0.5f), 0};
        rays.push_back({from, 0, {0, i % 3 == 0 ? along : 0.0f, along}});
        if (i % 5 == 0) rays.back().tmin = std::ldexp(1.0f, i % 20);
    }
    const std::vector<Hit> wanted = trace_brute_force(mesh, rays);
    std::size_t found = 0;
    for (const Hit& hit : wanted) found += hit.hit();
    EXPECT_GT(found, 100u);
    for (const bool compact : {false, true}) {
        const ThreeScenes scenes(mesh, compact);
        expect_hits(scenes.one, rays, wanted, 0);
        expect_hits(scenes.beside, rays, wanted, 0);
    }
}

/// Where the way is longer than the largest float, a hit is none; where t is a float, no hit is
/// lost because the ray's own units have no number for it.
TEST(Scene, RaysFromTheLargestFloat) {
    const Mesh mesh{{}, {{-1, 0, -1}, {1, 0, -1}, {0, 0, 2}}, {{0, 1, 2}}};
    constexpr float most = 3.4e38f;
    std::vector<Ray> rays;
    std::vector<Hit> wanted;
    for (int exponent = -149; exponent < 128; ++exponent)
        for (const float digits : {1.0f, 1.2f, 1.9f})
            for (const float side : {1.0f, -1.0f}) {
                const float along = std::ldexp(digits, exponent);
                rays.push_back({{0.1f, side * most, 0.2f}, 0, {0, -side * along, 0}});
                Hit hit;
                const auto t = static_cast<float>(double{most} / double{along});
                if (std::isfinite(t)) hit.t = t, hit.prim = 0, hit.geometry = 0;
                wanted.push_back(hit);
            }
    const std::vector<Hit> hits = trace_brute_force(mesh, rays),
                           in_tree = trace(build_bvh(mesh), rays);
    for (std::size_t i = 0; i < rays.size(); ++i) {
        ASSERT_EQ(hits[i].t, wanted[i].t) << rays[i].direction.y;
        ASSERT_EQ(hits[i].hit(), wanted[i].hit()) << rays[i].direction.y;
        ASSERT_EQ(in_tree[i].t, wanted[i].t) << rays[i].direction.y;
    }
    for (const bool compact : {false, true}) {
        const ThreeScenes scenes(mesh, compact);
        expect_hits(scenes.one, rays, hits, 0);
        expect_hits(scenes.beside, rays, hits, 0);
        expect_hits(scenes.shown, rays, hits, 1);
    }
}

TEST(Scene, DoubleHitsAreFinite) {
    const MeshD mesh{{}, {{-1, 0, -1}, {1, 0, -1}, {0, 0, 2}}, {{0, 1, 2}}};
    const RayD beyond{{0.1, 1e300, 0.2}, 0, {0, -1e-20, 0}},
        within{{0.1, 1e300, 0.2}, 0, {0, -1e-5, 0}};
    SceneD scene, shown;
    scene.add(mesh);
    scene.commit();
    shown.add(scene, TransformD{});
    shown.commit();
    for (const SceneD* const at : {&scene, &shown}) {
        EXPECT_FALSE(closest_hit(*at, beyond).hit());
        EXPECT_FALSE(any_hit(*at, beyond));
        EXPECT_FALSE(trace(*at, {&beyond, 1})[0].hit());
        EXPECT_EQ(closest_hit(*at, within).t, 1e300 / 1e-5);
    }
    EXPECT_FALSE(trace_brute_force(MeshViewD(mesh), {&beyond, 1})[0].hit());
}

/// The small component of a long direction has more digits than a float that is scaled to unit
/// length, and the instance makes them large: batches and single calls see all of them.
TEST(Scene, SmallComponentsOfLongDirectionsKeepTheirDigits) {
    const Scene wall(Mesh{{}, {{0, 0, -1}, {0, 1024, 0}, {0, 0, 1}}, {{0, 1, 2}}});
    Scene scene;
    Transform flat;
    flat.m[1][1] = 0x1p-20f;
    scene.add(wall, flat);
    scene.add(test::random_soup(3, 4), {.mask = 2, .id = {}});
    scene.commit();
    test::Random random(12);
    std::vector<Ray> rays;
    for (int i = 0; i < 200; ++i)
        rays.push_back({{-0x1p126f, 0, 0}, 0, {0x1p100f, random.between(0x1p-40f, 0x1p-39f), 0}});
    std::vector<Hit> wanted;
    for (const Ray& ray : rays) {
        wanted.push_back(closest_hit(scene, ray, 1));
        ASSERT_TRUE(wanted.back().hit());
        const double y = double{ray.direction.y} * 0x1p26 * 0x1p20 / 1024;
        ASSERT_EQ(wanted.back().u, static_cast<float>(y));
    }
    for (const SimdPath path : all_paths) {
        SceneTraceOptions options;
        options.path = path;
        options.mask = 1;
        const std::vector<Hit> hits = trace(scene, rays, options);
        for (std::size_t i = 0; i < rays.size(); ++i)
            ASSERT_EQ(std::memcmp(&hits[i], &wanted[i], sizeof(Hit)), 0)
                << i << ", path " << int(path) << ": u " << hits[i].u << ", not " << wanted[i].u;
    }
}

/// A triangle that its own mesh leaves out for its size is nowhere, however large an instance makes
/// it: in every query, in float and in double.
template <class Scalar>
void expect_small_triangles_nowhere() {
    using Point = BasicVec3<Scalar>;
    const auto small = static_cast<Scalar>(5e-13);
    BasicMesh<Scalar> mesh;
    mesh.vertices = {{0, 0, 0}, {small, 0, 0}, {0, small, 0}};
    mesh.triangles = {{0, 1, 2}};
    BasicScene<Scalar> inner, scene;
    inner.add(mesh);
    mesh.vertices = {{7, 0, 0}, {8, 0, 0}, {7, 1, 0}};
    inner.add(mesh);
    inner.commit();
    BasicTransform<Scalar> large;
    for (std::size_t axis = 0; axis < 3; ++axis) large.m[axis][axis] = 1000;
    scene.add(inner, large);
    mesh.vertices = {{0, 0, -1}, {1, 0, 1}, {-1, 0, 1}};
    scene.add(mesh);
    scene.commit();
    EXPECT_EQ(closest_point(inner, Point{0, 0, 0}).geometry, 1u);
    EXPECT_EQ(closest_point(scene, Point{0, static_cast<Scalar>(2e-10), 0}).instance, 0u);
    EXPECT_TRUE(overlapping_pairs(scene).pairs.empty());
    using Body = std::conditional_t<std::is_same_v<Scalar, float>, Solid, SolidD>;
    EXPECT_EQ(Body(scene).open_edges(), 6u);
}
TEST(Scene, WhatAMeshFindsTooSmallStaysSo) {
    expect_small_triangles_nowhere<float>();
    expect_small_triangles_nowhere<double>();
}

#if defined(RAYDIX_FLUSHES_DENORMALS)
/// A denormal direction is none of zeros, whatever the caller's thread makes of denormals.
TEST(Scene, OneRayOfACallerThatFlushesDenormals) {
    const Mesh mesh{{}, {{1, -1, -1}, {1, 1, -1}, {1, 0, 2}}, {{0, 1, 2}}};
    const MeshD mesh_d{{}, {{1, -1, -1}, {1, 1, -1}, {1, 0, 2}}, {{0, 1, 2}}};
    const Ray ray{{0, 0, 0}, 0, {1e-38f, 0, 0}};
    const RayD ray_d{{0, 0, 0}, 0, {1e-308, 0, 0}};
    const Bvh tree = build_bvh(mesh);
    const SceneD one_d(mesh_d);
    Scene one(mesh), two;
    two.add(mesh);
    two.add(mesh, {.mask = 2, .id = {}});
    two.commit();
    const test::FlushedDenormals flushed;
    for (const Scene* const scene : {&one, &two}) {
        EXPECT_TRUE(trace(*scene, {&ray, 1})[0].hit());
        EXPECT_TRUE(closest_hit(*scene, ray).hit());
        EXPECT_TRUE(any_hit(*scene, ray));
    }
    EXPECT_TRUE(trace(one_d, {&ray_d, 1})[0].hit());
    EXPECT_TRUE(closest_hit(one_d, ray_d).hit());
    EXPECT_TRUE(any_hit(one_d, ray_d));
    Scene placed;
    placed.add(one, Transform{});
    placed.commit();
    EXPECT_TRUE(closest_hit(placed, ray).hit());
    EXPECT_TRUE(sweep_sphere(tree, {ray, 0.1f}).hit());
    const WideBvh nothing(build_bvh(Mesh{}));
    std::vector<Hit> hits(1);
    EXPECT_EQ(trace(nothing, {&ray, 1}, hits).invalid_rays, 0u);
}
#endif

}  // namespace
}  // namespace raydix
