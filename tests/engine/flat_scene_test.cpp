// Scenes as one mesh, and their solids and pairs: against trees over a mesh that was made by
// another walk.
#include <gtest/gtest.h>
#include <raydix/error.h>
#include <raydix/scene_pairs.h>
#include <raydix/scene_queries.h>
#include <raydix/solid.h>
#include <raydix/user_geometry.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "engine/flat_scene.h"
#include "engine/flat_world.h"
#include "exec/parallel.h"
#include "support/message.h"
#include "support/sanitized.h"
#include "support/scenes.h"

namespace raydix::test {
namespace {

constexpr std::uint64_t flat_scene_seed = 20260301;
constexpr float nan_value = std::numeric_limits<float>::quiet_NaN();

Mesh box_mesh(Vec3 lo, Vec3 hi) {
    Mesh mesh;
    for (int k = 0; k < 8; ++k)
        mesh.vertices.push_back({k & 1 ? hi.x : lo.x, k & 2 ? hi.y : lo.y, k & 4 ? hi.z : lo.z});
    mesh.triangles = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                      {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
    return mesh;
}

Mesh part_of(const Mesh& mesh, std::size_t begin, std::size_t end) {
    Mesh out = mesh;
    out.triangles.assign(mesh.triangles.begin() + static_cast<std::ptrdiff_t>(begin),
                         mesh.triangles.begin() + static_cast<std::ptrdiff_t>(end));
    return out;
}

Transform moved_by(float x, float y, float z) {
    Transform t;
    t.m[0][3] = x, t.m[1][3] = y, t.m[2][3] = z;
    return t;
}

bool same_bits(Vec3 a, Vec3 b) {
    const auto bits = [](float x) { return std::bit_cast<std::uint32_t>(x); };
    return bits(a.x) == bits(b.x) && bits(a.y) == bits(b.y) && bits(a.z) == bits(b.z);
}

std::vector<Vec3> queries_around(RandomScenes& random, std::size_t count) {
    std::vector<Vec3> queries;
    for (std::size_t i = 0; i < count; ++i)
        queries.push_back(i % 3 == 0 ? random.in(-5, 5) : random.in(-1, 2));
    if (count > 2) queries[1].y = nan_value;
    return queries;
}

/// Closed boxes, turned and sheared, some within others, some mirrored.
std::shared_ptr<World> world_of_boxes(RandomScenes& random, std::uint32_t level) {
    auto world = std::make_shared<World>();
    const std::shared_ptr<World> inner = level == 0 ? nullptr : world_of_boxes(random, level - 1);
    for (std::uint32_t id = 0; id < 4; ++id) {
        World::Item item{2 * id, random.mask(), {}, {}, {}};
        const GeometryOptions options{item.mask, item.id};
        if (inner && id % 2 == 1) {
            item.inside = inner;
            item.transform = random.transform(1.5f, id == 1 ? 3.0f : 0.0f);
            world->scene.add(inner->scene, item.transform, options);
        } else {
            const Vec3 lo = random.in(-1, 0.5f), size = random.in(0.2f, 1.5f);
            item.mesh = box_mesh(lo, {lo.x + size.x, lo.y + size.y, lo.z + size.z});
            world->scene.add(item.mesh, options);
        }
        world->items.push_back(std::move(item));
    }
    world->scene.commit();
    return world;
}

template <class Body>
void for_random_worlds(const Body& body) {
    for (std::uint32_t levels = 0; levels < 4; ++levels)
        for (int k = 0; k < 6; k += sanitized ? 2 : 1) {
            RandomScenes random(flat_scene_seed + 100 * levels + static_cast<std::uint64_t>(k));
            SCOPED_TRACE(
                "levels " + std::to_string(levels) + ", seed " +
                std::to_string(flat_scene_seed + 100 * levels + static_cast<std::uint64_t>(k)));
            Recipe recipe{levels, 1 + random.below(5), k % 3 == 0 ? 100.0f : 0.0f};
            recipe.options.quality = k % 2 == 0 ? Quality::fast : Quality::balanced;
            recipe.options.usage = k % 4 < 2 ? Usage::fixed : Usage::moving;
            body(*random_world(random, recipe), random);
        }
}

TEST(FlatScene, IsWhatAnotherWalkMakes) {
    std::size_t triangles = 0, turned = 0;
    for_random_worlds([&](const World& world, RandomScenes&) {
        for (const std::uint32_t mask : {every_mask, 1u, 0u}) {
            const FlatWorld wanted = flat_of(world, mask);
            const FlatPlan<float> plan(world.scene, mask, "test");
            ASSERT_EQ(plan.counts().triangles, wanted.mesh.triangles.size());
            for (const int threads : {1, 3}) {
                FlatScene<float> flat;
                with_threads(threads, [&] { flat = plan.flatten(); });
                ASSERT_EQ(flat.mesh.triangles.size(), wanted.mesh.triangles.size());
                for (std::size_t i = 0; i < wanted.mesh.triangles.size(); ++i) {
                    for (std::size_t k = 0; k < 3; ++k)
                        ASSERT_TRUE(same_bits(flat.mesh.vertices[flat.mesh.triangles[i][k]],
                                              wanted.mesh.vertices[wanted.mesh.triangles[i][k]]));
                    ASSERT_EQ(flat.names.name(static_cast<std::uint32_t>(i)), wanted.names[i]);
                    turned += wanted.names[i].instance != 0;
                }
                triangles += wanted.mesh.triangles.size();
            }
        }
    });
    EXPECT_GT(triangles, 10000u);
    EXPECT_GT(turned, 5000u);
}

TEST(FlatScene, OneMeshIsNotCopied) {
    const Mesh mesh = random_soup(40, 1);
    Scene scene;
    scene.share(mesh, {.id = 4});
    scene.commit();
    const FlatPlan<float> plan(scene, every_mask, "test");
    const FlatScene<float> flat = plan.flatten();
    EXPECT_EQ(flat.mesh.vertices.data(), mesh.vertices.data());
    EXPECT_TRUE(flat.own.vertices.empty());
    EXPECT_LT(plan.bytes(), 200u);
    EXPECT_EQ(flat.names.name(39), (ScenePrimitive{0, 4, 39}));
}

TEST(SceneSolid, IsTheSolidOfTheFlatMesh) {
    std::size_t inside = 0, wound = 0;
    const auto compare = [&](const World& world, RandomScenes& random) {
        for (const std::uint32_t mask : {every_mask, 2u}) {
            const FlatWorld flat = flat_of(world, mask);
            const std::vector<Vec3> queries = queries_around(random, fewer(300, 3));
            const Bvh bvh = build_bvh(MeshView(flat.mesh), {.builder = Builder::binned});
            if (flat.mesh.triangles.empty()) continue;
            for (const InsideRule rule :
                 {InsideRule::automatic, InsideRule::crossings, InsideRule::parity}) {
                const Solid wanted(bvh, {.rule = rule});
                const Solid solid(world.scene, {.rule = rule, .mask = mask, .threads = 2});
                EXPECT_EQ(solid.closure(), wanted.closure());
                EXPECT_EQ(solid.rule(), wanted.rule());
                EXPECT_EQ(solid.open_edges(), wanted.open_edges());
                if (solid.rule() == InsideRule::winding) continue;  // a series, by the tree's nodes
                std::vector<std::uint8_t> a(queries.size(), 7), b(queries.size(), 7);
                const QueryCounts counts = contains(solid, queries, a);
                contains(wanted, queries, b);
                EXPECT_EQ(a, b);
                EXPECT_EQ(counts.invalid_queries, 1u);
                inside += counts.found;
                EXPECT_EQ(signed_distances(solid, queries), signed_distances(wanted, queries));
                const std::vector<double> numbers = winding_numbers(solid, queries),
                                          others = winding_numbers(wanted, queries);
                for (std::size_t i = 0; i < queries.size(); ++i) {
                    EXPECT_TRUE(numbers[i] == others[i] || (i == 1 && std::isnan(numbers[i])));
                    wound += std::fabs(numbers[i]) > 1;
                }
            }
        }
    };
    for (int k = 0; k < 8; ++k) {
        RandomScenes random(flat_scene_seed + static_cast<std::uint64_t>(k));
        compare(*world_of_boxes(random, static_cast<std::uint32_t>(k) % 4), random);
    }
    for_random_worlds(compare);
    EXPECT_GT(inside, fewer(1000, 10));
    EXPECT_GT(wound, fewer(100, 10));  // boxes within boxes, mirrored or not, add up
}

TEST(SceneSolid, ABodyMayBeSplitOverGeometriesAndInstances) {
    const Mesh box = box_mesh({0, 0, 0}, {1, 1, 1}), ball = ball_mesh({0.5f, 0.5f, 0.5f});
    const std::vector<Vec3> queries = {
        {0.5f, 0.5f, 0.5f}, {1.5f, 0.5f, 0.5f}, {1, 1, 1}, {0, 0.25f, 0.25f}, {0.1f, 0.9f, 0.9f}};
    for (const Mesh& whole : {box, ball}) {
        const Bvh bvh = build_bvh(whole);
        const Solid wanted(bvh);
        ASSERT_EQ(wanted.closure(), Closure::oriented);
        const std::size_t n = whole.triangles.size();
        // A third in the scene, a third in an instance, a third mirrored twice.
        Scene one, two, three, scene;
        one.add(part_of(whole, n / 3, n / 2));
        one.commit();
        Transform mirror;
        mirror.m[0][0] = -1;
        Mesh back = part_of(whole, n / 2, n);
        for (Vec3& v : back.vertices) v.x = -v.x;
        for (Triangle& t : back.triangles) std::swap(t[1], t[2]);
        two.add(back);
        two.commit();
        three.add(two, moved_by(0.25f, -1, 2));
        three.commit();
        Transform last = mirror;
        last.m[0][3] = 0.25f, last.m[1][3] = 1, last.m[2][3] = -2;
        scene.add(part_of(whole, 0, n / 3));
        scene.add(one, Transform{});
        scene.add(three, last);
        scene.commit();
        const Solid solid(scene);
        EXPECT_EQ(solid.closure(), Closure::oriented);
        EXPECT_EQ(solid.rule(), InsideRule::crossings);
        EXPECT_EQ(winding_numbers(solid, queries), winding_numbers(wanted, queries));
        EXPECT_EQ(signed_distances(solid, queries), signed_distances(wanted, queries));
        EXPECT_TRUE(contains(solid, Vec3{0.5f, 0.5f, 0.5f}));
        EXPECT_FALSE(contains(solid, Vec3{0.5f, 0.5f, 999}));
        // Without its first part it is open.
        scene.remove(0);
        EXPECT_EQ(Solid(scene).closure(), Closure::oriented) << "the last commit stands";
        scene.commit();
        const Solid open(scene);
        EXPECT_EQ(open.closure(), Closure::open);
        EXPECT_EQ(open.rule(), InsideRule::winding);
        EXPECT_GT(open.open_edges(), 0u);
        EXPECT_EQ(solid.closure(), Closure::oriented) << "a solid keeps what it was made of";
    }
}

TEST(SceneSolid, InstancesOfOneBodyAddUp) {
    Scene box, scene;
    box.add(box_mesh({0, 0, 0}, {2, 2, 2}));
    box.commit();
    Transform mirror;
    mirror.m[2][2] = -1;
    mirror.m[2][3] = 2;
    scene.add(box, moved_by(0, 0, 0));
    scene.add(box, moved_by(1, 0.25f, 0.25f));
    scene.add(box, mirror);  // the same place as the first, its outside outside
    scene.commit();
    const Solid solid(scene);
    EXPECT_EQ(solid.closure(), Closure::oriented);
    const std::vector<Vec3> queries = {
        {0.5f, 0.5f, 0.5f}, {1.5f, 0.5f, 0.5f}, {2.5f, 0.5f, 0.5f}, {9, 9, 9}};
    EXPECT_EQ(winding_numbers(solid, queries), (std::vector<double>{2, 3, 1, 0}));
}

TEST(SceneSolid, NothingAndWhatIsNotFinite) {
    Scene scene;
    EXPECT_THROW(Solid{scene}, InputError);
    scene.commit();
    const Solid empty(scene);
    EXPECT_FALSE(contains(empty, Vec3{0, 0, 0}));
    EXPECT_EQ(signed_distance(empty, Vec3{0, 0, 0}), infinity);
    Mesh mesh = box_mesh({0, 0, 0}, {1, 1, 1});
    scene.add(mesh);
    mesh.vertices[0].x = nan_value;
    Scene inner;
    inner.add(mesh);
    inner.add(Mesh());
    inner.commit();
    scene.add(inner, moved_by(5, 0, 0));
    scene.add(Scene(random_soup(3, 1)), moved_by(9, 9, 9), {.mask = 0});
    scene.commit();
    const Solid solid(scene);
    EXPECT_EQ(solid.closure(), Closure::open);
    EXPECT_EQ(solid.bvh().input_count(), 24u);
    EXPECT_TRUE(contains(solid, Vec3{0.5f, 0.5f, 0.5f}));
    EXPECT_FALSE(contains(solid, Vec3{nan_value, 0.5f, 0.5f}));
    EXPECT_EQ(signed_distance(solid, Vec3{nan_value, 0.5f, 0.5f}), infinity);
}

TEST(FlatScene, ClosestPointsOfTheSceneAreThoseOfTheMesh) {
    std::size_t turned = 0, found = 0;
    for_random_worlds([&](const World& world, RandomScenes& random) {
        const FlatWorld flat = flat_of(world);
        if (flat.mesh.triangles.empty()) return;
        const std::vector<Vec3> queries = queries_around(random, fewer(600, 3));
        const std::vector<ClosestPoint> wanted = closest_points(build_bvh(flat.mesh), queries);
        const std::vector<SceneClosestPoint> near = closest_points(world.scene, queries);
        for (std::size_t i = 0; i < queries.size(); ++i) {
            const ClosestPoint& w = wanted[i];
            ASSERT_EQ(near[i].distance, w.distance);
            ASSERT_EQ(near[i].found(), w.found());
            if (!w.found()) continue;
            ++found;
            ASSERT_TRUE(same_bits(near[i].position, w.position));
            ASSERT_EQ((ScenePrimitive{near[i].instance, near[i].geometry, near[i].prim}),
                      flat.names[w.prim]);
            // Weights of corners that changed places do so too.
            turned += near[i].u != w.u || near[i].v != w.v;
            ASSERT_TRUE((near[i].u == w.u && near[i].v == w.v) || near[i].instance != 0);
        }
    });
    EXPECT_GT(found, fewer(5000, 10));
    EXPECT_GT(turned, fewer(500, 10));
}

TEST(SceneSolid, AtTheEdgeOfTheRangeOfCoordinates) {
    constexpr float far = 5e11f, size = 1e11f;
    Scene inner(box_mesh({0, 0, 0}, {1, 1, 1})), scene;
    Transform t;
    for (std::size_t k = 0; k < 3; ++k) t.m[k][k] = k == 1 ? -size : size, t.m[k][3] = far;
    scene.add(inner, t);  // x and z from 5e11 to 6e11, y from 4e11 to 5e11
    scene.add(box_mesh({-far, -far, -far}, {far, far, far}));
    scene.commit();
    const Solid solid(scene);
    EXPECT_EQ(solid.closure(), Closure::oriented);
    const std::vector<Vec3> queries = {
        {5.5e11f, 4.5e11f, 5.5e11f}, {4.9e11f, 4.5e11f, 4.9e11f}, {5.5e11f, 5.5e11f, 5.5e11f}};
    EXPECT_EQ(winding_numbers(solid, queries), (std::vector<double>{1, 1, 0}));
    // They have the edge from (far, 4e11, far) to (far, far, far) in common, and no corner but one.
    EXPECT_FALSE(overlapping_pairs(scene, {.narrow = true}).pairs.empty());
}

using Pairs = std::vector<ScenePair>;

Pairs named(const std::vector<PrimitivePair>& pairs, const FlatWorld& a, const FlatWorld& b) {
    Pairs out;
    for (const PrimitivePair& pair : pairs)
        out.push_back({a.names[pair.first], b.names[pair.second]});
    return out;
}

TEST(ScenePairs, AreThoseOfTheFlatMesh) {
    std::size_t within = 0, between = 0;
    std::shared_ptr<World> before;
    for (std::uint32_t k = 0; k < fewer(20, 3); ++k) {
        RandomScenes random(flat_scene_seed + k);
        const auto world = k % 5 == 4 ? world_of_boxes(random, 2)
                                      : random_world(random, {k % 4, 2 + random.below(4), 0});
        for (const std::uint32_t mask : {every_mask, 4u}) {
            const FlatWorld flat = flat_of(*world, mask);
            const Bvh bvh = flat.mesh.triangles.empty() ? Bvh() : build_bvh(flat.mesh);
            for (const bool narrow : {false, true}) {
                const ScenePairOptions options{.narrow = narrow, .mask = mask, .threads = 2};
                const Pairs wanted = named(overlapping_pairs(bvh, {.narrow = narrow}), flat, flat);
                const ScenePairs all = overlapping_pairs(world->scene, options);
                const Pairs& found = all.pairs;
                EXPECT_EQ(all.first.triangles, flat.names.size());
                EXPECT_EQ(found, wanted) << "seed " << flat_scene_seed + k;
                EXPECT_TRUE(std::ranges::is_sorted(found));
                for (const ScenePair& pair : found) EXPECT_LT(pair.first, pair.second);
                EXPECT_EQ(count_overlapping_pairs(world->scene, options), wanted.size());
                within += found.size();
                if (before == nullptr) continue;
                const FlatWorld other = flat_of(*before, mask);
                const Bvh second = other.mesh.triangles.empty() ? Bvh() : build_bvh(other.mesh);
                const Pairs cross =
                    named(overlapping_pairs(bvh, second, {.narrow = narrow}), flat, other);
                EXPECT_EQ(overlapping_pairs(world->scene, before->scene, options).pairs, cross);
                EXPECT_EQ(count_overlapping_pairs(world->scene, before->scene, options),
                          cross.size());
                between += cross.size();
            }
        }
        before = world;
    }
    EXPECT_GT(within, fewer(5000, 5));
    EXPECT_GT(between, fewer(5000, 5));
}

TEST(ScenePairs, CornersAreSharedInTheWorld) {
    Scene one, scene;
    Mesh mesh;
    mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    mesh.triangles = {{0, 1, 2}};
    one.add(mesh);
    one.commit();
    scene.add(mesh);
    scene.add(one, moved_by(1, 0, 0));      // shares (1, 0, 0)
    scene.add(one, moved_by(0.25f, 0, 0));  // shares nothing with the first
    scene.commit();
    EXPECT_EQ(overlapping_pairs(scene, {.narrow = true}).pairs,
              (Pairs{{{0, 0, 0}, {2, 0, 0}}, {{1, 0, 0}, {2, 0, 0}}}));
    Scene empty;
    EXPECT_THROW(static_cast<void>(overlapping_pairs(empty)), InputError);
    empty.commit();
    EXPECT_EQ(overlapping_pairs(empty, scene).pairs.size(), 0u);
    EXPECT_EQ(overlapping_pairs(empty).pairs.size(), 0u);
}

TEST(SceneSolid, ShapesAreRefusedByName) {
    const std::vector<Sphere> spheres = {{{0, 0, 0}, 1}};
    const std::vector<Capsule> capsules = {{{0, 0, 0}, {1, 0, 0}, 1}};
    const std::vector<Aabb> boxes = {{{0, 0, 0}, {1, 1, 1}}};
    Scene inner, middle, scene;
    inner.add(random_soup(3, 1));
    inner.add(std::span<const Capsule>(capsules), {.id = 7});
    inner.commit();
    middle.add(random_soup(3, 1));
    middle.add(inner, {});
    middle.commit();
    scene.add(random_soup(3, 2));
    scene.add(middle, {});
    scene.commit();
    EXPECT_EQ(message_of([&] { Solid{scene}; }),
              "solid: geometry 7 (capsules) on path 2 of instances is no triangle mesh");
    EXPECT_EQ(
        message_of([&] { static_cast<void>(overlapping_pairs(scene)); }),
        "overlapping_pairs: geometry 7 (capsules) on path 2 of instances is no triangle mesh");
    scene.set_mask(1, 2);
    scene.add(std::span<const Sphere>(spheres), {.mask = 4});
    scene.add(UserGeometry(boxes, [](std::uint32_t, const Ray&, Hit&) { return false; }),
              {.mask = 8});
    scene.commit();
    EXPECT_EQ(message_of([&] { Solid(scene, {.mask = 4}); }),
              "solid: geometry 2 (spheres) is no triangle mesh");
    EXPECT_EQ(message_of([&] {
                  static_cast<void>(
                      count_overlapping_pairs(Scene(random_soup(1, 1)), scene, {.mask = 8}));
              }),
              "overlapping_pairs: geometry 3 (user geometry) is no triangle mesh");
    EXPECT_EQ(Solid(scene, {.mask = 1}).bvh().input_count(), 3u);
    // Geometry without primitives stands in nobody's way.
    scene.update(2, std::span<const Sphere>());
    scene.update(3, UserGeometry(std::vector<Aabb>(),
                                 [](std::uint32_t, const Ray&, Hit&) { return false; }));
    scene.commit();
    EXPECT_EQ(Solid(scene, {.mask = 13}).bvh().input_count(), 3u);
    EXPECT_EQ(count_overlapping_pairs(Scene(random_soup(1, 1)), scene, {.mask = 8}), 0u);
}

/// 2^levels copies of a mesh, by as few instances.
Scene doubled(const Mesh& mesh, std::uint32_t levels) {
    Scene scene(mesh);
    for (std::uint32_t level = 0; level < levels; ++level) {
        Scene outer;
        outer.add(scene, moved_by(0, 0, 0));
        outer.add(scene, moved_by(std::ldexp(1.0f, static_cast<int>(level)), 0, 0));
        outer.commit();
        scene = std::move(outer);
    }
    return scene;
}

TEST(SceneSolid, WhatDoesNotFitIsRefusedBeforeItIsMade) {
    const Mesh mesh = random_soup(fewer(1000, 5), 5);
    const Scene many = doubled(mesh, 24);  // 2^24 * 1000 triangles: some 3 TB
    for (const auto& call :
         {std::function<void()>([&] { Solid{many}; }),
          std::function<void()>([&] { static_cast<void>(overlapping_pairs(many)); }),
          std::function<void()>(
              [&] { static_cast<void>(count_overlapping_pairs(Scene(mesh), many)); })}) {
        const std::string message = message_of(call);
        EXPECT_NE(message.find("bytes"), std::string::npos) << message;
        EXPECT_NE(message.find("max_result_bytes"), std::string::npos) << message;
    }
    // More than trees can count, for whoever has the memory.
    constexpr std::uint64_t all = ~std::uint64_t{0};
    EXPECT_NE(message_of([&] { Solid(many, {.max_result_bytes = all}); }).find("too many for one"),
              std::string::npos);
    const Scene some = doubled(mesh, 4);
    EXPECT_THROW(Solid(some, {.max_result_bytes = 100'000}), ResultTooLarge);
    EXPECT_NO_THROW(Solid(some, {.max_result_bytes = 10'000'000}));
    EXPECT_THROW(static_cast<void>(overlapping_pairs(some, {.max_result_bytes = 100'000})),
                 ResultTooLarge);
    const std::uint64_t count = count_overlapping_pairs(some);
    EXPECT_EQ(overlapping_pairs(some, {.max_result_bytes = 20'000'000 + 64 * count}).pairs.size(),
              count);
}

TEST(SceneSolid, InDoubleNothingIsRounded) {
    Random random(flat_scene_seed);
    MeshD box;
    const Mesh in_floats = box_mesh({0, 0, 0}, {1, 1, 1});
    for (const Vec3 v : in_floats.vertices) box.vertices.push_back({v.x, v.y, v.z});
    box.triangles = in_floats.triangles;
    SceneD inner(box), scene;
    MeshD flat;
    for (std::uint32_t k = 0; k < 6; ++k) {
        TransformD t;
        for (auto& row : t.m)
            for (double& x : row) x = double{random.between(-1, 1)} / 3;
        t.m[0][3] += 5e6;
        const auto& m = t.m;
        const bool turned = m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) -
                                m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
                                m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]) <
                            0;
        scene.add(inner, t);
        const auto first = static_cast<std::uint32_t>(flat.vertices.size());
        for (const Vec3d v : box.vertices) {
            const auto row = [&](std::size_t r) {
                return ((v.x * m[r][0] + v.y * m[r][1]) + v.z * m[r][2]) + m[r][3];
            };
            flat.vertices.push_back({row(0), row(1), row(2)});
        }
        for (Triangle c : box.triangles) {
            if (turned) std::swap(c[1], c[2]);
            flat.triangles.push_back({c[0] + first, c[1] + first, c[2] + first});
        }
    }
    scene.commit();
    const BvhD bvh = build_bvh(flat, {.builder = Builder::karras});
    const SolidD solid(scene), wanted(bvh);
    EXPECT_EQ(solid.closure(), Closure::oriented);
    std::vector<Vec3d> queries;
    for (int i = 0; i < 400; ++i)
        queries.push_back({5e6 + double{random.between(-1, 1)}, double{random.between(-1, 1)},
                           double{random.between(-1, 1)}});
    EXPECT_EQ(winding_numbers(solid, queries), winding_numbers(wanted, queries));
    EXPECT_EQ(signed_distances(solid, queries), signed_distances(wanted, queries));
    const std::vector<PrimitivePair> pairs = overlapping_pairs(bvh, {.narrow = true});
    const Pairs found = overlapping_pairs(scene, {.narrow = true}).pairs;
    ASSERT_EQ(found.size(), pairs.size());
    EXPECT_FALSE(found.empty());
    for (std::size_t i = 0; i < found.size(); ++i) {
        EXPECT_EQ(found[i].first,
                  (ScenePrimitive{pairs[i].first / 12 + 1, 0, pairs[i].first % 12}));
        EXPECT_EQ(found[i].second,
                  (ScenePrimitive{pairs[i].second / 12 + 1, 0, pairs[i].second % 12}));
    }
}

TEST(SceneSolid, ATinyMirrorTurnsCornersToo) {
    const Mesh in_floats = box_mesh({0, 0, 0}, {1, 1, 1});
    MeshD box{"", {}, in_floats.triangles};
    for (const Vec3 v : in_floats.vertices) box.vertices.push_back({v.x, v.y, v.z});
    const SceneD inner(box);
    constexpr double size = 0x1p-400;  // whose third power is no double
    SceneD small, scene;
    for (const double side : {1.0, -1.0}) {
        TransformD t;
        t.m[0][0] = side * size, t.m[1][1] = t.m[2][2] = size;
        t.m[0][3] = side < 0 ? size : 0;
        small.add(inner, t);
    }
    small.commit();
    TransformD large;
    for (std::size_t k = 0; k < 3; ++k) large.m[k][k] = 1 / size;
    scene.add(small, large);
    scene.commit();
    const SolidD solid(scene);
    EXPECT_EQ(solid.closure(), Closure::oriented);
    const std::vector<Vec3d> queries = {{0.25, 0.375, 0.5}, {-1, 0.5, 0.5}};
    EXPECT_EQ(winding_numbers(solid, queries), (std::vector<double>{2, 0}));
}

}  // namespace
}  // namespace raydix::test
