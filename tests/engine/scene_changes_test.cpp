// Scenes that change: ids, masks, updates and commits against scenes made afresh; what they refuse.
#include <gtest/gtest.h>
#include <raydix/error.h>
#include <raydix/scene.h>
#include <raydix/trace.h>

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <thread>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

#include "engine/float_world.h"
#include "engine/scene_state.h"
#include "exec/memory.h"
#include "support/double_scenes.h"
#include "support/message.h"
#include "support/support.h"

namespace raydix::test {
namespace {

constexpr Ray down_on_changes{{0.25f, 0.25f, 10}, 0, {0, 0, -1}};

TEST(SceneChanges, ChangesInAnyOrderEqualASceneMadeAfresh) {
    for (std::uint64_t seed = 0; seed < 3 * thorough; ++seed) {
        RandomScenes random(seed);
        const auto first = random_world(random, {1, 5, 0});
        const std::vector<Ray> rays = random_rays(random, 100);
        World world;
        world.scene = std::move(first->scene);
        world.items = first->items;
        for (int step = 0; step < 6; ++step) {
            for (int change = 0; change < 3; ++change) {
                const std::uint32_t what = random.below(5);
                if (what == 0 || world.items.empty()) {
                    World::Item item{
                        0, random.mask(), random_soup(20, random.below(99), 0.6f), {}, {}};
                    item.id = world.scene.add(item.mesh, {.mask = item.mask, .id = {}});
                    world.items.push_back(item);
                    std::ranges::sort(world.items, {}, &World::Item::id);
                    continue;
                }
                const std::size_t place =
                    random.below(static_cast<std::uint32_t>(world.items.size()));
                World::Item& item = world.items[place];
                if (what == 1) {
                    world.scene.remove(item.id);
                    EXPECT_FALSE(world.scene.contains(item.id));
                    world.items.erase(world.items.begin() + static_cast<std::ptrdiff_t>(place));
                } else if (what == 2) {
                    world.scene.set_mask(item.id, item.mask = random.mask());
                } else if (item.inside) {
                    world.scene.set_transform(item.id, item.transform = random.transform(4, 0));
                } else {
                    world.scene.update(item.id,
                                       item.mesh = random_soup(30, random.below(99), 0.6f));
                }
            }
            EXPECT_FALSE(world.scene.committed());
            SceneOptions options;
            options.usage = step % 2 == 0 ? Usage::moving : Usage::fixed;
            world.scene.commit(options);
            EXPECT_TRUE(world.scene.committed());
            EXPECT_EQ(world.scene.size(), world.items.size());
            EXPECT_EQ(differences(world, rays, std::vector<std::uint32_t>(rays.size(), every_mask)),
                      0u)
                << "seed " << seed << ", step " << step;
        }
    }
}

template <class AnyScene>
void tells_what_it_holds() {
    using Mesh = typename AnyScene::Mesh;
    const Mesh mesh{{}, {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}};
    AnyScene leaf(mesh), scene;
    EXPECT_TRUE(scene.ids().empty());
    scene.add(mesh, {.mask = 6, .id = 4'000'000'000u});
    scene.add(leaf, {}, {.mask = 5, .id = {}});
    scene.share(mesh);
    scene.share(mesh);
    scene.remove(1);
    EXPECT_EQ(scene.ids(), (std::vector<std::uint32_t>{0, 2, 4'000'000'000u}));
    EXPECT_EQ(scene.mask(0), 5u);
    EXPECT_EQ(scene.mask(2), every_mask);
    EXPECT_EQ(scene.mask(4'000'000'000u), 6u);
    EXPECT_FALSE(scene.mesh(0).has_value());
    EXPECT_EQ(scene.mesh(2)->triangles.data(), mesh.triangles.data());
    EXPECT_NE(scene.mesh(4'000'000'000u)->vertices.data(), mesh.vertices.data());
    EXPECT_EQ(scene.mesh(4'000'000'000u)->vertices.size(), 3u);
    EXPECT_TRUE(std::ranges::equal(scene.mesh(4'000'000'000u)->triangles, mesh.triangles));
    scene.update(2, Mesh{});
    EXPECT_TRUE(scene.mesh(2)->triangles.empty());
    EXPECT_THROW(static_cast<void>(scene.mesh(1)), InputError);
    EXPECT_THROW(static_cast<void>(scene.mask(1)), InputError);

    using Transform = typename AnyScene::Transform;
    Transform placed;
    placed.m[0][3] = 7;
    scene.set_transform(0, placed);
    EXPECT_EQ(scene.transform(0)->m[0][3], 7);
    EXPECT_FALSE(scene.transform(2).has_value());
    EXPECT_THROW(static_cast<void>(scene.transform(1)), InputError);
    EXPECT_EQ(scene.kind(0), GeometryKind::instance);
    EXPECT_EQ(scene.kind(2), GeometryKind::mesh);
    EXPECT_THROW(static_cast<void>(scene.kind(1)), InputError);
    const std::vector<typename AnyScene::Sphere> spheres(1);
    const std::vector<typename AnyScene::Capsule> capsules(2);
    const std::vector<typename AnyScene::Point> points(3);
    EXPECT_EQ(scene.kind(scene.add(std::span(spheres))), GeometryKind::spheres);
    EXPECT_EQ(scene.kind(scene.add(std::span(capsules))), GeometryKind::capsules);
    EXPECT_EQ(scene.kind(scene.add(std::span(points), 1)), GeometryKind::points);
}

TEST(SceneChanges, TellsWhatItHolds) {
    tells_what_it_holds<Scene>();
    tells_what_it_holds<SceneD>();
}

TEST(SceneChanges, MovingMeshesAreBuiltOnlyWhenTheyChange) {
    Scene scene;
    for (int k = 0; k < 5; ++k) scene.add(random_soup(50, static_cast<std::uint64_t>(k)));
    const SceneOptions moving{.usage = Usage::moving};
    EXPECT_EQ(scene.commit(moving).trees_built, 5u);
    EXPECT_EQ(scene.commit(moving).trees_built, 0u);
    scene.update(3, random_soup(60, 9));
    scene.set_mask(1, 7);
    EXPECT_EQ(scene.commit(moving).trees_built, 1u);
    RandomScenes random(2);
    const std::vector<Ray> rays = random_rays(random, 500);
    std::vector<Hit> hits(rays.size());
    for (const std::uint32_t mask : {7u, 8u}) {
        trace(scene, rays, hits, {.mask = mask});
        EXPECT_EQ(std::ranges::count(hits, 1u, &Hit::geometry) > 0, mask == 7) << mask;
    }
    // Four meshes share a tree now; the one of another mask keeps its own.
    EXPECT_EQ(scene.commit({.usage = Usage::fixed}).trees_built, 1u);
}

TEST(SceneChanges, ShapesAreBuiltOnlyWhenTheyChange) {
    const Sphere spheres[] = {{{0, 0, 0}, 1}, {{3, 0, 0}, 1}};
    for (const Usage usage : {Usage::fixed, Usage::moving}) {
        Scene scene;
        const std::uint32_t id = scene.add(std::span(spheres).first(1)),
                            mesh = scene.add(random_soup(50, 1));
        const SceneOptions options{.usage = usage, .refit_limit = 0};
        EXPECT_EQ(scene.commit(options).trees_built, 2u);
        scene.update(mesh, random_soup(60, 2));
        EXPECT_EQ(scene.commit(options).trees_built, 1u);
        scene.update(id, std::span(spheres));
        EXPECT_EQ(scene.commit(options).trees_built, 1u);
        scene.update(mesh, random_soup(70, 3));
        EXPECT_EQ(scene.commit(options).trees_built, 1u);
    }
}

template <class AnyScene>
void keeps_its_tree_where_nothing_changed() {
    RandomScenes random(4);
    const auto mesh = [&](std::uint64_t seed) {
        if constexpr (std::is_same_v<AnyScene, Scene>)
            return random_soup(50, seed);
        else
            return random_soup_d(50, seed);
    };
    AnyScene leaf, other, world;
    for (AnyScene* scene : {&leaf, &other}) scene->add(mesh(1)), scene->commit();
    world.add(mesh(2));
    const std::uint32_t ball =
        world.add(std::vector<typename AnyScene::Sphere>{{{0, 0, 0}, 0.25f}});
    for (AnyScene* scene : {&leaf, &other, &leaf}) world.add(*scene, {});
    using Scalar = std::conditional_t<std::is_same_v<AnyScene, Scene>, float, double>;
    const auto& tree = BasicSceneInternals<Scalar>::tree;
    for (const Usage usage : {Usage::fixed, Usage::moving}) {
        SceneOptions options{.usage = usage};
        const CommitReport first = world.commit(options);
        const auto made = tree(world);
        std::vector<double> progress;
        options.progress = [&](double part) { progress.push_back(part); };
        const CommitReport again = world.commit(options);
        options.progress = {};
        EXPECT_EQ(tree(world), made);
        EXPECT_EQ(progress.back(), 1.0);
        EXPECT_EQ(again.trees_built + again.trees_refitted, 0u);
        EXPECT_EQ(std::tie(again.meshes, again.instances, again.triangles, again.shapes,
                           again.primitives, again.bytes, again.paths),
                  std::tie(first.meshes, first.instances, first.triangles, first.shapes,
                           first.primitives, first.bytes, first.paths));
        // Whatever is another commit is one.
        const auto commits = [&](const SceneOptions& given, const char* what) {
            const auto last = tree(world);
            world.commit(given);
            EXPECT_NE(tree(world), last) << what;
        };
        leaf.update(0, mesh(3));
        world.commit(options);
        EXPECT_EQ(tree(world), made);  // the change below has not been committed
        leaf.commit();
        commits(options, "a scene below");
        world.set_transform(ball + 1, {{{{1, 0, 0, 2}, {0, 1, 0, 0}, {0, 0, 1, 0}}}});
        commits(options, "moved");
        world.set_mask(0, usage == Usage::fixed ? 6 : 7);
        commits(options, "another mask");
        world.update(ball, std::vector<typename AnyScene::Sphere>{{{0, 0, 0}, 0.5f}});
        commits(options, "another sphere");
        SceneOptions higher = options;
        higher.quality = Quality::fast;
        commits(higher, "another quality");
        commits(options, "and back");
        higher = options;
        higher.refit_limit = 2;
        commits(higher, "another limit");
    }
    // What a commit that is strict refuses was taken by the last one.
    auto bad = mesh(5);
    bad.vertices[0].x = std::numeric_limits<float>::infinity();
    world.update(0, bad);
    world.commit();
    world.commit();
    EXPECT_THROW(world.commit({.strict = true}), InputError);
    EXPECT_THROW(world.commit({.threads = 5000}), InputError);
}

TEST(SceneChanges, KeepItsTreeWhereNothingChanged) {
    keeps_its_tree_where_nothing_changed<Scene>();
    keeps_its_tree_where_nothing_changed<SceneD>();
}

TEST(SceneChanges, BuildsAgainInTheMemoryOfEarlierTrees) {
    const auto hits_of = [](const Scene& scene, const std::vector<Ray>& rays) {
        std::vector<Hit> hits(rays.size());
        trace(scene, rays, hits);
        std::vector<std::pair<float, std::uint32_t>> out;
        for (const Hit& hit : hits) out.emplace_back(hit.t, hit.prim);
        return out;
    };
    for (const Quality quality : {Quality::fast, Quality::balanced, Quality::high}) {
        // One thread: each that helps for the first time takes memory of its own, whenever that is.
        const SceneOptions options{.quality = quality, .threads = 1};
        RandomScenes random(static_cast<std::uint64_t>(quality));
        const std::vector<Ray> rays = random_rays(random, 200);
        Mesh mesh = random_soup(3000, 7, 0.3f);
        Scene scene;
        const std::uint32_t id = scene.add(mesh);
        scene.commit(options);
        Scene holder;  // goes on with the first tree
        holder.add(scene, Transform{});
        holder.commit(options);
        const auto held = hits_of(holder, rays);
        std::uint64_t bytes = 0;
        for (int step = 0; step < 6; ++step) {
            for (Vec3& v : mesh.vertices) v.x += 0.125f * v.y;
            scene.update(id, mesh);
            EXPECT_EQ(scene.commit(options).trees_built, 1u);
            // The second tree takes new memory; later ones may have a few nodes more.
            if (step > 1) {
                EXPECT_LT(memory_count().now(), bytes + bytes / 10);
            }
            bytes = memory_count().now();
            Scene fresh;
            fresh.add(mesh);
            fresh.commit(options);
            EXPECT_EQ(hits_of(scene, rays), hits_of(fresh, rays)) << step;
            EXPECT_EQ(hits_of(holder, rays), held) << step;
        }
    }
}

TEST(SceneChanges, RefusesWhatItCannotHold) {
    Scene scene, other;
    const auto message = [](const auto& call) { return message_of(call); };
    EXPECT_EQ(scene.add(one_triangle(0)), 0u);
    EXPECT_EQ(scene.add(one_triangle(0), {.id = 5}), 5u);
    EXPECT_EQ(scene.add(one_triangle(0)), 1u);
    EXPECT_EQ(message([&] { scene.add(one_triangle(0), {.id = 5}); }),
              "geometry 5: this id was given before");
    scene.remove(1);
    EXPECT_EQ(message([&] { scene.add(one_triangle(0), {.id = 1}); }),
              "geometry 1: this id was given before");
    EXPECT_EQ(message([&] { scene.remove(1); }), "there is no geometry 1");
    Mesh bad = one_triangle(0);
    bad.triangles.push_back({0, 1, 3});
    EXPECT_EQ(message([&] { scene.add(bad); }),
              "geometry 2: triangle 1 has an index past the 3 vertices");
    bad.triangles.clear();
    EXPECT_EQ(message([&] { scene.add(bad); }), "geometry 2: vertices without triangles");
    Transform flat;
    flat.m[2][2] = 0;
    EXPECT_EQ(message([&] { scene.add(other, flat); }),
              "instance 2: its transform is singular or not finite, so rays cannot go through it");
    EXPECT_EQ(message([&] { scene.add(scene, Transform{}); }),
              "instance 2: the scene would hold itself");
    EXPECT_EQ(scene.add(other, Transform{}), 2u);
    EXPECT_EQ(message([&] { other.add(scene, Transform{}); }),
              "instance 0: the scene would hold itself");
    EXPECT_EQ(message([&] { scene.commit(); }),
              "instance 2: the scene that it places was never committed");
    EXPECT_EQ(message([&] { scene.update(2, one_triangle(0)); }),
              "geometry 2 is an instance, not a mesh");
    EXPECT_EQ(message([&] { scene.set_transform(0, Transform{}); }),
              "geometry 0 is a mesh, not an instance");
    EXPECT_EQ(message([&] { static_cast<void>(trace(scene, std::vector<Ray>(2))); }),
              "scene: it was never committed");
    const Scene one(one_triangle(0));
    const std::vector<std::uint32_t> masks(3);
    EXPECT_EQ(
        message([&] { static_cast<void>(trace(one, std::vector<Ray>(2), {.masks = masks})); }),
        "trace: 2 rays, but 3 masks");
}

TEST(SceneChanges, LimitsOfNesting) {
    Scene leaf(one_triangle(0));
    std::vector<Scene> scenes;
    scenes.emplace_back().add(leaf, Transform{});
    scenes.back().commit();
    for (std::uint32_t k = 1; k < Scene::max_levels; ++k) {
        Scene next;
        next.add(scenes.back(), Transform{});
        next.commit();
        scenes.push_back(std::move(next));
    }
    EXPECT_EQ(closest_hit(scenes.back(), down_on_changes).instance, Scene::max_levels);
    EXPECT_EQ(trace(scenes.back(), std::vector<Ray>(40, down_on_changes))[7].instance,
              Scene::max_levels);
    Scene deeper;
    deeper.add(scenes.back(), Transform{});
    EXPECT_THROW(deeper.commit(), InputError);
    // Ten times as many paths a level, of one triangle.
    std::vector<Scene> tens;
    tens.push_back(Scene(one_triangle(0)));
    std::string said;
    for (int level = 0; level < 10 && said.empty(); ++level) {
        Scene next;
        for (int k = 0; k < 10; ++k) next.add(tens.back(), moved(static_cast<float>(k), 0, 0));
        try {
            const std::uint64_t paths = next.commit().paths;
            const auto number_at = [&](float x) {
                return closest_hit(next, {{x + 0.25f, 0.25f, 1}, 0, {0, 0, -1}}).instance;
            };
            EXPECT_EQ(number_at(0), static_cast<std::uint32_t>(level + 1));
            EXPECT_EQ(number_at(9 * static_cast<float>(level + 1)), paths);
            const std::vector<Ray> rays(40, Ray{{0.25f, 0.25f, 1}, 0, {0, 0, -1}});
            EXPECT_EQ(trace(next, rays)[11].instance, static_cast<std::uint32_t>(level + 1));
        } catch (const InputError& error) {
            said = error.what();
        }
        tens.push_back(std::move(next));
    }
    EXPECT_EQ(said, "instance 3: more than 2^32 - 2 paths through instances");
}

/// However many stand in each other, twice each; or their ends would not fit the stack.
TEST(SceneChanges, LongChainsOfScenesEnd) {
    Scene outer;
    {
        std::vector<Scene> chain(200'000);
        outer.add(chain[0], {});
        for (std::size_t k = 0; k + 1 < chain.size(); ++k)
            for (int twice = 0; twice < 2; ++twice) chain[k].add(chain[k + 1], {});
    }
    EXPECT_EQ(outer.size(), 1u);
    outer.remove(0);  // the last to hold them
    EXPECT_EQ(outer.size(), 0u);
}

TEST(SceneChanges, TracesWhileAnotherIsCommitted) {
    const Mesh mesh = random_soup(300, 4);
    Scene object(mesh), old;
    for (int k = 0; k < 20; ++k) old.add(object, moved(static_cast<float>(k), 0, 0));
    old.commit();
    RandomScenes random(8);
    const std::vector<Ray> rays = random_rays(random, 500);
    const std::vector<Hit> expected = trace(old, rays);
    std::atomic<std::size_t> wrong = 0;
    std::atomic<bool> done = false;
    std::vector<std::thread> threads;
    for (int t = 0; t < 2; ++t)
        threads.emplace_back([&] {
            do {
                const std::vector<Hit> hits = trace(old, rays, {.threads = 1});
                for (std::size_t i = 0; i < rays.size(); ++i) {
                    wrong += !same(hits[i], expected[i]);
                    wrong += i % 7 == 0 && !same(closest_hit(old, rays[i]), expected[i]);
                }
            } while (!done);
        });
    for (int round = 0; round < 5; ++round) {
        Scene next;
        for (int k = 0; k < 20; ++k) next.add(object, moved(0, static_cast<float>(k + round), 0));
        next.add(mesh);
        next.commit();
        EXPECT_GT(trace(next, rays, {.threads = 1}).size(), 0u);
    }
    done = true;
    for (std::thread& thread : threads) thread.join();
    EXPECT_EQ(wrong, 0u);
}

}  // namespace
}  // namespace raydix::test
