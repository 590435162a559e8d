// Distance and overlap on scenes, against a look at every triangle as it is in the world.
#include <gtest/gtest.h>
#include <raydix/closest.h>
#include <raydix/error.h>
#include <raydix/overlap.h>
#include <raydix/scene_queries.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <thread>
#include <tuple>
#include <utility>
#include <vector>

#include "base/mirrors.h"
#include "engine/float_world.h"
#include "primitives/exact_overlap.h"
#include "proximity/sweep_walk.h"
#include "proximity/touch_walk.h"
#include "support/sanitized.h"
#include "support/support.h"

namespace raydix::test {
namespace {

/// A triangle in the world.
struct Flattened {
    LeafTriangle triangle;
    ScenePrimitive name;
    std::uint32_t masks[6];  // of all on the way
    std::size_t mask_count;
    bool turned;  // the way mirrors: the second and the third corner have changed places

    [[nodiscard]] bool seen_by(std::uint32_t mask) const {
        return std::all_of(masks, masks + mask_count,
                           [&](std::uint32_t m) { return (m & mask) != 0; });
    }
};

Vec3 in_world(Vec3 p, const std::vector<Affine>& maps) {
    Double3 at = Double3(p) + Double3(0, 0, 0);
    for (std::size_t k = maps.size(); k-- > 0;) at = maps[k].point(at);
    return without_negative_zero(at.rounded());
}

void flatten(const World& world, std::vector<Affine>& maps, std::vector<std::uint32_t>& masks,
             std::uint32_t number, std::vector<Flattened>& out) {
    std::uint32_t next = number + 1;
    for (const World::Item& item : world.items) {
        masks.push_back(item.mask);
        if (item.inside) {
            maps.push_back(affine_of(item.transform));
            flatten(*item.inside, maps, masks, next, out);
            maps.pop_back();
            next += 1 + static_cast<std::uint32_t>(item.inside->paths());
        }
        for (std::uint32_t prim = 0; prim < item.mesh.triangles.size(); ++prim) {
            const Triangle& t = item.mesh.triangles[prim];
            const auto corner = [&](std::size_t k) {
                return in_world(item.mesh.vertices[t[k]], maps);
            };
            bool turned = false;
            for (const Affine& map : maps) turned ^= mirrors(map.x, map.y, map.z);
            Flattened flat{{corner(0), corner(turned ? 2 : 1), corner(turned ? 1 : 2)},
                           {number, item.id, prim},
                           {},
                           0,
                           turned};
            for (const std::uint32_t mask : masks) flat.masks[flat.mask_count++] = mask;
            out.push_back(flat);
        }
        masks.pop_back();
    }
}

std::vector<Flattened> flatten(const World& world) {
    std::vector<Flattened> out;
    std::vector<Affine> maps;
    std::vector<std::uint32_t> masks;
    flatten(world, maps, masks, 0, out);
    return out;
}

std::vector<Flattened> seen_by(const std::vector<Flattened>& all, std::uint32_t mask) {
    std::vector<Flattened> seen;
    for (const Flattened& flat : all)
        if (flat.seen_by(mask)) seen.push_back(flat);
    return seen;
}

using Answer = std::tuple<float, float, float, float, ScenePrimitive, float, float>;
Answer answer_of(const SceneClosestPoint& p) {
    return {p.distance, p.position.x, p.position.y, p.position.z, {p.instance, p.geometry, p.prim},
            p.u,        p.v};
}

SceneClosestPoint brute_closest(const std::vector<Flattened>& seen, Vec3 q, float max_distance) {
    SceneClosestPoint best;
    if (!is_finite(q)) return best;
    float d2 = max_distance * max_distance;
    ScenePrimitive name{no_primitive, no_primitive, no_primitive};
    for (const Flattened& flat : seen) {
        const TrianglePoint p = closest_on_triangle(flat.triangle, q);
        if (!(p.d2 < d2 || (p.d2 == d2 && flat.name < name))) continue;
        d2 = p.d2, name = flat.name;
        best = {p.position, std::sqrt(p.d2), name.prim, name.geometry, name.instance, p.u, p.v};
        if (flat.turned) std::swap(best.u, best.v);
    }
    return best;
}

bool touches(const Flattened& flat, const Sphere& s) {
    return closest_on_triangle(flat.triangle, s.center).d2 <= s.radius * s.radius;
}
bool touches(const Flattened& flat, const Segment& s) {
    return segment_touches_triangle(s.a, s.b, flat.triangle);
}
template <class Query>
std::vector<ScenePrimitive> brute_touched(const std::vector<Flattened>& seen, const Query& query) {
    std::vector<ScenePrimitive> names;
    if (!is_valid(query)) return names;
    for (const Flattened& flat : seen)
        if (touches(flat, query)) names.push_back(flat.name);
    std::sort(names.begin(), names.end());
    return names;
}

using Contacted = std::tuple<float, ScenePrimitive, float, float, float, float, float>;
Contacted answer_of(const SceneSweepHit& h) {
    return {h.t, {h.instance, h.geometry, h.prim}, h.position.x, h.position.y, h.position.z, h.u,
            h.v};
}

SceneSweepHit with_own_corners(SceneSweepHit hit, const Flattened& flat) {
    if (flat.turned) std::swap(hit.u, hit.v);
    return hit;
}

SceneSweepHit brute_sweep(const std::vector<Flattened>& seen, const SphereSweep& sweep) {
    SceneSweepHit best;
    if (!is_valid(sweep)) return best;
    const RayFrame ray = make_frame(sweep.path);
    const Path path = path_of(sweep.path);
    const GrownBoxes boxes(path, sweep.radius);
    float least = sweep.radius == 0 ? ray.tmax : infinity;
    const Flattened* found = nullptr;
    TriangleHit of_ray{};
    for (const Flattened& flat : seen) {
        TriangleHit hit{};
        if (sweep.radius == 0) {
            if (!intersect_triangle<EdgeRule::closed>(ray, flat.triangle, ray.tmax, hit)) continue;
        } else {
            hit.t = first_contact(path, boxes, sweep.radius, flat.triangle);
            if (!(hit.t < infinity)) continue;
        }
        if (!(hit.t < least || (hit.t == least && (!found || flat.name < found->name)))) continue;
        least = hit.t, found = &flat, of_ray = hit;
    }
    if (!found) return best;
    best = {least, found->name.prim, found->name.geometry, found->name.instance, {}, 0, 0};
    if (sweep.radius == 0) {
        best.t = least * ray.t_scale + 0.0f;
        const Double3 a(found->triangle.v0), b(found->triangle.v1), c(found->triangle.v2);
        best.position = (a + (b - a) * of_ray.u + (c - a) * of_ray.v).rounded();
        best.u = of_ray.u, best.v = of_ray.v;
        return with_own_corners(best, *found);
    }
    const TrianglePoint at = closest_on_triangle(found->triangle, kept(path.at(least).rounded()));
    best.t = least + 0.0f;
    best.position = at.position, best.u = at.u, best.v = at.v;
    return with_own_corners(best, *found);
}

/// Where something is: on corners, edges and faces, beside them, far away, and nowhere.
std::vector<Vec3> random_queries(RandomScenes& random, const std::vector<Flattened>& all,
                                 std::size_t count) {
    std::vector<Vec3> queries;
    for (std::size_t i = 0; i < count; ++i) {
        const Vec3 near = random.in(-3, 3), far = random.in(-1e4f, 1e4f);
        Vec3 q = i % 7 == 0 ? far : near;
        if (!all.empty() && i % 3 == 0) {
            const LeafTriangle& t =
                all[random.below(static_cast<std::uint32_t>(all.size()))].triangle;
            q = i % 2 == 0 ? t.v1 : 0.5f * t.v0 + 0.5f * t.v1;
            if (i % 9 == 0) q = 0.25f * t.v0 + 0.25f * t.v1 + 0.5f * t.v2;
        }
        if (i % 61 == 0) q.y = std::numeric_limits<float>::quiet_NaN();
        if (i % 67 == 0) q = {1e30f, -1e25f, 3e38f};
        if (i % 71 == 0) q.z = infinity;
        queries.push_back(q);
    }
    return queries;
}

std::size_t wrong_points(const World& world, const std::vector<Flattened>& all,
                         const std::vector<Vec3>& queries) {
    std::size_t wrong = 0;
    for (const auto& [mask, most] : {std::pair{every_mask, infinity}, std::pair{2u, infinity},
                                     std::pair{every_mask, 0.25f}, std::pair{5u, 0.0f}}) {
        const std::vector<Flattened> seen = seen_by(all, mask);
        std::vector<SceneClosestPoint> expected;
        for (const Vec3 q : queries) expected.push_back(brute_closest(seen, q, most));
        for (const std::string& isa : simd_instruction_sets())
            for (const int threads : {1, 2}) {
                const auto found = closest_points(
                    world.scene, queries,
                    {.max_distance = most, .mask = mask, .threads = threads, .isa = isa});
                for (std::size_t i = 0; i < queries.size(); ++i)
                    wrong += answer_of(found[i]) != answer_of(expected[i]);
            }
        for (std::size_t i = 0; i < queries.size(); i += 5)
            wrong += answer_of(closest_point(world.scene, queries[i], most, mask)) !=
                     answer_of(expected[i]);
    }
    return wrong;
}

template <class Query>
std::size_t wrong_touches(const World& world, const std::vector<Flattened>& all,
                          const std::vector<Query>& queries, std::size_t& touched_count) {
    std::size_t wrong = 0;
    for (const std::uint32_t mask : {every_mask, 2u}) {
        const std::vector<Flattened> seen = seen_by(all, mask);
        for (const std::string& isa : simd_instruction_sets()) {
            const SceneOverlapOptions options{.mask = mask, .threads = 2, .isa = isa};
            std::vector<std::uint8_t> touched(queries.size(), 7);
            touch_any(world.scene, std::span<const Query>(queries), touched, options);
            const SceneOverlapLists lists =
                touch_all(world.scene, std::span<const Query>(queries), options);
            for (std::size_t i = 0; i < queries.size(); ++i) {
                const auto expected = brute_touched(seen, queries[i]);
                const std::vector<ScenePrimitive> found(
                    lists.prims.begin() + static_cast<std::ptrdiff_t>(lists.offsets[i]),
                    lists.prims.begin() + static_cast<std::ptrdiff_t>(lists.offsets[i + 1]));
                wrong += found != expected;
                wrong += touched[i] != (expected.empty() ? 0 : 1);
                touched_count += expected.size();
                if (i % 8 == 0)
                    wrong += raydix::touches(world.scene, queries[i], mask) != !expected.empty();
            }
        }
    }
    return wrong;
}

std::size_t wrong_sweeps(const World& world, const std::vector<Flattened>& all,
                         const std::vector<SphereSweep>& sweeps, std::size_t& hit_count) {
    std::size_t wrong = 0;
    for (const std::uint32_t mask : {every_mask, 2u}) {
        const std::vector<Flattened> seen = seen_by(all, mask);
        std::vector<SceneSweepHit> expected;
        for (const SphereSweep& sweep : sweeps) expected.push_back(brute_sweep(seen, sweep));
        for (const std::string& isa : simd_instruction_sets()) {
            const auto hits =
                sweep_spheres(world.scene, sweeps, {.mask = mask, .threads = 2, .isa = isa});
            for (std::size_t i = 0; i < sweeps.size(); ++i) {
                wrong += answer_of(hits[i]) != answer_of(expected[i]);
                hit_count += hits[i].hit();
            }
        }
        for (std::size_t i = 0; i < sweeps.size(); i += 7)
            wrong +=
                answer_of(sweep_sphere(world.scene, sweeps[i], mask)) != answer_of(expected[i]);
    }
    return wrong;
}

/// One world of `recipe`, asked everything.
void expect_no_differences(const World& world, RandomScenes& random, std::size_t& touched,
                           std::size_t& swept) {
    const std::vector<Flattened> all = flatten(world);
    const std::vector<Vec3> queries = random_queries(random, all, test::fewer(200, 4));
    EXPECT_EQ(wrong_points(world, all, queries), 0u);
    std::vector<Sphere> spheres;
    std::vector<Segment> segments;
    std::vector<SphereSweep> sweeps;
    for (std::size_t i = 0; i + 1 < queries.size(); ++i) {
        const Vec3 a = queries[i], b = queries[i + 1];
        spheres.push_back({a, i % 4 == 0 ? 0.0f : random.between(0, 0.6f)});
        segments.push_back({a, i % 5 == 0 ? a : b});
        sweeps.push_back({{a, i % 6 == 0 ? 0.25f : 0.0f, b - a}, 0.0f});
        if (i % 3 != 0) sweeps.back().radius = random.between(0.01f, 0.5f);
        if (i % 4 == 0) sweeps.back().path.tmax = 1.0f;
        if (i % 11 == 0) sweeps.back().path.direction = 100.0f * sweeps.back().path.direction;
    }
    spheres.push_back({{0, 0, 0}, -1});
    EXPECT_EQ(wrong_touches(world, all, spheres, touched), 0u);
    EXPECT_EQ(wrong_touches(world, all, segments, touched), 0u);
    EXPECT_EQ(wrong_sweeps(world, all, sweeps, swept), 0u);
}

TEST(Near, WorldsAnswerAsTheirTrianglesDo) {
    std::size_t touched = 0, swept = 0;
    for (std::uint32_t levels = 0; levels < 4; ++levels)
        for (int k = 0; k < static_cast<int>(1 + thorough / 3); ++k) {
            SCOPED_TRACE("levels " + std::to_string(levels) + ", world " + std::to_string(k));
            RandomScenes random(9000 + 100 * levels + static_cast<std::uint64_t>(k));
            Recipe recipe{levels, 1 + random.below(levels == 3 ? 4 : 6),
                          k % 3 == 0   ? 0.0f
                          : k % 3 == 1 ? 100.0f
                                       : 1e4f};
            recipe.flats = k % 4 != 3;
            recipe.options.usage = k % 2 == 0 ? Usage::fixed : Usage::moving;
            recipe.options.compact = k % 5 == 1;
            recipe.options.quality = k % 4 == 2 ? Quality::high : Quality::balanced;
            const auto world = random_world(random, recipe);
            expect_no_differences(*world, random, touched, swept);
        }
    EXPECT_GT(touched, test::fewer(1000, 4));
    EXPECT_GT(swept, test::fewer(500, 4));
}

/// A world of one mesh.
World world_of(const Mesh& mesh, const SceneOptions& options = {}) {
    World world;
    world.scene.add(mesh);
    world.items.push_back({0, every_mask, mesh, {}, {}});
    world.scene.commit(options);
    return world;
}

TEST(Near, OneMeshAnswersAsItsBinaryTreeDoes) {
    RandomScenes random(77);
    Mesh mesh = random_soup(6000, 5, 0.05f);
    add_flats(random, mesh);
    for (const Quality quality : {Quality::fast, Quality::balanced, Quality::high})
        for (const bool compact : {false, true}) {
            const World world = world_of(mesh, {.quality = quality, .compact = compact});
            const Bvh bvh = build_bvh(mesh);
            std::vector<Vec3> queries;
            for (int i = 0; i < 5000; ++i) queries.push_back(random.in(-0.5f, 1.5f));
            const auto expected = closest_points(bvh, queries);
            const auto found = closest_points(world.scene, queries);
            std::size_t wrong = 0;
            for (std::size_t i = 0; i < queries.size(); ++i)
                wrong += found[i].prim != expected[i].prim ||
                         found[i].distance != expected[i].distance ||
                         !(found[i].position == expected[i].position) ||
                         found[i].u != expected[i].u || found[i].v != expected[i].v ||
                         found[i].geometry != 0 || found[i].instance != 0;
            EXPECT_EQ(wrong, 0u);
        }
}

TEST(Near, TrianglesWithoutAreaAreFoundWhereThereIsNothingElse) {
    Mesh mesh;
    mesh.vertices = {{0, 0, 0}, {2, 0, 0}, {1, 0, 0}, {5, 5, 5}};
    mesh.triangles = {{0, 1, 2}, {3, 3, 3}};
    World world = world_of(mesh);
    const SceneClosestPoint on_segment = closest_point(world.scene, {1.5f, 1, 0});
    EXPECT_EQ(on_segment.prim, 0u);
    EXPECT_EQ(on_segment.distance, 1.0f);
    EXPECT_EQ(on_segment.position.x, 1.5f);
    EXPECT_EQ(closest_point(world.scene, {5, 5, 6}).prim, 1u);
    EXPECT_FALSE(closest_hit(world.scene, {{1.5f, 1, 0}, 0, {0, -1, 0}}).hit());
    EXPECT_TRUE(touches(world.scene, Segment{{1, 1, 0}, {1, -1, 0}}));
    EXPECT_TRUE(touches(world.scene, Sphere{{5, 5, 6}, 1}));
    EXPECT_TRUE(sweep_sphere(world.scene, {{{5, 5, 9}, 0, {0, 0, -1}}, 1}).hit());

    // In instances of instances, which rays need not enter at all.
    Scene inner, outer;
    inner.add(world.scene, moved(10, 0, 0));
    inner.commit();
    outer.add(inner, moved(0, 10, 0));
    outer.commit();
    const SceneClosestPoint found = closest_point(outer, {11.5f, 11, 0});
    EXPECT_EQ(found.prim, 0u);
    EXPECT_EQ(found.instance, 2u);
    EXPECT_EQ(found.position.x, 11.5f);
    EXPECT_EQ(found.position.y, 10.0f);
}

TEST(Near, PointsCloserTogetherThanBuildersCountAreFound) {
    for (const float apart : {0.5f, 1e-13f, 1e-30f, 0x1p-140f}) {
        Mesh mesh;
        mesh.vertices = {{0, 0, 0}, {0, 0, apart}};
        mesh.triangles = {{0, 0, 0}, {1, 1, 1}};
        Scene inner(mesh), scene;
        Transform up;
        up.m[1][3] = 2;
        scene.add(inner, up);
        scene.add(mesh);
        scene.commit();
        EXPECT_EQ(closest_point(scene, {0, 3, 0}).instance, 1u) << apart;
        EXPECT_EQ(closest_point(scene, {0, -3, 0}).geometry, 1u) << apart;
        const std::vector<Segment> through{{{0, -1, 0}, {0, 3, 0}}};
        EXPECT_GE(touch_all(scene, through).prims.size(), 2u) << apart;
    }
}

TEST(Near, EqualDistancesGoToTheLeastName) {
    // Fans around one corner, in several meshes and instances at the same place.
    Mesh fan;
    fan.vertices.push_back({0, 0, 0});
    for (int k = 0; k < 12; ++k)
        fan.vertices.push_back(
            {std::cos(0.5f * static_cast<float>(k)), std::sin(0.5f * static_cast<float>(k)), -1});
    for (std::uint32_t k = 1; k < 12; ++k) fan.triangles.push_back({0, k, k + 1});
    Scene inner, scene;
    inner.add(fan);
    inner.add(fan, {.mask = 2});
    inner.commit();
    scene.add(inner, moved(0, 0, 0));
    scene.add(fan, {.mask = 1, .id = 4});
    scene.add(inner, moved(0, 0, 0));
    scene.add(fan, {.mask = 2, .id = 9});
    scene.commit({.usage = Usage::moving});
    const auto name = [](const SceneClosestPoint& p) {
        return ScenePrimitive{p.instance, p.geometry, p.prim};
    };
    const Vec3 above{0, 0, 1};
    EXPECT_EQ(name(closest_point(scene, above)), (ScenePrimitive{0, 4, 0}));
    EXPECT_EQ(name(closest_point(scene, above, infinity, 2)), (ScenePrimitive{0, 9, 0}));
    EXPECT_EQ(name(closest_point(scene, above, infinity, 4)), (ScenePrimitive{1, 0, 0}));
    EXPECT_EQ(name(closest_point(scene, above, 1.0f)), (ScenePrimitive{0, 4, 0}));
    EXPECT_FALSE(closest_point(scene, above, std::nextafter(1.0f, 0.0f)).found());
    const SceneSweepHit hit = sweep_sphere(scene, {{{0, 0, 9}, 0, {0, 0, -1}}, 1});
    EXPECT_EQ((ScenePrimitive{hit.instance, hit.geometry, hit.prim}), (ScenePrimitive{0, 4, 0}));
    const std::vector<Sphere> at_corner{{{0, 0, 0}, 0}};
    EXPECT_EQ(touch_all(scene, std::span<const Sphere>(at_corner)).prims.size(), 6u * 11u);
}

TEST(Near, EmptyScenesHaveNoPoints) {
    Scene scene;
    EXPECT_THROW(static_cast<void>(closest_point(scene, {0, 0, 0})), InputError);
    EXPECT_THROW(static_cast<void>(touches(scene, Sphere{{0, 0, 0}, 1})), InputError);
    scene.commit();
    EXPECT_FALSE(closest_point(scene, {0, 0, 0}).found());
    EXPECT_FALSE(touches(scene, Sphere{{0, 0, 0}, 1}));
    EXPECT_FALSE(touches(scene, Segment{{0, 0, 0}, {1, 1, 1}}));
    EXPECT_FALSE(sweep_sphere(scene, {{{0, 0, 0}, 0, {0, 0, 1}}, 1}).hit());
    Scene outer;
    outer.add(scene, moved(1, 0, 0));
    outer.commit();
    EXPECT_FALSE(closest_point(outer, {0, 0, 0}).found());
    const std::vector<Vec3> queries(3000, Vec3{1, 2, 3});
    EXPECT_EQ(closest_points(outer, queries).size(), queries.size());
    EXPECT_TRUE(closest_points(outer, std::vector<Vec3>{}).empty());
}

TEST(Near, CountsAndLimitsAreChecked) {
    const World world = world_of(random_soup(100, 3));
    const float nan = std::numeric_limits<float>::quiet_NaN();
    const std::vector<Vec3> queries{{0, 0, 0}, {nan, 0, 0}, {0, infinity, 0}, {1, 1, 1}};
    std::vector<SceneClosestPoint> found(4);
    const QueryCounts counts = closest_points(world.scene, queries, found);
    EXPECT_EQ(counts.queries, 4u);
    EXPECT_EQ(counts.invalid_queries, 2u);
    EXPECT_EQ(counts.found, 2u);
    EXPECT_FALSE(found[1].found());
    EXPECT_FALSE(closest_point(world.scene, {nan, 0, 0}).found());
    found.pop_back();
    EXPECT_THROW(closest_points(world.scene, queries, found), InputError);
    EXPECT_THROW(static_cast<void>(closest_point(world.scene, {}, -1)), InputError);
    EXPECT_THROW(static_cast<void>(closest_point(world.scene, {}, nan)), InputError);
    EXPECT_THROW(static_cast<void>(closest_points(world.scene, queries, {.isa = "none"})),
                 InputError);
    const std::vector<Sphere> spheres(1000, Sphere{{0.5f, 0.5f, 0.5f}, 2});
    EXPECT_THROW(static_cast<void>(touch_all(world.scene, std::span<const Sphere>(spheres),
                                             {.max_result_bytes = 100000})),
                 ResultTooLarge);
}

TEST(Near, TreesFollowUpdates) {
    RandomScenes random(31);
    Mesh mesh = random_soup(test::fewer(500, 2), 8, 0.3f);
    World world;
    world.scene.add(mesh);
    world.items.push_back({0, every_mask, mesh, {}, {}});
    for (int round = 0; round < 4; ++round) {
        if (round == 2) add_flats(random, mesh);
        for (Vec3& v : mesh.vertices) v = v + random.in(-0.02f, 0.02f);
        world.items[0].mesh = mesh;
        world.scene.update(0, mesh);
        world.scene.commit({.usage = Usage::moving});
        std::size_t touched = 0, swept = 0;
        expect_no_differences(world, random, touched, swept);
        EXPECT_GT(touched, 0u);
    }
}

TEST(Near, ThreadsMayAskFirstTogether) {
    RandomScenes random(5);
    const auto world = random_world(random, {.levels = 2, .items = 5, .shear = 0, .flats = true});
    const std::vector<Flattened> all = flatten(*world);
    const std::vector<Vec3> queries = random_queries(random, all, 50);
    std::vector<std::size_t> wrong(4);
    std::vector<std::thread> threads;
    for (std::size_t t = 0; t < wrong.size(); ++t)
        threads.emplace_back([&, t] {
            for (const Vec3 q : queries)
                wrong[t] += answer_of(closest_point(world->scene, q)) !=
                            answer_of(brute_closest(all, q, infinity));
        });
    for (std::thread& thread : threads) thread.join();
    EXPECT_EQ(wrong, std::vector<std::size_t>(4, 0));
}

}  // namespace
}  // namespace raydix::test
