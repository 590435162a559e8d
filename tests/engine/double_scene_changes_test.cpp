// Scenes in double that change: against scenes made afresh, refits, limits, commits that end early,
// threads.
#include <gtest/gtest.h>
#include <raydix/error.h>
#include <raydix/scene.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "engine/double_world.h"
#include "support/message.h"
#include "support/sanitized.h"
#include "support/support.h"

namespace raydix::test {
namespace {

/// Three changes of any kind.
void change(RandomWorlds& random, WorldD& world) {
    for (int k = 0; k < 3; ++k) {
        const std::uint32_t what = random.under(5);
        if (what == 0 || world.items.empty()) {
            WorldD::Item item{0, random.mask(), random.soup(20, world.home), {}, {}};
            item.id = world.scene.add(item.mesh, {.mask = item.mask, .id = {}});
            world.items.push_back(item);
            std::ranges::sort(world.items, {}, &WorldD::Item::id);
            continue;
        }
        const std::size_t place = random.below(world.items.size());
        WorldD::Item& item = world.items[place];
        if (what == 1) {
            world.scene.remove(item.id);
            EXPECT_FALSE(world.scene.contains(item.id));
            world.items.erase(world.items.begin() + static_cast<std::ptrdiff_t>(place));
        } else if (what == 2) {
            world.scene.set_mask(item.id, item.mask = random.mask());
        } else if (item.inside) {
            item.transform = random.transform(item.inside->home, world.home, 4, 0);
            world.scene.set_transform(item.id, item.transform);
        } else if (what == 3) {
            for (Vec3d& v : item.mesh.vertices) v = random.around(v, 0.01);
            world.scene.update(item.id, item.mesh);
        } else {
            world.scene.update(item.id, item.mesh = random.soup(30, world.home));
        }
    }
}

TEST(DoubleSceneChanges, InAnyOrderEqualASceneMadeAfresh) {
    for (std::uint64_t seed = 0; seed < 2 * thorough; ++seed) {
        RandomWorlds random(seed);
        const auto world = random.world({1, 5, 0, seed % 2 == 0 ? 0 : 1e7, {}});
        const std::vector<RayD> rays = random.rays(100, world->home);
        const std::vector<std::uint32_t> masks(rays.size(), every_mask);
        for (int step = 0; step < 6; ++step) {
            change(random, *world);
            EXPECT_FALSE(world->scene.committed());
            world->scene.commit({.quality = static_cast<Quality>(seed % 3),
                                 .usage = step % 3 != 2 ? Usage::moving : Usage::fixed});
            EXPECT_TRUE(world->scene.committed());
            EXPECT_EQ(world->scene.size(), world->items.size());
            EXPECT_EQ(differences(*world, rays, masks), 0u) << "seed " << seed << ", step " << step;
        }
    }
}

TEST(DoubleSceneChanges, ACommitThatEndsAtAnyCallLeavesTheSceneAsItWas) {
    for (std::uint64_t seed = 0; seed < 6; ++seed) {
        RandomWorlds random(seed);
        const SceneOptions usual{.quality = static_cast<Quality>(seed % 3),
                                 .usage = seed % 2 == 0 ? Usage::fixed : Usage::moving};
        const auto world = random.world({2, 6, 0, 0, usual});
        const std::uint32_t large = world->scene.add(random_soup_d(fewer(3000, 4), seed));
        WorldD::Item item{large, every_mask, random_soup_d(fewer(3000, 4), seed), {}, {}};
        world->items.push_back(item);
        world->scene.commit(usual);
        const std::vector<RayD> rays = random.rays(100, world->home);
        const std::vector<HitD> before = trace(world->scene, rays);
        const AabbD box = world->scene.bounds();
        change(random, *world);
        if (world->scene.contains(large)) {
            WorldD::Item& last = *std::ranges::find(world->items, large, &WorldD::Item::id);
            last.mesh = random_soup_d(fewer(3000, 4), 77);
            world->scene.update(large, last.mesh);
        }
        SceneOptions options = usual;
        std::size_t calls = 0, last = 0;
        double part = 0;
        struct Enough {};
        options.progress = [&](double now) {
            EXPECT_GT(now, part);
            part = now;
            if (calls++ == last) throw Enough{};
        };
        for (bool done = false; !done; ++last) {
            calls = 0, part = -1;
            options.threads = 1 + static_cast<int>(last % 2);
            try {
                world->scene.commit(options);
                done = true;
            } catch (const Enough&) {
                EXPECT_EQ(calls, last + 1);
                EXPECT_FALSE(world->scene.committed());
                EXPECT_EQ(trace(world->scene, rays), before);
                const AabbD same = world->scene.bounds();
                EXPECT_TRUE(same.lo == box.lo && same.hi == box.hi);
            }
        }
        EXPECT_EQ(part, 1.0);
        EXPECT_GE(last, 6u);
        EXPECT_TRUE(world->scene.committed());
        EXPECT_EQ(differences(*world, rays, std::vector<std::uint32_t>(rays.size(), every_mask)),
                  0u);
    }
}

/// A wavy sheet of 2 * side^2 triangles around (1e7, 0, 0).
MeshD sheet(std::uint32_t side, double phase) {
    MeshD mesh;
    for (std::uint32_t y = 0; y <= side; ++y)
        for (std::uint32_t x = 0; x <= side; ++x) {
            const double u = x / double(side), v = y / double(side);
            mesh.vertices.push_back({1e7 + u, v, 0.02 * std::sin(20 * u + 15 * v + phase)});
        }
    for (std::uint32_t y = 0; y < side; ++y)
        for (std::uint32_t x = 0; x < side; ++x) {
            const std::uint32_t a = y * (side + 1) + x, b = a + side + 1;
            mesh.triangles.push_back({a, a + 1, b});
            mesh.triangles.push_back({a + 1, b + 1, b});
        }
    return mesh;
}

TEST(DoubleSceneChanges, MovedVerticesRefitATreeWhileItIsGood) {
    const MeshD mesh = sheet(30, 0);
    RandomWorlds random(3);
    const std::vector<RayD> rays = random.rays(fewer(1000, 4), {1e7 + 0.5, 0.5, 0});
    for (const Quality quality : {Quality::fast, Quality::balanced}) {
        SceneOptions options{.quality = quality, .usage = Usage::moving};
        SceneD scene, holder;
        scene.add(mesh);
        EXPECT_EQ(scene.commit(options).trees_built, 1u);
        holder.add(scene, TransformD{});
        holder.commit();
        const std::vector<HitD> held = trace(holder, rays);
        const auto commit = [&](const MeshD& other, bool refitted, const char* what) {
            SCOPED_TRACE(what);
            scene.update(0, other);
            const CommitReport report = scene.commit(options);
            EXPECT_EQ(report.trees_refitted, refitted ? 1u : 0u);
            EXPECT_EQ(report.trees_built, refitted ? 0u : 1u);
            const std::vector<HitD> hits = trace(scene, rays);
            EXPECT_EQ(hits, trace_brute_force(other, rays));
            EXPECT_GT(std::ranges::count_if(hits, [](const HitD& h) { return h.hit(); }),
                      sanitized ? 5 : 20);
            const AabbD box = scene.bounds(), fresh = SceneD(other).bounds();
            EXPECT_TRUE(box.lo == fresh.lo && box.hi == fresh.hi);
            return report.sah_ratio;
        };
        EXPECT_NEAR(commit(mesh, true, "nothing moved"), 1.0, 1e-6);
        for (int k = 1; k < 4; ++k) EXPECT_LE(commit(sheet(30, k), true, "waves"), 1.5);
        MeshD other = mesh;
        for (std::size_t i = other.vertices.size(); i > 1; --i)
            std::swap(other.vertices[i - 1], other.vertices[random.below(i)]);
        const double worse = commit(other, false, "shuffled");
        EXPECT_GT(worse, 1.5);
        options.refit_limit = 1000;
        EXPECT_NEAR(commit(mesh, true, "a limit out of reach"), 1, 1);
        // The quotient is to the build, not to the refit before.
        EXPECT_NEAR(commit(other, true, "back"), 1.0, 1e-6);
        options.refit_limit = 0;
        commit(mesh, false, "never");
        options.refit_limit = 1.5;
        other = mesh;
        other.vertices[100].x = std::numeric_limits<double>::quiet_NaN();
        commit(other, false, "triangles went out");
        commit(mesh, false, "triangles came in");
        other = mesh;
        other.triangles.push_back({0, 1, 50});
        commit(other, false, "one more");
        EXPECT_EQ(trace(holder, rays), held) << "others keep what they saw";
    }
    SceneD scene;
    scene.add(mesh);
    EXPECT_EQ(message_of([&] { scene.commit({.refit_limit = -1}); }),
              "refit_limit: expected 0 or more, given -1.000000");
}

TEST(DoubleSceneChanges, MeshesAreBuiltOnlyWhenTheyChange) {
    SceneD scene;
    for (std::uint64_t k = 0; k < 5; ++k) scene.add(random_soup_d(50, k));
    const SceneOptions moving{.usage = Usage::moving};
    const CommitReport first = scene.commit(moving);
    EXPECT_EQ(first.trees_built, 5u);
    EXPECT_EQ(first.meshes, 5u);
    EXPECT_EQ(first.triangles, 250u);
    EXPECT_GT(first.bytes, 250u * sizeof(LeafTriangleD));
    EXPECT_EQ(scene.commit(moving).trees_built, 0u);
    scene.update(3, random_soup_d(60, 9));
    scene.set_mask(1, 7);
    EXPECT_EQ(scene.commit(moving).trees_built, 1u);
    // Four meshes share a tree now; the one of another mask keeps its own.
    EXPECT_EQ(scene.commit({.usage = Usage::fixed}).trees_built, 1u);
}

TEST(DoubleSceneChanges, SharedMeshesAreReadWhereTheyAre) {
    MeshD mesh = one_triangle();
    SceneD scene;
    const std::uint32_t id = scene.share(mesh);
    scene.commit();
    EXPECT_EQ(closest_hit(scene, down).t, 10);
    for (Vec3d& v : mesh.vertices) v.z = 4;
    scene.update(id, mesh);
    scene.commit({.usage = Usage::moving});
    EXPECT_EQ(closest_hit(scene, down).t, 6);
}

TEST(DoubleSceneChanges, RefusesWhatItCannotHold) {
    SceneD scene, other;
    const auto message = [](const auto& call) { return message_of(call); };
    EXPECT_EQ(scene.add(one_triangle()), 0u);
    EXPECT_EQ(scene.add(one_triangle(), {.id = 5}), 5u);
    EXPECT_EQ(scene.add(one_triangle()), 1u);
    EXPECT_EQ(message([&] { scene.add(one_triangle(), {.id = 5}); }),
              "geometry 5: this id was given before");
    scene.remove(1);
    EXPECT_EQ(message([&] { scene.add(one_triangle(), {.id = 1}); }),
              "geometry 1: this id was given before");
    EXPECT_EQ(message([&] { scene.remove(1); }), "there is no geometry 1");
    MeshD bad = one_triangle();
    bad.triangles.push_back({0, 1, 3});
    EXPECT_EQ(message([&] { scene.add(bad); }),
              "geometry 2: triangle 1 has an index past the 3 vertices");
    bad.triangles.clear();
    EXPECT_EQ(message([&] { scene.add(bad); }), "geometry 2: vertices without triangles");
    const std::string singular =
        "instance 2: its transform is singular or not finite, so rays cannot go through it";
    TransformD flat;
    flat.m[2][2] = 0;
    EXPECT_EQ(message([&] { scene.add(other, flat); }), singular);
    flat.m[2] = flat.m[0];
    flat.m[2][1] = 0x1p-45;
    EXPECT_EQ(message([&] { scene.add(other, flat); }), singular);
    TransformD unbounded;
    unbounded.m[1][3] = std::numeric_limits<double>::infinity();
    EXPECT_EQ(message([&] { scene.add(other, unbounded); }), singular);
    EXPECT_EQ(message([&] { scene.add(scene, TransformD{}); }),
              "instance 2: the scene would hold itself");
    EXPECT_EQ(scene.add(other, TransformD{}), 2u);
    EXPECT_EQ(message([&] { scene.set_transform(2, flat); }), singular);
    EXPECT_EQ(message([&] { other.add(scene, TransformD{}); }),
              "instance 0: the scene would hold itself");
    EXPECT_EQ(message([&] { scene.commit(); }),
              "instance 2: the scene that it places was never committed");
    EXPECT_EQ(message([&] { scene.update(2, one_triangle()); }),
              "geometry 2 is an instance, not a mesh");
    EXPECT_EQ(message([&] { scene.set_transform(0, TransformD{}); }),
              "geometry 0 is a mesh, not an instance");
    EXPECT_EQ(message([&] { static_cast<void>(trace(scene, std::vector<RayD>(2))); }),
              "scene: it was never committed");
    other.add(one_triangle());
    other.commit();
    scene.set_transform(2, moved(1e12, 0, 0));
    EXPECT_EQ(message([&] { scene.commit(); }),
              "instance 2: it reaches beyond 1e12, or is not finite");
    scene.set_transform(2, moved(0, 0, 1));
    scene.commit();
    EXPECT_EQ(closest_hit(scene, down).t, 9);
}

TEST(DoubleSceneChanges, LimitsOfNesting) {
    std::vector<SceneD> scenes;
    scenes.emplace_back(one_triangle());
    for (std::uint32_t k = 0; k < SceneD::max_levels; ++k) {
        SceneD next;
        next.add(scenes.back(), TransformD{});
        next.commit();
        scenes.push_back(std::move(next));
    }
    EXPECT_EQ(closest_hit(scenes.back(), down).instance, SceneD::max_levels);
    SceneD deeper;
    deeper.add(scenes.back(), TransformD{});
    EXPECT_THROW(deeper.commit(), InputError);
    // Ten times as many paths a level, of one triangle.
    std::vector<SceneD> tens;
    tens.emplace_back(one_triangle());
    std::string said;
    for (int level = 0; level < 10 && said.empty(); ++level) {
        SceneD next;
        for (int k = 0; k < 10; ++k) next.add(tens.back(), moved(k, 0, 0));
        try {
            const std::uint64_t paths = next.commit().paths;
            const auto number_at = [&](double x) {
                return closest_hit(next, {{x + 0.25, 0.25, 1}, 0, {0, 0, -1}}).instance;
            };
            EXPECT_EQ(number_at(0), static_cast<std::uint32_t>(level + 1));
            EXPECT_EQ(number_at(9.0 * (level + 1)), paths);
        } catch (const InputError& error) {
            said = error.what();
        }
        tens.push_back(std::move(next));
    }
    EXPECT_EQ(said, "instance 3: more than 2^32 - 2 paths through instances");
}

TEST(DoubleSceneChanges, TracesWhileAnotherIsCommitted) {
    const MeshD mesh = random_soup_d(300, 4);
    SceneD object(mesh), old;
    for (int k = 0; k < 20; ++k) old.add(object, moved(k, 0, 0));
    old.commit();
    RandomWorlds random(8);
    const std::vector<RayD> rays = random.rays(300, {1, 0.5, 0.5});
    const std::vector<HitD> expected = trace(old, rays);
    std::atomic<std::size_t> wrong = 0;
    std::atomic<bool> done = false;
    std::vector<std::thread> threads;
    for (int t = 0; t < 2; ++t)
        threads.emplace_back([&] {
            do {
                wrong += trace(old, rays, {.threads = 1}) != expected;
                for (std::size_t i = 0; i < rays.size(); i += 7)
                    wrong += closest_hit(old, rays[i]) != expected[i];
            } while (!done);
        });
    for (int round = 0; round < 5; ++round) {
        SceneD next;
        for (int k = 0; k < 20; ++k) next.add(object, moved(0, k + round, 0));
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
