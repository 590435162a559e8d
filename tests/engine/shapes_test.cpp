// Spheres, capsules, points and geometry of a user's own in scenes, against each of them alone.
#include <gtest/gtest.h>
#include <raydix/error.h>
#include <raydix/scene.h>
#include <raydix/surface.h>
#include <raydix/user_geometry.h>
#include <raydix/wide.h>

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "engine/float_world.h"
#include "support/sanitized.h"
#include "support/support.h"

namespace raydix::test {
namespace {

TEST(Shapes, MixedScenesAnswerAsEachShapeDoes) {
    std::size_t hits = 0;
    for (std::uint32_t levels = 0; levels < 4; ++levels)
        for (int k = 0; k < 4 * static_cast<int>(thorough); ++k) {
            RandomScenes random(5000 + 100 * levels + static_cast<std::uint64_t>(k));
            Recipe recipe{levels, 1 + random.below(levels == 3 ? 4 : 7),
                          k % 3 == 0 ? 100.0f : 0.0f};
            recipe.shapes = true;
            recipe.options.usage = k % 2 == 0 ? Usage::fixed : Usage::moving;
            const auto world = random_world(random, recipe);
            EXPECT_EQ(differences_with_ends(*world, random, 200, hits), 0u)
                << "levels " << levels << ", world " << k;
        }
    EXPECT_GT(hits, 300u * thorough);
}

/// Refuses about half of all that there is, by what it is.
bool takes(std::size_t place, const Ray& ray, const Hit& hit) {
    const std::uint32_t mix = hit.prim * 2654435761u + hit.geometry * 40503u + hit.instance * 97u +
                              static_cast<std::uint32_t>(place % 3);
    return ((mix >> 7) & 1) == 0 && ray.tmin <= ray.tmax;
}

TEST(Filters, GiveTheFirstHitOfAllThatTheyTake) {
    std::size_t refused = 0, found = 0;
    for (std::uint32_t levels = 0; levels < 3; ++levels)
        for (int k = 0; k < 3 * static_cast<int>(thorough); ++k) {
            RandomScenes random(7000 + 100 * levels + static_cast<std::uint64_t>(k));
            Recipe recipe{levels, 2 + random.below(6), 0};
            recipe.shapes = k % 2 == 0;
            recipe.options.compact = k % 3 == 0;
            const auto world = random_world(random, recipe);
            const std::vector<Ray> rays = random_rays(random, 300);
            SceneTraceOptions options;
            const AllHits all = trace_all(world->scene, rays, options);
            options.filter = takes;
            // Closed edges for closest hits, half open ones for all: rays here meet none.
            std::vector<Hit> expected(rays.size());
            std::vector<std::uint64_t> counts(rays.size());
            for (std::size_t i = 0; i < rays.size(); ++i)
                for (std::uint64_t h = all.offsets[i]; h < all.offsets[i + 1]; ++h) {
                    if (!takes(i, rays[i], all.hits[h])) {
                        ++refused;
                        continue;
                    }
                    if (!expected[i].hit()) expected[i] = all.hits[h];
                    ++counts[i];
                }
            for (const std::string& isa : simd_instruction_sets())
                for (const SimdPath path : {SimdPath::automatic, SimdPath::single, SimdPath::packet,
                                            SimdPath::stream, SimdPath::sorted}) {
                    options.isa = isa, options.path = path;
                    const std::vector<Hit> hits = trace(world->scene, rays, options);
                    std::vector<std::uint8_t> occluded(rays.size());
                    trace_any(world->scene, rays, occluded, options);
                    const AllHits some = trace_all(world->scene, rays, options);
                    std::size_t wrong = 0;
                    for (std::size_t i = 0; i < rays.size(); ++i) {
                        wrong += !same(hits[i], expected[i]);
                        wrong += (occluded[i] != 0) != expected[i].hit();
                        wrong += some.offsets[i + 1] - some.offsets[i] != counts[i];
                        found += expected[i].hit();
                    }
                    EXPECT_EQ(wrong, 0u) << "levels " << levels << ", world " << k << ", " << isa
                                         << ", " << simd_path_name(path);
                }
            for (std::size_t i = 0; i < rays.size(); ++i) {
                const HitFilter one = [i](std::size_t place, const Ray& ray, const Hit& hit) {
                    return place == 0 && takes(i, ray, hit);
                };
                EXPECT_TRUE(same(closest_hit(world->scene, rays[i], one), expected[i]));
                EXPECT_EQ(any_hit(world->scene, rays[i], one), expected[i].hit());
            }
        }
    EXPECT_GT(refused, 300u * thorough);
    EXPECT_GT(found, 300u * thorough);
}

/// Parallel rays, so that whole packets are of one class; `shuffled`: in any order.
std::vector<Ray> many_rays(std::size_t count, bool shuffled) {
    RandomScenes random(31);
    std::vector<Ray> rays;
    for (std::size_t i = 0; i < count; ++i) {
        const Vec3 at = random.in(0, 1);
        const float along = static_cast<float>(i) / static_cast<float>(count);
        rays.push_back(shuffled ? Ray{at, 0, random.in(-1, 1)}
                                : Ray{{along, at.y * 1e-3f + 0.5f, 3}, 0, {0.01f, 0.02f, -1}});
    }
    return rays;
}

TEST(Filters, KnowTheRayThatHits) {
    const Mesh mesh = random_soup(3000, 8);
    Scene one(mesh), placed;
    placed.add(mesh);
    placed.add(one, moved(0.1f, 0, 0));
    std::vector<Sphere> spheres;
    RandomScenes random(9);
    for (int k = 0; k < 200; ++k) spheres.push_back({random.in(0, 1), 0.05f});
    placed.add(std::span<const Sphere>(spheres));
    placed.commit();
    for (const bool shuffled : {false, true}) {
        const std::vector<Ray> rays = many_rays(sanitized ? 3000 : 150000, shuffled);
        for (const Scene* const scene : {&one, &placed})
            for (const SimdPath path : {SimdPath::automatic, SimdPath::packet}) {
                std::atomic<std::size_t> asked{0}, wrong{0};
                SceneTraceOptions options;
                options.path = path;
                const std::vector<Hit> all = trace(*scene, rays, options);
                options.filter = [&](std::size_t place, const Ray& ray, const Hit& hit) {
                    ++asked;
                    const Ray& given = rays[place];
                    wrong += given.origin.x != ray.origin.x || given.origin.y != ray.origin.y ||
                             given.direction.x != ray.direction.x || !hit.hit() ||
                             hit.geometry == no_primitive || hit.t < all[place].t;
                    return true;
                };
                const std::vector<Hit> hits = trace(*scene, rays, options);
                EXPECT_TRUE(std::ranges::equal(hits, all, same));
                EXPECT_GT(asked, rays.size() / 8);
                EXPECT_EQ(wrong, 0u) << simd_path_name(path) << ", shuffled " << shuffled;
            }
    }
}

/// A scene of one mesh has a way of its own for these: rays like the last, and odd ones.
TEST(Filters, OfSingleCallsThroughOneMesh) {
    const Mesh mesh = random_soup(2000, 17, 0.2f);
    std::vector<Ray> rays = many_rays(600, false);
    const std::vector<Ray> others = many_rays(600, true);
    rays.insert(rays.end(), others.begin(), others.end());
    const auto scaled = [&](float by) {
        for (std::size_t k = 0; k < 100; ++k) {
            Ray ray = others[k];
            ray.direction = ray.direction * by;
            rays.push_back(ray);
        }
    };
    for (const float by : {0x1p-60f, 0x1p60f, 0x1p-130f}) scaled(by);
    rays.push_back({{0.5f, 0.5f, 3}, 2, {0, 0, -1}, 1});
    rays.push_back({{0.5f, 0.5f, 3}, 0, {0, 0, 0}});
    rays.push_back({{std::numeric_limits<float>::quiet_NaN(), 0.5f, 3}, 0, {0, 0, -1}});
    for (const bool compact : {false, true}) {
        Scene scene;
        scene.add(mesh, {.mask = 0b10u});
        scene.commit({.compact = compact});
        std::size_t found = 0, asked = 0;
        const AllHits all = trace_all(scene, rays);
        for (std::size_t i = 0; i < rays.size(); ++i) {
            const HitFilter filter = [&](std::size_t place, const Ray& ray, const Hit& hit) {
                ++asked;
                EXPECT_EQ(&ray, &rays[i]);
                return place == 0 && hit.geometry == 0 && hit.instance == 0 && takes(i, ray, hit);
            };
            Hit expected;
            for (std::uint64_t h = all.offsets[i]; h < all.offsets[i + 1]; ++h)
                if (takes(i, rays[i], all.hits[h])) {
                    expected = all.hits[h];
                    break;
                }
            EXPECT_TRUE(same(closest_hit(scene, rays[i], filter), expected)) << i;
            EXPECT_EQ(any_hit(scene, rays[i], filter), expected.hit()) << i;
            found += expected.hit();
            const std::size_t before = asked;
            EXPECT_FALSE(closest_hit(scene, rays[i], filter, 0b01u).hit());
            EXPECT_FALSE(any_hit(scene, rays[i], filter, 0b01u));
            EXPECT_EQ(asked, before);
        }
        EXPECT_GT(found, 300u);
    }
    EXPECT_FALSE(closest_hit(Scene(Mesh{}), rays[0], takes).hit());
    EXPECT_FALSE(any_hit(Scene(Mesh{}), rays[0], takes));
}

TEST(Filters, OfSingleCallsMayThrow) {
    struct Stop {};
    const Scene scene(random_soup(500, 2));
    const std::vector<Ray> rays = many_rays(64, false);
    const HitFilter stops = [](std::size_t, const Ray&, const Hit&) -> bool { throw Stop(); };
    std::size_t thrown = 0;
    for (const Ray& ray : rays) {
        const Hit hit = closest_hit(scene, ray);
        if (!hit.hit()) continue;
        ++thrown;
        EXPECT_THROW(static_cast<void>(closest_hit(scene, ray, stops)), Stop);
        EXPECT_THROW(static_cast<void>(any_hit(scene, ray, stops)), Stop);
        EXPECT_TRUE(same(closest_hit(scene, ray), hit));
    }
    EXPECT_GT(thrown, 0u);
}

/// A plate across z, of a side each, in boxes of which some are left out.
struct Plates {
    std::vector<Aabb> boxes;

    bool hit(std::uint32_t prim, const Ray& ray, Hit& hit) const {
        const Aabb& box = boxes[prim];
        const float t = (box.lo.z - ray.origin.z) / ray.direction.z;
        if (!(t >= ray.tmin && t <= ray.tmax)) return false;
        const float x = ray.origin.x + t * ray.direction.x, y = ray.origin.y + t * ray.direction.y;
        hit.t = t, hit.u = x, hit.v = y;
        return x >= box.lo.x && x <= box.hi.x && y >= box.lo.y && y <= box.hi.y;
    }
    void move(float by) {
        for (Aabb& box : boxes) box.lo.z += by, box.hi.z += by;
    }
};

/// Of all plates, one after the other.
Hit first_plate(const Plates& plates, Ray ray, std::uint32_t geometry) {
    Hit best;
    for (std::uint32_t prim = 0; prim < plates.boxes.size(); ++prim) {
        Hit hit;
        if (!std::isfinite(plates.boxes[prim].lo.x) || !plates.hit(prim, ray, hit)) continue;
        if (best.hit() && hit.t >= best.t) continue;
        best = hit;
        best.prim = prim, best.geometry = geometry, best.instance = 0;
        ray.tmax = hit.t;
    }
    return best;
}

TEST(UserShapes, KeepTheirNumbersWhereSomeAreLeftOutAndOthersMove) {
    // Few and many: those lie in a cache, these do not. Leaves name primitives, not places.
    for (const std::uint32_t count : {60u, sanitized ? 2000u : 30000u}) {
        RandomScenes random(41);
        Plates plates;
        const float side = 0.7f / std::sqrt(static_cast<float>(count));
        for (std::uint32_t k = 0; k < count; ++k) {
            const Vec3 at = random.in(0, 1);
            plates.boxes.push_back(
                {{at.x, at.y, at.z}, {at.x + 2 * side, at.y + 2 * side, at.z + 1e-4f}});
            if (k % 7 == 3) plates.boxes.back().lo.x = infinity;
        }
        const auto geometry = [&] {
            return UserGeometry(plates.boxes,
                                [&plates](std::uint32_t prim, const Ray& ray, Hit& hit) {
                                    return plates.hit(prim, ray, hit);
                                });
        };
        Scene scene;
        const std::uint32_t id = scene.add(geometry());
        for (int round = 0; round < 3; ++round) {
            const CommitReport report = scene.commit({.usage = Usage::moving});
            EXPECT_EQ(report.trees_refitted, round > 0 ? 1u : 0u);
            std::vector<Ray> rays = many_rays(300, false);
            for (const Ray& ray : many_rays(300, true)) rays.push_back(ray);
            std::vector<Hit> expected;
            std::size_t found = 0;
            for (const Ray& ray : rays) {
                expected.push_back(first_plate(plates, ray, id));
                found += expected.back().hit();
                EXPECT_TRUE(same(closest_hit(scene, ray), expected.back()));
                EXPECT_EQ(any_hit(scene, ray), expected.back().hit());
            }
            EXPECT_GT(found, 100u);
            for (const std::string& isa : simd_instruction_sets())
                for (const SimdPath path : {SimdPath::automatic, SimdPath::single, SimdPath::packet,
                                            SimdPath::stream, SimdPath::sorted}) {
                    SceneTraceOptions options;
                    options.isa = isa, options.path = path;
                    EXPECT_TRUE(std::ranges::equal(trace(scene, rays, options), expected, same))
                        << isa << ", " << simd_path_name(path);
                    std::vector<std::uint8_t> occluded(rays.size());
                    trace_any(scene, rays, occluded, options);
                    EXPECT_TRUE(std::ranges::equal(
                        occluded, expected,
                        [](std::uint8_t is, const Hit& hit) { return (is != 0) == hit.hit(); }))
                        << isa << ", " << simd_path_name(path);
                }
            plates.move(0.01f);
            scene.update(id, geometry());
        }
    }
}

constexpr Ray down_at_corner{{0.25f, 0.25f, 10}, 0, {0, 0, -1}};
constexpr Aabb unit_box{{0, 0, 0}, {1, 1, 1}};

TEST(UserShapes, WhatTheirFunctionThrowsComesOutOfTheCall) {
    struct Stop {};
    const std::vector<Aabb> boxes(100, unit_box);
    Scene scene;
    scene.add(UserGeometry(boxes, [](std::uint32_t prim, const Ray&, Hit&) -> bool {
        if (prim == 57) throw Stop();
        return false;
    }));
    scene.commit();
    for (const std::size_t n : {std::size_t{1}, std::size_t{100}, std::size_t{60000}})
        for (const int threads : {1, 2})
            for (const SimdPath path : {SimdPath::automatic, SimdPath::single, SimdPath::packet,
                                        SimdPath::stream, SimdPath::sorted}) {
                const std::vector<Ray> rays(n, down_at_corner);
                SceneTraceOptions options;
                options.threads = threads, options.path = path;
                EXPECT_THROW(static_cast<void>(trace(scene, rays, options)), Stop);
                std::vector<std::uint8_t> occluded(n);
                EXPECT_THROW(trace_any(scene, rays, occluded, options), Stop);
                EXPECT_THROW(static_cast<void>(trace_all(scene, rays, options)), Stop);
            }
    EXPECT_THROW(static_cast<void>(closest_hit(scene, down_at_corner)), Stop);
    EXPECT_THROW(static_cast<void>(any_hit(scene, down_at_corner)), Stop);
    // Nothing of it is left behind.
    Scene other(random_soup(500, 2));
    RandomScenes random(3);
    const std::vector<Ray> rays = random_rays(random, 5000);
    EXPECT_TRUE(std::ranges::equal(trace(other, rays),
                                   trace(build_wide_bvh(random_soup(500, 2)), rays), same));
}

TEST(UserShapes, HitsOutsideTheRayAreNone) {
    const float nan = std::numeric_limits<float>::quiet_NaN();
    struct Case {
        float t;
        Ray ray;
        bool hits;
    };
    const Ray ends{down_at_corner.origin, 2, down_at_corner.direction, 9.5f};
    for (const Case& c : {Case{9.5f, down_at_corner, true}, Case{nan, down_at_corner, false},
                          Case{-1, down_at_corner, false}, Case{infinity, down_at_corner, false},
                          Case{9.5f, ends, true}, Case{9.6f, ends, false}, Case{1.9f, ends, false},
                          Case{-0.0f, down_at_corner, true}, Case{2, ends, true}}) {
        Scene scene;
        // A box that the ray is in all the way.
        const Aabb box{{0, 0, -5}, {1, 1, 20}};
        const float t = c.t;
        scene.add(UserGeometry(std::span(&box, 1), [t](std::uint32_t, RaysAtPrimitive& rays) {
            for (std::uint32_t k = 0; k < rays.count(); ++k) rays.hit(k, t, 0.5f);
        }));
        scene.commit();
        const std::vector<Ray> rays(100, c.ray);
        for (const SimdPath path : {SimdPath::single, SimdPath::packet, SimdPath::stream}) {
            SceneTraceOptions options;
            options.path = path;
            for (const Hit& hit : trace(scene, rays, options)) {
                EXPECT_EQ(hit.hit(), c.hits) << c.t;
                if (!hit.hit()) continue;
                EXPECT_EQ(std::bit_cast<std::uint32_t>(hit.t),
                          std::bit_cast<std::uint32_t>(c.t + 0.0f));
            }
        }
        EXPECT_EQ(closest_hit(scene, c.ray).hit(), c.hits);
        EXPECT_EQ(any_hit(scene, c.ray), c.hits);
        EXPECT_EQ(trace_all(scene, rays).hits.size(), c.hits ? 100u : 0u);
    }
}

TEST(UserShapes, GetTheRayOfTheCallerInTheirOwnSpace) {
    Scene inner, outer;
    const Aabb box{{-1, -1, -1}, {1, 1, 1}};
    inner.add(UserGeometry(std::span(&box, 1), [](std::uint32_t, const Ray& ray, Hit& hit) {
        hit.t = 7, hit.u = ray.origin.z, hit.v = ray.direction.z;
        return true;
    }));
    inner.commit();
    Transform twice;
    for (std::size_t k = 0; k < 3; ++k) twice.m[k][k] = 2;
    outer.add(inner, twice);
    outer.commit();
    for (const float length : {1.0f, 100.0f, 0x1p-90f}) {
        const Ray ray{{0, 0, 10}, 0, {0, 0, -length}};
        const Hit hit = closest_hit(outer, ray);
        ASSERT_TRUE(hit.hit());
        EXPECT_EQ(hit.t, 7) << length;
        EXPECT_EQ(hit.u, 5);
        EXPECT_EQ(hit.v, -0.5f * length);
        EXPECT_EQ(hit.instance, 1u);
        const std::vector<Ray> rays(64, ray);
        EXPECT_TRUE(same(trace(outer, rays)[63], hit));
    }
}

TEST(Shapes, OfRadiusNothingAndManyEqualOnes) {
    Scene scene;
    const std::vector<Vec3> points{{0.25f, 0.25f, 1}, {5, 5, 5}};
    scene.add(std::span<const Vec3>(points), 0.0f);
    scene.add(std::span<const Sphere>(
        std::vector<Sphere>(sanitized ? 2000 : 1000000, Sphere{{3, 3, 0}, 0.5f})));
    scene.commit();
    const Hit point = closest_hit(scene, down_at_corner);
    EXPECT_EQ(point.t, 9);
    EXPECT_EQ(point.geometry, 0u);
    const Ray at_spheres{{3, 3, 10}, 0, {0, 0, -1}};
    const Hit sphere = closest_hit(scene, at_spheres);
    EXPECT_EQ(sphere.t, 9.5f);
    EXPECT_EQ(sphere.geometry, 1u);
    EXPECT_EQ(sphere.prim, 0u);
    EXPECT_TRUE(any_hit(scene, at_spheres));
}

TEST(Shapes, ThatAreNoneAreLeftOut) {
    const float nan = std::numeric_limits<float>::quiet_NaN();
    Scene scene;
    scene.add(std::span<const Sphere>());
    const std::vector<Sphere> bad{{{nan, 0, 0}, 1},
                                  {{0, 0, 0}, -1},
                                  {{0, 0, 0}, infinity},
                                  {{1e12f, 0, 0}, 1e12f},
                                  {{0.25f, 0.25f, 0}, 1}};
    scene.add(std::span<const Sphere>(bad));
    const CommitReport report = scene.commit();
    EXPECT_EQ(report.shapes, 2u);
    EXPECT_EQ(report.primitives, 5u);
    const Hit hit = closest_hit(scene, down_at_corner);
    EXPECT_EQ(hit.prim, 4u);
    EXPECT_EQ(hit.geometry, 1u);
    Scene none;
    none.add(std::span<const Sphere>(bad).first(4));
    none.commit();
    EXPECT_FALSE(closest_hit(none, down_at_corner).hit());
    EXPECT_FALSE(trace(none, std::vector<Ray>(100, down_at_corner))[99].hit());
    EXPECT_FALSE(none.bounds().lo.x <= none.bounds().hi.x);
}

TEST(Shapes, ChangeLikeMeshesDo) {
    RandomScenes random(77);
    for (const Usage usage : {Usage::fixed, Usage::moving}) {
        const auto spheres_at = [&](float z) {
            std::vector<Sphere> spheres;
            for (int k = 0; k < 500; ++k) {
                const Vec3 p = random.in(0, 1);
                spheres.push_back({{p.x, p.y, p.z + z}, 0.02f});
            }
            return spheres;
        };
        std::vector<Sphere> now = spheres_at(0);
        Scene scene;
        const std::uint32_t id = scene.add(std::span<const Sphere>(now));
        scene.add(random_soup(50, 4));
        scene.commit({.usage = usage});
        const std::vector<Ray> rays = random_rays(random, 2000);
        for (int step = 0; step < 6; ++step) {
            if (step < 3) {
                for (Sphere& sphere : now) sphere.center.x += 0.001f;
            } else {
                now = spheres_at(static_cast<float>(step));
                now.resize(500 - 100 * (step % 2));
            }
            scene.update(id, std::span<const Sphere>(now));
            EXPECT_FALSE(scene.committed());
            const CommitReport report = scene.commit({.usage = usage});
            EXPECT_EQ(report.trees_refitted, usage == Usage::moving && step < 3 ? 1u : 0u);
            Scene fresh;
            fresh.add(std::span<const Sphere>(now));
            fresh.add(random_soup(50, 4));
            fresh.commit();
            EXPECT_TRUE(std::ranges::equal(trace(scene, rays), trace(fresh, rays), same))
                << "step " << step;
        }
        EXPECT_EQ(scene.commit({.usage = usage}).trees_built, 0u);
        scene.set_mask(id, 2);
        scene.commit({.usage = usage});
        for (const Ray& ray : rays) EXPECT_NE(closest_hit(scene, ray, 1).geometry, id);
        scene.remove(id);
        scene.commit({.usage = usage});
        for (const Hit& hit : trace(scene, rays)) EXPECT_NE(hit.geometry, id);
    }
}

std::string error_of(const std::function<void()>& call) {
    try {
        call();
    } catch (const InputError& error) {
        return error.what();
    }
    return "";
}

TEST(Shapes, ErrorsNameTheGeometry) {
    Scene scene;
    const std::vector<Sphere> spheres{{{0, 0, 0}, 1}};
    const std::vector<Capsule> capsules{{{0, 0, 0}, {1, 0, 0}, 1}};
    scene.add(random_soup(3, 1));
    const std::uint32_t id = scene.add(std::span<const Sphere>(spheres));
    EXPECT_EQ(error_of([&] { scene.update(id, std::span<const Capsule>(capsules)); }),
              "geometry 1 is spheres, not capsules");
    EXPECT_EQ(error_of([&] { scene.update(0, std::span<const Sphere>(spheres)); }),
              "geometry 0 is a mesh, not spheres");
    EXPECT_EQ(error_of([&] { scene.update(id, random_soup(3, 1)); }),
              "geometry 1 is spheres, not a mesh");
    EXPECT_EQ(error_of([&] { scene.set_transform(id, Transform{}); }),
              "geometry 1 is spheres, not an instance");
    EXPECT_EQ(error_of([&] { scene.add(std::span<const Sphere>(spheres), {.id = 0}); }),
              "geometry 0: this id was given before");
    EXPECT_FALSE(scene.mesh(id).has_value());
}

TEST(Shapes, HavePointsAndNormals) {
    const std::vector<Sphere> spheres{{{1, 2, 3}, 2}};
    const std::vector<Capsule> capsules{{{0, 0, 10}, {4, 0, 10}, 1}};
    Scene inner, outer;
    inner.add(std::span<const Sphere>(spheres));
    inner.add(std::span<const Capsule>(capsules));
    inner.add(one_triangle(-5));
    inner.commit();
    Transform wide;  // stretched along x: circles become ellipses
    wide.m[0][0] = 3;
    outer.add(inner, wide);
    outer.commit();
    const std::vector<Ray> rays{{{3, 2, -10}, 0, {0, 0, 1}},    {{-10, 2, 3}, 0, {1, 0, 0}},
                                {{6, -9, 10.5f}, 0, {0, 1, 0}}, {{0.5f, 0.25f, -9}, 0, {0, 0, 1}},
                                {{90, 90, 90}, 0, {0, 0, 1}},   {{4.5f, 2, -10}, 0, {0, 0, 1}}};
    const std::vector<Hit> hits = trace(outer, rays);
    std::vector<Vec3> points(rays.size()), towards(rays.size());
    positions(outer, rays, hits, points);
    normals(outer, rays, hits, towards);
    const auto near = [](Vec3 a, Vec3 b) {
        return std::fabs(a.x - b.x) < 1e-6f && std::fabs(a.y - b.y) < 1e-6f &&
               std::fabs(a.z - b.z) < 1e-6f;
    };
    EXPECT_TRUE(near(points[0], {3, 2, 1}));
    EXPECT_TRUE(near(towards[0], {0, 0, -1}));
    EXPECT_TRUE(near(points[1], {-3, 2, 3}));
    EXPECT_TRUE(near(towards[1], {-1, 0, 0}));
    EXPECT_TRUE(near(towards[2], {0, -std::sqrt(0.75f), 0.5f}));
    EXPECT_TRUE(near(points[3], {0.5f, 0.25f, -5}));
    EXPECT_TRUE(near(towards[3], {0, 0, 1}));
    EXPECT_TRUE(std::isnan(points[4].x) && std::isnan(towards[4].x));
    // The ellipse x^2 / 36 + z^2 / 4 = 1 around (3, 3), at x = 4.5: the gradient.
    const float z = -2 * std::sqrt(1 - 1.5f * 1.5f / 36);
    const float gx = 1.5f / 36, gz = z / 4, length = std::sqrt(gx * gx + gz * gz);
    EXPECT_TRUE(near(towards[5], {gx / length, 0, gz / length}));
    EXPECT_EQ(error_of([&] { static_cast<void>(normals(outer, hits)); }),
              "hit 0: geometry 0 (spheres) on path 1 of instances has no triangles: give the rays "
              "too");
}

}  // namespace
}  // namespace raydix::test
