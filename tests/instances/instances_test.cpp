// Instances against every instance on its own, and against the mesh that they stand for.
#include <gtest/gtest.h>
#include <raydix/error.h>
#include <raydix/instances.h>
#include <raydix/trace.h>

#include <cmath>
#include <functional>
#include <iostream>
#include <limits>
#include <random>

#include "instances/affine.h"
#include "support/message.h"
#include "support/random.h"
#include "support/scenes.h"
#include "support/support.h"

namespace raydix {
namespace {

constexpr std::uint64_t seed = 20140704;
constexpr float nan = std::numeric_limits<float>::quiet_NaN();

class Random : public test::Random {
public:
    using test::Random::Random;
    /// Turned, stretched, sheared, moved; every other one mirrored.
    Transform transform(float reach) {
        Transform t;
        for (auto& row : t.m) {
            for (std::size_t k = 0; k < 3; ++k) row[k] = between(-1, 1);
            row[3] = between(-reach, reach);
        }
        return inverse_of(affine_of(t)) ? t : transform(reach);
    }
};

std::vector<Ray> random_rays(std::size_t count, float reach) {
    Random random(seed);
    std::vector<Ray> rays;
    for (std::size_t i = 0; i < count; ++i) {
        const Vec3 from = random.in(-2 * reach, 2 * reach);
        Ray ray{from, 0, random.in(-reach, reach) - from};
        if (i % 5 == 0) ray.tmax = random.between(0.2f, 1.0f);
        if (i % 7 == 0) ray.tmin = random.between(0.0f, 0.5f);
        rays.push_back(ray);
    }
    return rays;
}

/// A scene as a list, for a judge that looks at everything.
struct Shown {
    const Bvh* bvh;
    std::uint32_t object;
    std::vector<Affine> inverses;  // from the scene inward
    std::vector<std::uint32_t> masks;
    std::array<std::uint32_t, InstanceHit::max_levels> path;
};

InstanceHit look_at_all(const std::vector<Shown>& all, const Ray& ray, std::uint32_t mask) {
    InstanceHit best;
    for (const Shown& shown : all) {
        bool seen = true;
        WideRayLine line{Double3(ray.origin), Double3(ray.direction)};
        for (std::size_t k = 0; k < shown.inverses.size(); ++k) {
            seen = seen && (shown.masks[k] & mask) != 0;
            line = line.into(shown.inverses[k]);
        }
        if (!seen) continue;
        const Hit hit = closest_hit(*shown.bvh, line.rounded(ray.tmin, ray.tmax));
        if (!hit.hit()) continue;
        if (hit.t < best.hit.t || (hit.t == best.hit.t && shown.path < best.path))
            best = {hit, shown.object, shown.path};
    }
    return best;
}

bool same(const InstanceHit& a, const InstanceHit& b) {
    return a.hit.t == b.hit.t && a.hit.prim == b.hit.prim && a.hit.u == b.hit.u &&
           a.hit.v == b.hit.v && a.path == b.path && a.object == b.object;
}

TEST(Instances, AreEveryInstanceOnItsOwn) {
    Random random(seed);
    const Bvh soup = build_bvh(test::random_soup(300, seed)),
              ball = build_bvh(test::scaled(test::ball_mesh({0, 0, 0}), 0.01f)), empty;
    InstancedScene scene;
    const std::uint32_t objects[] = {scene.add_object(soup), scene.add_object(ball),
                                     scene.add_object(empty)};
    const std::uint32_t inner = scene.add_group(), middle = scene.add_group();
    std::vector<Instance> in_inner, in_middle, in_scene;
    for (int i = 0; i < 5; ++i)
        in_inner.push_back({objects[i % 3], random.transform(3), 1u << (i % 4)});
    for (int i = 0; i < 4; ++i)
        in_middle.push_back({i % 2 ? inner : objects[1], random.transform(5), i == 3 ? 6u : ~0u});
    for (int i = 0; i < 60; ++i)
        in_scene.push_back({i % 6 == 0   ? middle
                            : i % 6 == 1 ? inner
                                         : objects[random.below(3)],
                            random.transform(5), i % 9 ? ~0u : 2u});
    for (const Instance& i : in_inner) scene.add_instance(inner, i);
    for (const Instance& i : in_middle) scene.add_instance(middle, i);
    for (const Instance& i : in_scene) scene.add_instance(InstancedScene::scene, i);
    scene.build();

    std::vector<Shown> all;
    const std::function<void(const std::vector<Instance>&, Shown)> show =
        [&](const std::vector<Instance>& group, const Shown& so_far) {
            for (std::uint32_t i = 0; i < group.size(); ++i) {
                Shown next = so_far;
                next.path[so_far.inverses.size()] = i;
                next.inverses.push_back(*inverse_of(affine_of(group[i].transform)));
                next.masks.push_back(group[i].mask);
                if (group[i].object == inner)
                    show(in_inner, next);
                else if (group[i].object == middle)
                    show(in_middle, next);
                else {
                    next.object = group[i].object;
                    next.bvh = next.object == objects[0]   ? &soup
                               : next.object == objects[1] ? &ball
                                                           : &empty;
                    all.push_back(next);
                }
            }
        };
    show(in_scene, {nullptr, 0, {}, {}, InstanceHit::unused()});
    ASSERT_GT(all.size(), 100u);

    const std::vector<Ray> rays = random_rays(100 * test::thorough, 5);
    std::vector<std::uint32_t> masks;
    for (std::size_t i = 0; i < rays.size(); ++i)
        masks.push_back(i % 3 == 0 ? ~0u : 1u << random.below(4));
    std::vector<InstanceHit> expected;
    std::size_t hits = 0, nested = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
        expected.push_back(look_at_all(all, rays[i], masks[i]));
        hits += expected[i].hit.hit();
        nested += expected[i].path[2] != no_primitive;
    }
    std::cout << rays.size() << " rays through " << all.size() << " instances, " << hits
              << " hits, " << nested << " on the third level\n";
    EXPECT_GT(hits, rays.size() / 10);
    EXPECT_GT(nested, hits / 100);
    for (const int threads : {1, 2, 7}) {
        const std::vector<InstanceHit> found =
            trace(scene, rays, {.masks = masks, .threads = threads});
        std::vector<std::uint8_t> occluded(rays.size());
        trace_any(scene, rays, occluded, {.masks = masks, .threads = threads});
        std::size_t wrong = 0, wrong_any = 0;
        for (std::size_t i = 0; i < rays.size(); ++i) {
            wrong += !same(found[i], expected[i]);
            wrong_any += (occluded[i] != 0) != expected[i].hit.hit();
        }
        EXPECT_EQ(wrong, 0u);
        EXPECT_EQ(wrong_any, 0u);
    }
    EXPECT_TRUE(same(closest_hit(scene, rays[1], masks[1]), expected[1]));
}

TEST(Instances, StandForTheMeshTheyMake) {
    // Whole-number moves and mirrors are exact, so hits are those of one big mesh.
    const Mesh ball = test::ball_mesh({0, 0, 0});
    const Bvh bvh = build_bvh(ball);
    Mesh flat;
    InstancedScene scene;
    const std::uint32_t object = scene.add_object(bvh);
    for (int i = 0; i < 27; ++i) {
        const Vec3 by{float(i % 3) * 256, float(i / 3 % 3) * 256, float(i / 9) * 256};
        const float mirror = i % 2 ? -1.0f : 1.0f;
        scene.add_instance(InstancedScene::scene,
                           {object, {{{{mirror, 0, 0, by.x}, {0, 1, 0, by.y}, {0, 0, 1, by.z}}}}});
        const auto first = static_cast<std::uint32_t>(flat.vertices.size());
        for (const Vec3 p : ball.vertices)
            flat.vertices.push_back(Vec3{mirror * p.x, p.y, p.z} + by);
        for (const Triangle& t : ball.triangles)
            flat.triangles.push_back({first + t[0], first + t[1], first + t[2]});
    }
    scene.build();
    const Bvh whole = build_bvh(flat);
    std::size_t hits = 0;
    for (const Ray& ray : random_rays(200 * test::thorough, 400)) {
        const Hit expected = closest_hit(whole, ray);
        const InstanceHit found = closest_hit(scene, ray);
        ASSERT_EQ(found.hit.hit(), expected.hit());
        if (!expected.hit()) continue;
        ++hits;
        EXPECT_NEAR(found.hit.t, expected.t, 1e-4f * expected.t);
    }
    EXPECT_GT(hits, 20u);
}

TEST(Instances, MoveAndAreBuiltAgain) {
    const Bvh ball = build_bvh(test::ball_mesh({0, 0, 0}));
    InstancedScene scene;
    const std::uint32_t object = scene.add_object(ball);
    scene.add_instance(InstancedScene::scene, {object});
    const Ray ray{{0, 0, 1000}, 0, {0, 0, -1}};
    EXPECT_THROW(static_cast<void>(closest_hit(scene, ray)), InputError) << "not built";
    scene.build();
    EXPECT_NEAR(closest_hit(scene, ray).hit.t, 900, 1);
    scene.set_instance(InstancedScene::scene, 0,
                       {object, {{{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 500}}}}});
    EXPECT_THROW(static_cast<void>(closest_hit(scene, ray)), InputError)
        << "changed after the build";
    scene.build();
    EXPECT_NEAR(closest_hit(scene, ray).hit.t, 400, 1);
    EXPECT_EQ(scene.instance(InstancedScene::scene, 0).transform.m[2][3], 500.0f);
    EXPECT_EQ(scene.instance_count(), 1u);
}

using test::message_of;

TEST(Instances, RefuseWhatCannotBe) {
    const Bvh ball = build_bvh(test::ball_mesh({0, 0, 0}));
    InstancedScene scene;
    const std::uint32_t object = scene.add_object(ball), group = scene.add_group();
    scene.add_instance(InstancedScene::scene, {object});
    const auto with = [&](std::array<std::array<float, 4>, 3> m) {
        return message_of([&] { scene.add_instance(InstancedScene::scene, {object, {m}}); });
    };
    const std::string singular =
        "instance 1: its transform is singular or not finite, so rays cannot go through it";
    EXPECT_EQ(with({{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 0, 0}}}), singular);
    EXPECT_EQ(with({{{1, 2, 3, 0}, {2, 4, 6, 0}, {0, 0, 1, 0}}}), singular);
    EXPECT_EQ(with({{{0.1f, 0.2f, 0.3f, 0}, {0.2f, 0.4f, 0.6f, 0}, {0, 0, 1, 0}}}), singular);
    EXPECT_EQ(with({{{nan, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}}), singular);
    EXPECT_EQ(with({{{1, 0, 0, infinity}, {0, 1, 0, 0}, {0, 0, 1, 0}}}), singular);
    EXPECT_EQ(message_of([&] { scene.add_instance(group, {77}); }),
              "instance 0 of group 2: there is no object 77");
    EXPECT_EQ(message_of([&] { scene.add_instance(object, {object}); }), "object 1 is no group");
    EXPECT_EQ(message_of([&] { scene.set_instance(group, 3, {object}); }),
              "there is no instance 3 of group 2");
    EXPECT_EQ(scene.instance_count(), 1u);
    // Tiny, but not flat.
    EXPECT_EQ(with({{{1e-6f, 0, 0, 0}, {0, 1e-6f, 0, 0}, {0, 0, -1e-6f, 0}}}), "no error");
    scene.build();
    // Out of range when placed.
    EXPECT_EQ(with({{{1, 0, 0, 1e13f}, {0, 1, 0, 0}, {0, 0, 1, 0}}}), "no error");
    EXPECT_EQ(message_of([&] { scene.build(); }),
              "instance 2: it reaches beyond 1e12, or is not finite");
    const std::vector<Vec3> points{{0, 0, 0}};
    const Bvh of_points = build_bvh(points);
    EXPECT_THROW(scene.add_object(of_points), InputError);
}

TEST(Instances, CirclesAndDeepNestsAreErrors) {
    const Bvh ball = build_bvh(test::ball_mesh({0, 0, 0}));
    InstancedScene scene;
    const std::uint32_t object = scene.add_object(ball), a = scene.add_group(),
                        b = scene.add_group();
    scene.add_instance(InstancedScene::scene, {a});
    scene.add_instance(a, {b});
    scene.add_instance(b, {a});
    EXPECT_EQ(message_of([&] { scene.build(); }),
              "group 2 shows itself, directly or through others");
    scene.set_instance(b, 0, {b});
    EXPECT_EQ(message_of([&] { scene.build(); }),
              "group 3 shows itself, directly or through others");
    scene.set_instance(b, 0, {InstancedScene::scene});
    EXPECT_NE(message_of([&] { scene.build(); }), "no error");
    scene.set_instance(b, 0, {object});
    scene.build();
    const Ray ray{{0, 0, 1000}, 0, {0, 0, -1}};
    EXPECT_EQ(closest_hit(scene, ray).path[2], 0u);

    for (const std::size_t levels :
         {InstanceHit::max_levels, InstanceHit::max_levels + 1, std::size_t{5000}}) {
        InstancedScene deep;
        const std::uint32_t leaf = deep.add_object(ball);
        std::uint32_t last = InstancedScene::scene;
        for (std::size_t k = 1; k < levels; ++k) {
            const std::uint32_t next = deep.add_group();
            deep.add_instance(last, {next});
            last = next;
        }
        deep.add_instance(last, {leaf});
        if (levels > InstanceHit::max_levels) {
            EXPECT_THROW(deep.build(), InputError);
        } else {
            deep.build();
            EXPECT_TRUE(closest_hit(deep, ray).hit.hit());
        }
    }
}

TEST(Instances, NothingIsMissed) {
    InstancedScene scene;
    scene.build();
    const Ray ray{{0, 0, 1000}, 0, {0, 0, -1}};
    EXPECT_FALSE(closest_hit(scene, ray).hit.hit());
    const std::vector<Ray> bad{{{nan, 0, 0}, 0, {0, 0, 1}}, {{0, 0, 0}, 0, {0, 0, 0}}};
    std::vector<InstanceHit> hits(2);
    EXPECT_EQ(trace(scene, bad, hits).invalid_rays, 2u);
    EXPECT_THROW(trace(scene, bad, std::span(hits).first(1)), InputError);
    const std::vector<std::uint32_t> masks{1};
    EXPECT_THROW(trace(scene, bad, hits, {.masks = masks}), InputError);
    EXPECT_GT(scene.bounds().lo.x, scene.bounds().hi.x);
}

TEST(BuildMany, AreTheTreesOfEachMesh) {
    std::vector<Mesh> meshes;
    for (std::size_t i = 0; i < 300; ++i) meshes.push_back(test::random_soup(i % 40, seed + i));
    const std::vector<MeshView> views(meshes.begin(), meshes.end());
    for (const int threads : {1, 2, 7})
        for (const Builder builder : {Builder::apetrei, Builder::ploc, Builder::sbvh}) {
            const std::vector<Bvh> trees =
                build_many(views, {.builder = builder, .threads = threads});
            ASSERT_EQ(trees.size(), meshes.size());
            for (std::size_t i = 0; i < trees.size(); ++i)
                EXPECT_EQ(tree_hash(trees[i]),
                          tree_hash(build_bvh(meshes[i], {.builder = builder})));
        }
    meshes[123].triangles[0][0] = 100000;
    const std::vector<MeshView> broken(meshes.begin(), meshes.end());
    EXPECT_EQ(message_of([&] { static_cast<void>(build_many(broken, {})); }).substr(0, 23),
              "mesh 123: triangle 0: i");
    EXPECT_TRUE(build_many({}, {}).empty());
}

/// A direction of few bits that is shorter by a power of two, and has no more bits as a float, hits
/// what it did, later by that power.
TEST(Instances, SubnormalDirectionsKeepTheirWay) {
    Random random(seed);
    const Bvh soup = build_bvh(test::scaled(test::random_soup(300, seed), 1e-7f));
    InstancedScene scene;
    const std::uint32_t object = scene.add_object(soup);
    for (int i = 0; i < 8; ++i)
        scene.add_instance(InstancedScene::scene, {object, random.transform(1e-7f)});
    scene.build();
    std::size_t hits = 0;
    for (int i = 0; i < 8000; ++i) {
        const auto whole = [&] { return static_cast<float>(random.below(15)) - 7.0f; };
        const Vec3 d{whole(), whole(), whole()};
        if (d == Vec3{0, 0, 0}) continue;
        const Vec3 from = random.in(-1e-7f, 1e-7f);
        const InstanceHit wanted = closest_hit(scene, {from, 0, d}),
                          found = closest_hit(scene, {from, 0, 0x1p-146f * d});
        ASSERT_EQ(found.hit.hit(), wanted.hit.hit());
        if (!wanted.hit.hit()) continue;
        ++hits;
        ASSERT_EQ(found.hit.t, wanted.hit.t * 0x1p73f * 0x1p73f);
        ASSERT_EQ(found.hit.prim, wanted.hit.prim);
        ASSERT_EQ(found.hit.u, wanted.hit.u);
        ASSERT_EQ(found.path, wanted.path);
    }
    EXPECT_GT(hits, 100u);
}

/// Places that differ, at t that are all less than any float: the lower path wins.
TEST(Instances, TiesOfLongDirections) {
    const Bvh wall =
        build_bvh(Mesh{"", {{-1e-9f, -1e-9f, 0}, {1e-9f, -1e-9f, 0}, {0, 1e-9f, 0}}, {{0, 1, 2}}});
    InstancedScene scene;
    const std::uint32_t object = scene.add_object(wall);
    for (int i = 0; i < 16; ++i) {
        Transform moved;
        moved.m[2][3] = static_cast<float>(16 - i) * 1e-9f;
        scene.add_instance(InstancedScene::scene, {object, moved});
    }
    scene.build();
    for (const Vec3 d : {Vec3{0, 0, 1e38f}, Vec3{1e35f, 1e36f, 1e38f}}) {
        const InstanceHit hit = closest_hit(scene, {{0, -5e-10f, 0}, 0, d});
        ASSERT_TRUE(hit.hit.hit());
        EXPECT_EQ(hit.hit.t, 0.0f);
        EXPECT_EQ(hit.path[0], 0u);
    }
}

/// Rays that start on a triangle, from both sides and in instances that are turned over.
TEST(Instances, NoTIsMinusZero) {
    const Mesh mesh{"", {{-1, -1, 0}, {1, -1, 0}, {0, 1, 0}}, {{0, 1, 2}}};
    const Bvh bvh = build_bvh(mesh);
    InstancedScene scene;
    const std::uint32_t object = scene.add_object(bvh);
    std::size_t hits = 0;
    for (const float side : {1.0f, -1.0f}) {
        Transform turned;
        turned.m = {{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, side, 0}}};
        if (scene.instance_count() == 0)
            scene.add_instance(InstancedScene::scene, {object, turned});
        else
            scene.set_instance(InstancedScene::scene, 0, {object, turned});
        scene.build();
        for (const float tmin : {0.0f, -0.0f})
            for (const Vec3 d : {Vec3{0, 0, 1}, Vec3{0, 0, -1}, Vec3{0.5f, 0.25f, -1}}) {
                const InstanceHit hit = closest_hit(scene, {{0, -0.5f, 0}, tmin, d});
                if (!hit.hit.hit()) continue;
                ++hits;
                EXPECT_FALSE(std::signbit(hit.hit.t));
            }
    }
    EXPECT_EQ(hits, 12u);
}

}  // namespace
}  // namespace raydix
