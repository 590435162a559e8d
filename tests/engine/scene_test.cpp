// Scenes against every mesh on every path on its own.
#include <gtest/gtest.h>
#include <raydix/error.h>
#include <raydix/result_limit.h>
#include <raydix/scene.h>
#include <raydix/trace.h>
#include <raydix/wide.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "engine/affine.h"
#include "engine/float_world.h"
#include "support/support.h"

namespace raydix::test {
namespace {

constexpr int worlds = 3 * static_cast<int>(thorough);

TEST(Scene, AnswersAreThoseOfEveryMeshOnEveryPath) {
    std::size_t hits = 0;
    for (std::uint32_t levels = 0; levels < 4; ++levels)
        for (int k = 0; k < worlds; ++k) {
            RandomScenes random(100 * levels + static_cast<std::uint64_t>(k));
            Recipe recipe{levels, 1 + random.below(levels == 3 ? 4 : 7), 0};
            recipe.options.usage = k % 2 == 0 ? Usage::fixed : Usage::moving;
            recipe.options.compact = k % 3 == 0;
            const auto world = random_world(random, recipe);
            EXPECT_EQ(differences_with_ends(*world, random, 200, hits), 0u)
                << "levels " << levels << ", world " << k;
        }
    EXPECT_GT(hits, 300u * thorough);
}

TEST(Scene, ShearedInstancesLoseNoHits) {
    std::size_t hits = 0;
    for (const float shear : {10.0f, 1e2f, 1e3f, 1e4f})
        for (int k = 0; k < worlds; ++k) {
            RandomScenes random(static_cast<std::uint64_t>(shear) + static_cast<std::uint64_t>(k));
            const auto world = random_world(random, {1 + random.below(3), 4, shear});
            EXPECT_EQ(differences_with_ends(*world, random, 150, hits), 0u)
                << "shear " << shear << ", world " << k;
        }
    EXPECT_GT(hits, 300u * thorough);
}

/// All hits of every mesh on every path, ends as the rays have them.
std::vector<std::vector<Hit>> look_for_all(const World& world, std::span<const Ray> rays,
                                           std::uint32_t mask) {
    std::vector<std::vector<Hit>> rows(rays.size());
    const std::function<void(const World&, const std::vector<WideRayLine>&, std::uint32_t)> visit =
        [&](const World& at, const std::vector<WideRayLine>& lines, std::uint32_t number) {
            std::uint32_t next = number + 1;
            for (const World::Item& item : at.items) {
                const bool seen = (item.mask & mask) != 0;
                if (item.inside) {
                    const Affine inverse = *inverse_of(affine_of(item.transform));
                    std::vector<WideRayLine> inner;
                    for (const WideRayLine& line : lines) inner.push_back(line.into(inverse));
                    if (seen) visit(*item.inside, inner, next);
                    next += 1 + static_cast<std::uint32_t>(item.inside->paths());
                    continue;
                }
                if (!seen || item.mesh.triangles.empty()) continue;
                std::vector<Ray> entering;
                for (std::size_t i = 0; i < rays.size(); ++i)
                    entering.push_back(lines[i].rounded(rays[i].tmin, rays[i].tmax));
                const AllHits hits = trace_all(build_bvh(item.mesh), entering, {.threads = 1});
                for (std::size_t i = 0; i < rays.size(); ++i)
                    for (std::uint64_t k = hits.offsets[i]; k < hits.offsets[i + 1]; ++k)
                        rows[i].push_back({hits.hits[k], item.id, number});
            }
        };
    std::vector<WideRayLine> lines;
    for (const Ray& ray : rays) lines.push_back({Double3(ray.origin), Double3(ray.direction)});
    visit(world, lines, 0);
    for (auto& row : rows)
        std::ranges::sort(
            row, {}, [](const Hit& h) { return std::tuple(h.t, h.instance, h.geometry, h.prim); });
    return rows;
}

TEST(Scene, AllHitsAreThoseOfEveryMeshOnEveryPath) {
    std::size_t found = 0;
    for (std::uint64_t seed = 0; seed < thorough; ++seed) {
        RandomScenes random(1000 + seed);
        Recipe recipe{static_cast<std::uint32_t>(seed % 4), 4, 0};
        recipe.options.quality = seed % 2 == 0 ? Quality::balanced : Quality::high;
        recipe.options.compact = seed % 3 == 0;
        const auto world = random_world(random, recipe);
        std::vector<Ray> rays = random_rays(random, 150);
        const std::vector<Ray> together = bundles_of_rays(random, 3, 50);
        rays.insert(rays.end(), together.begin(), together.end());
        const std::uint32_t mask = seed % 5 == 0 ? 2u : every_mask;
        const auto rows = look_for_all(*world, rays, mask);
        for (const std::string& isa : simd_instruction_sets())
            for (const SimdPath path :
                 {SimdPath::automatic, SimdPath::single, SimdPath::packet, SimdPath::stream}) {
                SceneTraceOptions options;
                options.mask = mask, options.isa = isa, options.path = path;
                options.threads = 1 + static_cast<int>(seed % 2);
                const AllHits hits = trace_all(world->scene, rays, options);
                ASSERT_EQ(hits.offsets.size(), rays.size() + 1);
                EXPECT_EQ(hits.counts.hits, hits.hits.size());
                for (std::size_t i = 0; i < rays.size(); ++i) {
                    const std::span<const Hit> row(hits.hits.data() + hits.offsets[i],
                                                   hits.offsets[i + 1] - hits.offsets[i]);
                    EXPECT_TRUE(std::ranges::equal(row, rows[i], same))
                        << "seed " << seed << ", ray " << i << ", " << simd_path_name(path);
                    found += row.size();
                }
            }
    }
    EXPECT_GT(found, 400u * thorough);  // with one instruction set
}

/// All hits by all ways are those of rays that go alone.
void expect_all_hits_by_every_path(const Scene& scene, std::span<const Ray> rays,
                                   SceneTraceOptions options) {
    options.path = SimdPath::single;
    const AllHits alone = trace_all(scene, rays, options);
    EXPECT_GT(alone.hits.size(), 0u);
    for (const SimdPath path : {SimdPath::automatic, SimdPath::packet, SimdPath::stream}) {
        options.path = path;
        const AllHits hits = trace_all(scene, rays, options);
        EXPECT_EQ(hits.offsets, alone.offsets) << simd_path_name(path);
        EXPECT_TRUE(std::ranges::equal(hits.hits, alone.hits, same)) << simd_path_name(path);
        EXPECT_EQ(hits.counts.invalid_rays, alone.counts.invalid_rays);
    }
}

/// A thousand million places: a number of a path leaves little room in a word for that of a ray.
TEST(Scene, AllHitsWhereThereAreManyPaths) {
    constexpr std::uint32_t copies = 1000;
    Mesh mesh;
    mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    mesh.triangles = {{0, 1, 2}};
    Scene all(mesh);
    for (std::size_t axis = 0; axis < 3; ++axis) {  // a line, an area, a block
        Scene row;
        for (std::uint32_t k = 0; k < copies; ++k) {
            Transform place;
            place.m[axis][3] = static_cast<float>(k);
            row.add(all, place);
        }
        row.commit();
        all = std::move(row);
    }
    std::vector<Ray> rays;
    for (std::uint32_t i = 0; i < 100; ++i) {
        const float at = static_cast<float>(9 * i);
        rays.push_back({{at + 0.25f, 900.25f - at, at - 0.5f}, 0, {0, 0, 1}, 2});
    }
    expect_all_hits_by_every_path(all, rays, {});
    EXPECT_EQ(trace_all(all, rays).hits.size(), 2 * rays.size());
}

TEST(Scene, AllHitsOfShapesTogetherAreThoseOfRaysAlone) {
    for (std::uint32_t levels = 0; levels < 4; ++levels) {
        RandomScenes random(1300 + levels);
        Recipe recipe{levels, 5, 0};
        recipe.shapes = true;
        const auto world = random_world(random, recipe);
        std::vector<Ray> rays = bundles_of_rays(random, 20, 100);
        const std::vector<Ray> others = random_rays(random, 400);
        rays.insert(rays.end(), others.begin(), others.end());
        std::vector<std::uint32_t> masks(rays.size());
        for (std::size_t i = 0; i < rays.size(); ++i) masks[i] = i % 9 == 0 ? 2u : every_mask;
        for (const std::string& isa : simd_instruction_sets()) {
            SceneTraceOptions options;
            options.isa = isa;
            expect_all_hits_by_every_path(world->scene, rays, options);
            options.masks = masks;
            expect_all_hits_by_every_path(world->scene, rays, options);
        }
    }
}

/// Numbers of paths and of rays have no room beside each other in 32 bits.
TEST(Scene, AllHitsThroughFourMillionPaths) {
    constexpr std::uint32_t side = 2100;
    const auto row_of = [](const Scene& what, Vec3 step) {
        Scene row;
        for (std::uint32_t k = 0; k < side; ++k) {
            Transform at;
            at.m[0][3] = step.x * static_cast<float>(k);
            at.m[1][3] = step.y * static_cast<float>(k);
            row.add(what, at);
        }
        row.commit();
        return row;
    };
    const Scene all = row_of(row_of(Scene(random_soup(20, 3, 1.0f)), {1, 0, 0}), {0, 1, 0});
    std::vector<Ray> rays;
    for (int k = 0; k < 200; ++k) {
        const float x = 2090 + 0.02f * static_cast<float>(k);
        rays.push_back({{x, 2095, 9}, 0, {0, 0.001f, -1}});
    }
    expect_all_hits_by_every_path(all, rays, {});
    const AllHits hits = trace_all(all, rays);
    const auto last = std::ranges::max_element(hits.hits, {}, &Hit::instance);
    EXPECT_GT(last->instance, 1u << 22);
}

TEST(Scene, AllHitsKeepToTheirMemory) {
    Scene object(random_soup(200, 3, 2.0f)), scene;
    for (int k = 0; k < 50; ++k) scene.add(object, Transform{});
    scene.commit();
    const std::vector<Ray> rays(1000, Ray{{0.4f, 0.4f, 9}, 0, {0, 0.01f, -1}});
    SceneTraceOptions options;
    options.max_result_bytes = 100000;
    EXPECT_THROW(static_cast<void>(trace_all(scene, rays, options)), ResultTooLarge);
}

constexpr Ray down{{0.25f, 0.25f, 10}, 0, {0, 0, -1}};

TEST(Scene, OfOneMeshGivesTheHitsOfItsTree) {
    const Mesh mesh = random_soup(2000, 5);
    RandomScenes random(6);
    const std::vector<Ray> rays = random_rays(random, 3000);
    const Scene scene(mesh);
    const std::vector<Hit> expected = trace(build_wide_bvh(mesh), rays);
    const std::vector<Hit> hits = trace(scene, rays);
    std::size_t found = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
        Hit wanted{expected[i], no_primitive, 0};
        if (expected[i].hit()) wanted.geometry = 0, ++found;
        EXPECT_TRUE(same(hits[i], wanted)) << i;
        EXPECT_TRUE(same(closest_hit(scene, rays[i]), wanted)) << i;
    }
    EXPECT_GT(found, 100u);
}

TEST(Scene, TiesGoToTheLeastInstanceThenGeometryThenTriangle) {
    Mesh twice = one_triangle(0);
    twice.triangles.push_back(twice.triangles[0]);
    Scene inner(twice), scene;
    scene.add(inner, Transform{});
    EXPECT_EQ(scene.commit().paths, 1u);
    EXPECT_TRUE(same(closest_hit(scene, down), {{10, 0, 0.25f, 0.25f}, 0, 1}));
    scene.add(one_triangle(0));
    scene.add(one_triangle(0));
    scene.commit();
    EXPECT_TRUE(same(closest_hit(scene, down), {{10, 0, 0.25f, 0.25f}, 1, 0}));
    for (const Usage usage : {Usage::fixed, Usage::moving}) {
        scene.commit({.usage = usage});
        const std::vector<Hit> hits = trace(scene, std::vector<Ray>(100, down));
        for (const Hit& hit : hits) EXPECT_EQ(hit.geometry, 1u);
    }
}

TEST(Scene, PathsAreCountedDepthFirst) {
    Scene mesh(one_triangle(0)), pair, scene;
    pair.add(mesh, moved(0, 0, 0), {.id = 3});
    pair.add(mesh, moved(2, 0, 0));  // id 0
    pair.commit();
    scene.add(pair, moved(0, 0, 0), {.id = 7});
    scene.add(pair, moved(10, 0, 0));
    EXPECT_EQ(scene.commit().paths, 6u);
    const auto at = [&](float x) {
        return closest_hit(scene, {{x + 0.25f, 0.25f, 1}, 0, {0, 0, -1}});
    };
    EXPECT_EQ(at(12).instance, 2u);
    EXPECT_EQ(at(10).instance, 3u);
    EXPECT_EQ(at(2).instance, 5u);
    EXPECT_EQ(at(0).instance, 6u);
    EXPECT_EQ(scene.path(0), std::vector<std::uint32_t>{});
    EXPECT_EQ(scene.path(1), std::vector<std::uint32_t>{0});
    EXPECT_EQ(scene.path(2), (std::vector<std::uint32_t>{0, 0}));
    EXPECT_EQ(scene.path(3), (std::vector<std::uint32_t>{0, 3}));
    EXPECT_EQ(scene.path(6), (std::vector<std::uint32_t>{7, 3}));
    EXPECT_THROW(static_cast<void>(scene.path(7)), InputError);
}

TEST(Scene, HitsNameMeshesOfAnySize) {
    Scene scene;
    std::vector<std::pair<std::uint32_t, std::size_t>> wanted;
    for (std::size_t k = 0; k < 60; ++k) {
        const std::size_t triangles = k == 20 ? 5000 : k % 7 == 3 ? 0 : 1 + k % 3;
        Mesh mesh;
        for (std::size_t i = 0; i < triangles; ++i) {
            const auto x = static_cast<float>(2 * wanted.size());
            const auto v = static_cast<std::uint32_t>(mesh.vertices.size());
            mesh.vertices.insert(mesh.vertices.end(), {{x, 0, 0}, {x + 1, 0, 0}, {x, 1, 0}});
            mesh.triangles.push_back({v, v + 1, v + 2});
            wanted.emplace_back(static_cast<std::uint32_t>(k), i);
        }
        scene.add(mesh);
    }
    scene.commit();
    for (std::size_t k = 0; k < wanted.size(); ++k) {
        const Hit hit =
            closest_hit(scene, {{static_cast<float>(2 * k) + 0.25f, 0.25f, 1}, 0, {0, 0, -1}});
        EXPECT_EQ(hit.geometry, wanted[k].first) << k;
        EXPECT_EQ(hit.prim, wanted[k].second) << k;
    }
}

TEST(Scene, NothingToHit) {
    Scene empty;
    EXPECT_THROW(static_cast<void>(closest_hit(empty, down)), InputError);
    empty.commit();
    EXPECT_FALSE(closest_hit(empty, down).hit());
    EXPECT_GT(empty.bounds().lo.x, empty.bounds().hi.x);
    Scene scene;
    scene.add(empty, Transform{});
    scene.add(Mesh{});
    scene.add(one_triangle(0), {.mask = 0, .id = {}});
    scene.commit();
    for (const Hit& hit : trace(scene, std::vector<Ray>(50, down))) EXPECT_FALSE(hit.hit());
    EXPECT_TRUE(trace(scene, std::vector<Ray>{}).empty());
}

}  // namespace
}  // namespace raydix::test
