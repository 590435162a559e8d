// Scenes against every mesh on every path on its own, and against scenes made afresh.
#include <gtest/gtest.h>
#include <raydix/error.h>
#include <raydix/result_limit.h>
#include <raydix/scene.h>
#include <raydix/trace.h>
#include <raydix/wide.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <thread>
#include <tuple>
#include <vector>

#include "instances/affine.h"
#include "support/message.h"
#include "support/random.h"
#include "support/support.h"

namespace raydix {
namespace {

constexpr float nan = std::numeric_limits<float>::quiet_NaN();
constexpr std::uint32_t all = 0xFFFFFFFFu;

class Random : public test::Random {
public:
    using test::Random::Random;
    std::uint32_t below(std::uint32_t n) {
        return static_cast<std::uint32_t>(test::Random::below(n));
    }
    /// Turned, stretched, mirrored or not, moved; stretched once more by up to `shear`.
    Transform transform(float reach, float shear) {
        Transform t;
        for (auto& row : t.m) {
            for (std::size_t k = 0; k < 3; ++k) row[k] = between(-1, 1);
            row[3] = between(-reach, reach);
        }
        if (shear > 1) {
            const std::uint32_t to = below(3), from = (to + 1 + below(2)) % 3;
            for (std::size_t k = 0; k < 3; ++k) t.m[to][k] += between(-shear, shear) * t.m[from][k];
        }
        return inverse_of(affine_of(t)) ? t : transform(reach, shear);
    }
    std::uint32_t mask() { return below(3) == 0 ? 1u << below(3) : all; }
};

/// A scene and what is in it, for a judge that looks at everything.
struct World {
    struct Item {
        std::uint32_t id, mask;
        Mesh mesh;
        Transform transform;
        std::shared_ptr<const World> inside;  // of an instance
    };
    std::vector<Item> items;  // by ascending id
    Scene scene;

    [[nodiscard]] std::uint64_t paths() const {
        std::uint64_t sum = 0;
        for (const Item& item : items)
            if (item.inside) sum += 1 + item.inside->paths();
        return sum;
    }
};

struct Sight {
    std::vector<Hit> hits;
    std::vector<std::uint32_t> masks;
};

/// All of `world`, seen by `lines`; `number`: of the path that leads here.
void look(const World& world, const std::vector<WideRayLine>& lines, const std::vector<bool>& sees,
          std::span<const Ray> rays, std::uint32_t number, Sight& sight) {
    std::uint32_t next = number + 1;
    for (const World::Item& item : world.items) {
        std::vector<bool> seen(rays.size());
        for (std::size_t i = 0; i < rays.size(); ++i)
            seen[i] = sees[i] && (item.mask & sight.masks[i]) != 0;
        if (item.inside) {
            const Affine inverse = *inverse_of(affine_of(item.transform));
            std::vector<WideRayLine> inner;
            for (const WideRayLine& line : lines) inner.push_back(line.into(inverse));
            look(*item.inside, inner, seen, rays, next, sight);
            next += 1 + static_cast<std::uint32_t>(item.inside->paths());
            continue;
        }
        std::vector<Ray> entering;
        for (std::size_t i = 0; i < rays.size(); ++i)
            entering.push_back(lines[i].rounded(rays[i].tmin, rays[i].tmax));
        const std::vector<Hit> hits = trace_brute_force(item.mesh, entering, 1);
        for (std::size_t i = 0; i < rays.size(); ++i) {
            if (!seen[i] || !hits[i].hit()) continue;
            const Hit found{hits[i], item.id, number};
            Hit& best = sight.hits[i];
            const auto key = [](const Hit& h) {
                return std::tuple(h.t, h.instance, h.geometry, h.prim);
            };
            if (!best.hit() || key(found) < key(best)) best = found;
        }
    }
}

Sight look(const World& world, std::span<const Ray> rays, std::vector<std::uint32_t> masks) {
    Sight sight{std::vector<Hit>(rays.size()), std::move(masks)};
    std::vector<WideRayLine> lines;
    for (const Ray& ray : rays) lines.push_back({Double3(ray.origin), Double3(ray.direction)});
    look(world, lines, std::vector<bool>(rays.size(), true), rays, 0, sight);
    return sight;
}

bool same(const Hit& a, const Hit& b) {
    return a.t == b.t && a.prim == b.prim && a.u == b.u && a.v == b.v && a.geometry == b.geometry &&
           a.instance == b.instance;
}

struct Recipe {
    std::uint32_t levels, items;
    float shear;
    SceneOptions options = {};
};

std::shared_ptr<World> random_world(Random& random, const Recipe& recipe, std::uint32_t level = 0) {
    auto world = std::make_shared<World>();
    std::vector<std::shared_ptr<World>> inner;
    if (level < recipe.levels)
        for (int k = 0; k < 2; ++k) inner.push_back(random_world(random, recipe, level + 1));
    std::uint32_t id = 0;
    for (std::uint32_t k = 0; k < recipe.items; ++k, ++id) {
        World::Item item{id, random.mask(), {}, {}, {}};
        if (random.below(4) == 0) item.id = id += 1 + random.below(5);
        const GeometryOptions options{item.mask, item.id};
        if (!inner.empty() && random.below(3) != 0) {
            item.inside = inner[random.below(2)];
            item.transform = random.transform(level == 0 ? 4.0f : 2.0f, recipe.shear);
            world->scene.add(item.inside->scene, item.transform, options);
        } else {
            item.mesh = random.below(8) == 0
                            ? Mesh{}
                            : test::random_soup(1 + random.below(40), id + 100 * level, 0.6f);
            world->scene.add(item.mesh, options);
        }
        world->items.push_back(std::move(item));
    }
    world->scene.commit(recipe.options);
    return world;
}

std::vector<Ray> random_rays(Random& random, std::size_t count) {
    std::vector<Ray> rays;
    for (std::size_t i = 0; i < count; ++i) {
        const Vec3 from = i % 3 == 0 ? random.in(-6, 6) : random.in(-2, 3),
                   to = i % 2 == 0 ? random.in(0, 1) : random.in(-3, 3);
        const Vec3 way{to.x - from.x, to.y - from.y, to.z - from.z};
        Ray ray{from, 0, i % 11 == 0 ? Vec3{way.x * 100, way.y * 100, way.z * 100} : way};
        if (i % 5 == 0) ray.tmax = random.between(0.2f, 1.0f);
        if (i % 7 == 0) ray.tmin = random.between(0.0f, 0.5f);
        if (i % 97 == 0) ray.direction = {0, 0, 0};
        if (i % 89 == 0) ray.origin.x = nan;
        rays.push_back(ray);
    }
    return rays;
}

/// Rays that end, or begin, where they hit: the bounds of boxes decide.
std::vector<Ray> rays_to_hits(std::span<const Ray> rays, std::span<const Hit> hits) {
    std::vector<Ray> out;
    for (std::size_t i = 0; i < rays.size(); ++i) {
        if (!hits[i].hit()) continue;
        out.push_back(rays[i]);
        out.back().tmax = hits[i].t;
        out.push_back(rays[i]);
        out.back().tmin = hits[i].t;
        out.push_back(out.back());
        out.back().tmax = hits[i].t;
    }
    return out;
}

/// How many answers differ from those of the judge, every way through the scene.
std::size_t differences(const World& world, std::span<const Ray> rays,
                        const std::vector<std::uint32_t>& masks) {
    const Sight sight = look(world, rays, masks);
    std::size_t wrong = 0;
    for (const std::string& isa : simd_instruction_sets()) {
        for (const SimdPath path : {SimdPath::automatic, SimdPath::single, SimdPath::packet,
                                    SimdPath::stream, SimdPath::sorted}) {
            SceneTraceOptions options;
            options.masks = masks, options.isa = isa, options.path = path;
            options.threads = 1 + static_cast<int>(path) % 2;
            const std::vector<Hit> hits = trace(world.scene, rays, options);
            std::vector<std::uint8_t> occluded(rays.size(), 7);
            trace_any(world.scene, rays, occluded, options);
            for (std::size_t i = 0; i < rays.size(); ++i) {
                wrong += !same(hits[i], sight.hits[i]);
                wrong += occluded[i] != (sight.hits[i].hit() ? 1 : 0);
            }
        }
    }
    for (std::size_t i = 0; i < rays.size(); ++i) {
        wrong += !same(closest_hit(world.scene, rays[i], masks[i]), sight.hits[i]);
        wrong += any_hit(world.scene, rays[i], masks[i]) != sight.hits[i].hit();
    }
    return wrong;
}

std::size_t differences_with_ends(const World& world, Random& random, std::size_t count,
                                  std::size_t& hit_count) {
    const std::vector<Ray> rays = random_rays(random, count);
    std::vector<std::uint32_t> masks;
    for (std::size_t i = 0; i < rays.size(); ++i) masks.push_back(i % 16 == 15 ? 0 : random.mask());
    std::size_t wrong = differences(world, rays, masks);
    const Sight sight = look(world, rays, std::vector<std::uint32_t>(rays.size(), all));
    for (const Hit& hit : sight.hits) hit_count += hit.hit();
    const std::vector<Ray> ends = rays_to_hits(rays, sight.hits);
    return wrong + differences(world, ends, std::vector<std::uint32_t>(ends.size(), all));
}

constexpr int worlds = 3 * static_cast<int>(test::thorough);

TEST(Scene, AnswersAreThoseOfEveryMeshOnEveryPath) {
    std::size_t hits = 0;
    for (std::uint32_t levels = 0; levels < 4; ++levels)
        for (int k = 0; k < worlds; ++k) {
            Random random(100 * levels + static_cast<std::uint64_t>(k));
            Recipe recipe{levels, 1 + random.below(levels == 3 ? 4 : 7), 0};
            recipe.options.usage = k % 2 == 0 ? Usage::fixed : Usage::moving;
            recipe.options.compact = k % 3 == 0;
            const auto world = random_world(random, recipe);
            EXPECT_EQ(differences_with_ends(*world, random, 200, hits), 0u)
                << "levels " << levels << ", world " << k;
        }
    EXPECT_GT(hits, 300u * test::thorough);
}

TEST(Scene, ShearedInstancesLoseNoHits) {
    std::size_t hits = 0;
    for (const float shear : {10.0f, 1e2f, 1e3f, 1e4f})
        for (int k = 0; k < worlds; ++k) {
            Random random(static_cast<std::uint64_t>(shear) + static_cast<std::uint64_t>(k));
            const auto world = random_world(random, {1 + random.below(3), 4, shear});
            EXPECT_EQ(differences_with_ends(*world, random, 150, hits), 0u)
                << "shear " << shear << ", world " << k;
        }
    EXPECT_GT(hits, 300u * test::thorough);
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
    for (std::uint64_t seed = 0; seed < test::thorough; ++seed) {
        Random random(1000 + seed);
        Recipe recipe{static_cast<std::uint32_t>(seed % 4), 4, 0};
        recipe.options.quality = seed % 2 == 0 ? Quality::balanced : Quality::high;
        recipe.options.compact = seed % 3 == 0;
        const auto world = random_world(random, recipe);
        const std::vector<Ray> rays = random_rays(random, 150);
        const std::uint32_t mask = seed % 5 == 0 ? 2u : all;
        const auto rows = look_for_all(*world, rays, mask);
        for (const std::string& isa : simd_instruction_sets()) {
            SceneTraceOptions options;
            options.mask = mask, options.isa = isa,
            options.threads = 1 + static_cast<int>(seed % 2);
            const AllHits hits = trace_all(world->scene, rays, options);
            ASSERT_EQ(hits.offsets.size(), rays.size() + 1);
            EXPECT_EQ(hits.counts.hits, hits.hits.size());
            for (std::size_t i = 0; i < rays.size(); ++i) {
                const auto first = hits.hits.begin() + static_cast<std::ptrdiff_t>(hits.offsets[i]);
                const std::vector<Hit> row(
                    first, hits.hits.begin() + static_cast<std::ptrdiff_t>(hits.offsets[i + 1]));
                EXPECT_TRUE(std::ranges::equal(row, rows[i], same))
                    << "seed " << seed << ", ray " << i;
                found += row.size();
            }
        }
    }
    EXPECT_GT(found, 100u * test::thorough);
}

TEST(Scene, AllHitsKeepToTheirMemory) {
    Scene object(test::random_soup(200, 3, 2.0f)), scene;
    for (int k = 0; k < 50; ++k) scene.add(object, Transform{});
    scene.commit();
    const std::vector<Ray> rays(1000, Ray{{0.4f, 0.4f, 9}, 0, {0, 0.01f, -1}});
    SceneTraceOptions options;
    options.max_result_bytes = 100000;
    EXPECT_THROW(static_cast<void>(trace_all(scene, rays, options)), ResultTooLarge);
}

Mesh one_triangle(float z) {
    Mesh mesh;
    mesh.vertices = {{0, 0, z}, {1, 0, z}, {0, 1, z}};
    mesh.triangles = {{0, 1, 2}};
    return mesh;
}

Transform moved(float x, float y, float z) {
    Transform t;
    t.m[0][3] = x, t.m[1][3] = y, t.m[2][3] = z;
    return t;
}

constexpr Ray down{{0.25f, 0.25f, 10}, 0, {0, 0, -1}};

TEST(Scene, OfOneMeshGivesTheHitsOfItsTree) {
    const Mesh mesh = test::random_soup(2000, 5);
    Random random(6);
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

TEST(Scene, ChangesInAnyOrderEqualASceneMadeAfresh) {
    for (std::uint64_t seed = 0; seed < 3 * test::thorough; ++seed) {
        Random random(seed);
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
                        0, random.mask(), test::random_soup(20, random.below(99), 0.6f), {}, {}};
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
                                       item.mesh = test::random_soup(30, random.below(99), 0.6f));
                }
            }
            EXPECT_FALSE(world.scene.committed());
            SceneOptions options;
            options.usage = step % 2 == 0 ? Usage::moving : Usage::fixed;
            world.scene.commit(options);
            EXPECT_TRUE(world.scene.committed());
            EXPECT_EQ(world.scene.size(), world.items.size());
            EXPECT_EQ(differences(world, rays, std::vector<std::uint32_t>(rays.size(), all)), 0u)
                << "seed " << seed << ", step " << step;
        }
    }
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
    EXPECT_EQ(scene.mask(2), all);
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
}

TEST(Scene, TellsWhatItHolds) {
    tells_what_it_holds<Scene>();
    tells_what_it_holds<SceneD>();
}

TEST(Scene, MovingMeshesAreBuiltOnlyWhenTheyChange) {
    Scene scene;
    for (int k = 0; k < 5; ++k) scene.add(test::random_soup(50, static_cast<std::uint64_t>(k)));
    const SceneOptions moving{.usage = Usage::moving};
    EXPECT_EQ(scene.commit(moving).trees_built, 5u);
    EXPECT_EQ(scene.commit(moving).trees_built, 0u);
    scene.update(3, test::random_soup(60, 9));
    scene.set_mask(1, 7);
    EXPECT_EQ(scene.commit(moving).trees_built, 1u);
    // Four meshes share a tree now; the one of another mask keeps its own.
    EXPECT_EQ(scene.commit({.usage = Usage::fixed}).trees_built, 1u);
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

TEST(Scene, RefusesWhatItCannotHold) {
    Scene scene, other;
    const auto message = [](const auto& call) { return test::message_of(call); };
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

TEST(Scene, LimitsOfNesting) {
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
    EXPECT_EQ(closest_hit(scenes.back(), down).instance, Scene::max_levels);
    EXPECT_EQ(trace(scenes.back(), std::vector<Ray>(40, down))[7].instance, Scene::max_levels);
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

TEST(Scene, TracesWhileAnotherIsCommitted) {
    const Mesh mesh = test::random_soup(300, 4);
    Scene object(mesh), old;
    for (int k = 0; k < 20; ++k) old.add(object, moved(static_cast<float>(k), 0, 0));
    old.commit();
    Random random(8);
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
}  // namespace raydix
