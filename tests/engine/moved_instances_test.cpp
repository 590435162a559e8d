// Commits after which a few instances stand elsewhere: the tree of the last commit, changed in
// place, is that of a commit of everything.
#include "engine/moved_instances.h"

#include <gtest/gtest.h>
#include <raydix/error.h>
#include <raydix/scene.h>
#include <raydix/scene_queries.h>
#include <raydix/trace.h>

#include <cstring>
#include <memory>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "engine/near_scene.h"
#include "support/message.h"
#include "support/random.h"
#include "support/support.h"

namespace raydix::test {
namespace {

const SceneOptions moving{.usage = Usage::moving, .refit_limit = 1.5};

Mesh pyramid() {
    return {"",
            {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}},
            {{0, 1, 2}, {0, 1, 3}, {0, 2, 3}, {1, 2, 3}}};
}

/// Two scenes with the same geometries and changes. One may change its tree in place.
struct Twins {
    static constexpr std::uint32_t side = 7, count = side * side * side;

    Random random;
    Scene pyramids, balls, nothing, pair;
    Scene in_place, anew;
    std::vector<std::uint32_t> ids;
    std::vector<Transform> places;

    explicit Twins(std::uint64_t seed, bool nested = false) : random(seed) {
        pyramids.add(pyramid());
        const Sphere spheres[]{{{0, 0, 0}, 0.25f}, {{0.5f, 0.25f, 0}, 0.125f}};
        balls.add(spheres);
        pair.add(pyramids, {});
        pair.add(balls, {});
        for (Scene* below : {&pyramids, &balls, &nothing, &pair}) below->commit();
        const Sphere far[]{{{3, -4, 3}, 1}};
        for (Scene* scene : {&in_place, &anew}) {
            scene->add(pyramid());
            scene->add(far);
        }
        for (std::uint32_t k = 0; k < count; ++k) {
            places.push_back(turned());
            move_to(k, {static_cast<float>(k % side), static_cast<float>(k / side % side),
                        static_cast<float>(k / side / side)});
            const Scene& below = k % 50 == 7         ? nothing
                                 : nested && k == 20 ? pair
                                 : k % 3 == 0        ? balls
                                                     : pyramids;
            if (k == 100)
                places[k].m[0][0] = places[k].m[0][1] * 1.0001f,
                places[k].m[1][0] = places[k].m[1][1];  // almost flat
            ids.push_back(in_place.add(below, places[k], {.id = 3 * k + 10}));
            anew.add(below, places[k], {.id = 3 * k + 10});
        }
    }

    Transform turned() {
        Transform t;
        for (auto& row : t.m)
            for (int c = 0; c < 3; ++c) row[c] = random.between(-0.2f, 0.2f);
        for (int a = 0; a < 3; ++a) t.m[a][a] += 0.6f;
        return t;
    }
    void move_to(std::uint32_t k, Vec3 at) {
        places[k].m[0][3] = at.x, places[k].m[1][3] = at.y, places[k].m[2][3] = at.z;
    }
    void set(std::uint32_t k) {
        in_place.set_transform(ids[k], places[k]);
        anew.set_transform(ids[k], places[k]);
    }
    void set_mask(std::uint32_t k, std::uint32_t mask) {
        in_place.set_mask(ids[k], mask);
        anew.set_mask(ids[k], mask);
    }
    void nudge(std::uint32_t k, float by) {
        for (int a = 0; a < 3; ++a) places[k].m[a][3] += random.between(-by, by);
        set(k);
    }
    std::uint32_t any() { return static_cast<std::uint32_t>(random.between(0, count - 0.5f)); }

    /// Whether the first scene changed its tree.
    bool commit(const SceneOptions& options) {
        const SceneTree* const before = known ? SceneInternals::tree(in_place).get() : nullptr;
        const NearScene* const near_before = known ? before->later->near.get() : nullptr;
        // Who else holds a tree keeps it from being changed.
        const auto held = known ? SceneInternals::tree(anew) : nullptr;
        const CommitReport a = in_place.commit(options), b = anew.commit(options);
        EXPECT_EQ(a.parts_refitted, b.parts_refitted);
        EXPECT_EQ(
            std::tuple(a.meshes, a.instances, a.triangles, a.shapes, a.primitives, a.left_out),
            std::tuple(b.meshes, b.instances, b.triangles, b.shapes, b.primitives, b.left_out));
        EXPECT_EQ(std::tuple(a.trees_built, a.trees_refitted, a.sah_ratio, a.bytes, a.paths),
                  std::tuple(b.trees_built, b.trees_refitted, b.sah_ratio, b.bytes, b.paths));
        EXPECT_TRUE(in_place.committed());
        known = true;
        const SceneTree* const tree = SceneInternals::tree(in_place).get();
        near_stays += tree->later->near != nullptr && tree->later->near.get() == near_before;
        return tree == before;
    }
    bool known = false;
    int near_stays = 0;  // so often what queries of distance know of the scene was changed in place

    /// What was built has been refitted since, and one instance moved again.
    void be_refitted() {
        for (int k = 0; k < 3; ++k) {
            commit(moving);
            nudge(3, 0.1f);
        }
    }

    /// The trees, and what rays and queries find.
    void compare() {
        const SceneTree &a = *SceneInternals::tree(in_place), &b = *SceneInternals::tree(anew);
        const auto same = [](const auto& x, const auto& y) {
            return x.size() == y.size() &&
                   std::memcmp(x.data(), y.data(), x.size() * sizeof *x.data()) == 0;
        };
        EXPECT_TRUE(same(a.extents, b.extents));
        EXPECT_TRUE(same(a.images, b.images));
        ASSERT_EQ(a.placed.size(), b.placed.size());
        for (std::size_t i = 0; i < a.placed.size(); ++i) {
            EXPECT_EQ(std::memcmp(a.placed[i].way.columns, b.placed[i].way.columns,
                                  sizeof a.placed[i].way.columns),
                      0);
            EXPECT_EQ(a.placed[i].way.mask, b.placed[i].way.mask);
        }
        for (std::size_t i = 0; i < a.instances.size(); ++i) {
            EXPECT_EQ(a.instances[i].mask, b.instances[i].mask);
            EXPECT_EQ(std::memcmp(&a.instances[i].transform, &b.instances[i].transform,
                                  sizeof(Transform)),
                      0);
        }
        EXPECT_EQ(std::memcmp(&a.bounds, &b.bounds, sizeof a.bounds), 0);
        EXPECT_EQ(std::memcmp(&a.extent, &b.extent, sizeof a.extent), 0);
        EXPECT_EQ(std::memcmp(&a.near.arrays.bounds, &b.near.arrays.bounds, sizeof(Aabb)), 0);
        EXPECT_EQ(a.near.growth.rate, b.near.growth.rate);
        EXPECT_EQ(a.near.part, b.near.part);
        EXPECT_GE(a.near.growth.least, b.near.growth.least);
        if (a.near.arrays.middle == b.near.arrays.middle) {
            EXPECT_EQ(a.near.growth.least, b.near.growth.least);
            EXPECT_TRUE(same(a.near.arrays.nodes.view(), b.near.arrays.nodes.view()));
        }
        std::vector<Ray> rays;
        std::vector<Vec3> points;
        std::vector<std::uint32_t> masks;
        for (int i = 0; i < 400; ++i) {
            const Vec3 from = random.in(-2, side + 1), to = random.in(-1, side);
            rays.push_back({from, 0, {to.x - from.x, to.y - from.y, to.z - from.z}});
            masks.push_back(i % 4 == 0 ? 1 : 0xFFFFFFFFu);
            points.push_back(random.in(-4, side + 3));
        }
        const std::vector<Hit> hits = trace(in_place, rays, {.masks = masks}),
                               wanted = trace(anew, rays, {.masks = masks});
        EXPECT_TRUE(same(hits, wanted));
        std::size_t found = 0;
        for (const Hit& hit : hits) found += hit.hit();
        EXPECT_GT(found, rays.size() / 4);
        for (const Ray& ray : rays) EXPECT_EQ(closest_hit(in_place, ray), closest_hit(anew, ray));
        const auto near = closest_points(in_place, points),
                   near_wanted = closest_points(anew, points);
        EXPECT_TRUE(same(near, near_wanted));
    }
};

TEST(MovedInstances, AreThoseOfACommitOfEverything) {
    for (std::uint64_t seed = 0; seed < 1 + thorough / 4; ++seed) {
        SCOPED_TRACE(seed);
        Twins twins(seed);
        twins.commit(moving);
        int in_place = 0, steps = 0;
        const auto step = [&](const SceneOptions& options) {
            SCOPED_TRACE(steps);
            in_place += twins.commit(options), ++steps;
            twins.compare();
        };
        for (int k = 0; k < 20; ++k) {
            for (int m = 0; m <= k; ++m) twins.nudge(twins.any(), 0.3f);
            step(moving);
        }
        EXPECT_GT(in_place, 15);
        EXPECT_GT(twins.near_stays, 8);
        in_place = steps = 0;
        for (int k = 0; k < 10; ++k) {  // out of the bounds, and in again
            const std::uint32_t which = twins.any();
            const Transform home = twins.places[which];
            twins.nudge(which, 12);
            step(moving);
            twins.places[which] = home;
            twins.set(which);
            step(moving);
            twins.set_mask(which, 2);
            if (k % 2 == 0) twins.nudge(twins.any(), 0.1f);
            step(moving);
        }
        EXPECT_GT(in_place, 15);
        twins.nudge(100, 0.1f);  // in the tree of those that are almost flat
        step(moving);
        twins.nudge(7, 0.1f);  // nothing in it
        step(moving);
        for (int k = 0; k < 40; ++k) {  // until the tree has to be built again
            twins.nudge(twins.any(), 5);
            step(moving);
        }
    }
}

/// Beside triangles that have no area, which only queries of distance find.
TEST(MovedInstances, ThatHoldTrianglesWithoutAreaAreFoundWhereTheyAre) {
    Random random(3);
    Scene needle, in_place, anew;
    needle.add(Mesh{"",
                    {{0, 0, 0}, {1, 0, 0}, {0.5f, 0, 0}, {0, 0.1f, 0}, {0, 0, 0.1f}},
                    {{0, 1, 2}, {0, 3, 4}}});
    needle.commit();
    std::vector<Transform> places(100);
    for (Transform& place : places) {
        for (int a = 0; a < 3; ++a) place.m[a][3] = random.between(0, 20);
        in_place.add(needle, place);
        anew.add(needle, place);
    }
    std::vector<Vec3> points;
    for (int k = 0; k < 50; ++k) points.push_back(random.in(-1, 21));
    const SceneTree* tree = nullptr;
    int same_tree = 0;
    for (int k = 0; k < 8; ++k) {
        const auto which = static_cast<std::uint32_t>(random.between(0, 99.5f));
        places[which].m[0][3] += 1;
        in_place.set_transform(which, places[which]);
        anew.set_transform(which, places[which]);
        in_place.commit(moving);
        anew.commit();
        same_tree += tree == SceneInternals::tree(in_place).get();
        tree = SceneInternals::tree(in_place).get();
        for (const Vec3 point : points)
            EXPECT_EQ(closest_point(in_place, point).distance, closest_point(anew, point).distance);
    }
    EXPECT_GT(same_tree, 4);
}

TEST(MovedInstances, WhoseMasksBringInWhatHasNoAnswerAreRefused) {
    Scene pyramids, boxes, scene;
    pyramids.add(pyramid());
    const Aabb box{{0, 0, 0}, {1, 1, 1}};
    boxes.add(
        UserGeometry(std::span(&box, 1), [](std::uint32_t, const Ray&, Hit&) { return false; }));
    pyramids.commit(), boxes.commit();
    for (int k = 0; k < 40; ++k) {
        Transform place;
        place.m[0][3] = static_cast<float>(3 * k);
        scene.add(k == 20 ? boxes : pyramids, place, {.mask = k == 20 ? 2u : 1u});
    }
    const auto commit = [&](std::uint32_t id) {
        Transform place;
        place.m[0][3] = static_cast<float>(3 * id), place.m[1][3] = 0.5f;
        scene.set_transform(id, place);
        scene.commit(moving);
    };
    scene.commit(moving);
    commit(5), commit(6), commit(5);
    EXPECT_TRUE(closest_point(scene, {0, 0, 9}, infinity, 1).found());
    scene.set_mask(20, 3);
    commit(6);
    EXPECT_THROW((void)closest_point(scene, {0, 0, 9}, infinity, 1), InputError);
}

TEST(MovedInstances, WithOtherChangesOrOptionsTakeACommitOfEverything) {
    Twins twins(1);
    twins.commit(moving);
    twins.nudge(3, 0.1f);
    EXPECT_FALSE(twins.commit(moving));  // of a tree as it was built
    twins.nudge(3, 0.1f);
    EXPECT_TRUE(twins.commit(moving));
    const auto not_in_place = [&](const char* what, const SceneOptions& options) {
        SCOPED_TRACE(what);
        EXPECT_FALSE(twins.commit(options));
        twins.compare();
        twins.nudge(5, 0.1f);
        twins.commit(moving);
        twins.nudge(5, 0.1f);
        twins.commit(moving);
        twins.nudge(5, 0.1f);
        EXPECT_TRUE(twins.commit(moving));
        twins.compare();
    };
    twins.nudge(3, 0.1f);
    not_in_place("usage", {});
    twins.nudge(3, 0.1f);
    SceneOptions other = moving;
    other.refit_limit = 2;
    not_in_place("limit", other);
    twins.nudge(3, 0.1f);
    other = moving;
    other.quality = Quality::high;
    not_in_place("quality", other);
    twins.nudge(3, 0.1f);
    twins.in_place.set_mask(0, 2), twins.anew.set_mask(0, 2);
    not_in_place("mask of a mesh", moving);
    for (std::uint32_t k = 0; k < Twins::count / 2; ++k) twins.nudge(k, 0.01f);
    not_in_place("many", moving);
    twins.nudge(3, 0.1f);
    twins.in_place.remove(twins.ids[9]), twins.anew.remove(twins.ids[9]);
    not_in_place("one less", moving);
    twins.nudge(3, 0.1f);
    twins.pyramids.add(pyramid());
    twins.pyramids.commit();
    not_in_place("another scene below", moving);
}

TEST(MovedInstances, OfOpenedInstancesTakeACommitOfEverything) {
    Twins twins(2, true);
    twins.commit(moving);
    for (int k = 0; k < 3; ++k) {
        twins.nudge(3, 0.1f);
        EXPECT_FALSE(twins.commit(moving));
        twins.compare();
    }
}

TEST(MovedInstances, LeaveOtherScenesWhatTheyTook) {
    Twins twins(3);
    twins.commit(moving);
    Scene outer;
    outer.add(twins.in_place, {});
    const Ray rays[]{{{3.2f, 3.3f, -9}, 0, {0, 0, 1}}, {{-9, 2.2f, 4.3f}, 0, {1, 0, 0}}};
    std::vector<Hit> before;
    twins.nudge(3, 0.1f);
    twins.commit(moving);
    outer.commit();
    for (const Ray& ray : rays) before.push_back(closest_hit(outer, ray));
    for (std::uint32_t k = 0; k < 15; ++k) twins.nudge(k * 20 + 1, 0.3f);
    EXPECT_FALSE(twins.commit(moving));
    for (std::size_t i = 0; i < std::size(rays); ++i)
        EXPECT_EQ(closest_hit(outer, rays[i]), before[i]);
    outer.commit();  // with the new one, whose support it asked for
    outer = Scene();
    twins.nudge(3, 3);
    EXPECT_TRUE(twins.commit(moving));
    Scene again, wanted;
    again.add(twins.in_place, {}), wanted.add(twins.anew, {});
    again.commit(), wanted.commit();
    const Aabb a = again.bounds(), b = wanted.bounds();
    EXPECT_EQ(std::memcmp(&a, &b, sizeof a), 0);
}

TEST(MovedInstances, TellListenersWhoMayEndTheCommit) {
    Twins twins(5);
    twins.be_refitted();
    SceneOptions heard = moving;
    std::vector<double> parts;
    heard.progress = [&](double part) { parts.push_back(part); };
    EXPECT_TRUE(twins.commit(heard));
    EXPECT_EQ(parts.front(), 0);
    EXPECT_EQ(parts.back(), 1);
    for (const double end : {0.0, 1.0}) {
        const Transform home = twins.places[3];
        twins.places[3].m[1][3] += 0.2f;
        twins.in_place.set_transform(twins.ids[3], twins.places[3]);
        heard.progress = [end](double part) {
            if (part == end) throw std::runtime_error("enough");
        };
        EXPECT_THROW(twins.in_place.commit(heard), std::runtime_error);
        EXPECT_FALSE(twins.in_place.committed());
        const SceneTree& tree = *SceneInternals::tree(twins.in_place);
        EXPECT_EQ(tree.instances[3].transform.m[1][3], home.m[1][3]);
        const Aabb box = twins.in_place.bounds(), wanted = twins.anew.bounds();
        EXPECT_EQ(std::memcmp(&box, &wanted, sizeof box), 0);
        twins.compare();  // anew never heard of it
        twins.anew.set_transform(twins.ids[3], twins.places[3]);
        EXPECT_TRUE(twins.commit(moving));
        twins.compare();
    }
}

TEST(MovedInstances, AListenerMayHaveAnotherSceneTakeTheTree) {
    Twins twins(6);
    twins.be_refitted();
    Scene outer;
    SceneOptions heard = moving;
    heard.progress = [&](double part) {
        if (part < 1) return;
        outer.add(twins.in_place, {});
        outer.commit();
    };
    const std::uint32_t which = 45;
    twins.nudge(which, 0.5f);
    EXPECT_FALSE(twins.commit(heard));
    twins.compare();
    outer.commit();
    Scene wanted;
    wanted.add(twins.anew, {});
    wanted.commit();
    const Ray ray{{twins.places[which].m[0][3] + 0.05f, twins.places[which].m[1][3] + 0.05f, -9},
                  0,
                  {0, 0, 1}};
    EXPECT_EQ(closest_hit(outer, ray), closest_hit(wanted, ray));
}

TEST(MovedInstances, ThatAreRefusedLeaveTheLastCommit) {
    Twins twins(4);
    twins.be_refitted();
    SceneOptions wrong = moving;
    wrong.threads = 5000;
    EXPECT_THROW(twins.in_place.commit(wrong), InputError);
    wrong = moving;
    wrong.usage = static_cast<Usage>(7);
    EXPECT_THROW(twins.in_place.commit(wrong), InputError);
    EXPECT_TRUE(twins.commit(moving));
    const Transform home = twins.places[3];
    twins.places[3].m[1][3] = 3e12f;
    twins.in_place.set_transform(twins.ids[3], twins.places[3]);
    const std::string said = message_of([&] { twins.in_place.commit(moving); });
    EXPECT_NE(said.find("instance 19: it reaches beyond 1e12"), std::string::npos) << said;
    EXPECT_FALSE(twins.in_place.committed());
    twins.compare();  // anew never heard of it
    twins.places[3] = home;
    twins.set(3);
    EXPECT_TRUE(twins.commit(moving));
    twins.compare();
}

}  // namespace
}  // namespace raydix::test
