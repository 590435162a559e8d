// Spheres, capsules, points and geometry of a user's own in scenes in double, against each of them
// alone.
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
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "engine/double_world.h"
#include "support/message.h"
#include "support/sanitized.h"
#include "support/support.h"

namespace raydix::test {
namespace {

constexpr AabbD unit_box{{0, 0, 0}, {1, 1, 1}};

RecipeD recipe_of(std::uint32_t levels, std::uint32_t items, double shear, int k) {
    constexpr double distances[] = {0, 4.5e6, 1e11};
    return {levels,
            items,
            shear,
            distances[shear > 10 ? k % 2 : k % 3],
            {.quality = static_cast<Quality>(k % 3),
             .usage = k % 2 == 0 ? Usage::fixed : Usage::moving},
            true};
}

TEST(DoubleShapes, MixedScenesAnswerAsEachShapeDoes) {
    std::size_t hits = 0;
    for (std::uint32_t levels = 0; levels < 4; ++levels)
        for (int k = 0; k < 4 * static_cast<int>(thorough); ++k) {
            RandomWorlds random(5000 + 100 * levels + static_cast<std::uint64_t>(k));
            const auto world = random.world(
                recipe_of(levels, 1 + random.under(levels == 3 ? 4 : 7), k % 4 == 0 ? 100 : 0, k));
            EXPECT_EQ(differences_with_ends(*world, random, 150, hits), 0u)
                << "levels " << levels << ", world " << k;
        }
    EXPECT_GT(hits, 200u * thorough);
}

TEST(DoubleShapes, ShearedInstancesLoseNoHits) {
    std::size_t hits = 0;
    for (const double shear : {1e2, 1e3, 1e4})
        for (int k = 0; k < 3 * static_cast<int>(thorough); ++k) {
            RandomWorlds random(static_cast<std::uint64_t>(shear) + static_cast<std::uint64_t>(k));
            const auto world = random.world(recipe_of(1 + random.under(3), 4, shear, k));
            EXPECT_EQ(differences_with_ends(*world, random, 100, hits), 0u)
                << "shear " << shear << ", world " << k;
        }
    EXPECT_GT(hits, 100u * thorough);
}

/// Refuses about half of all that there is, by what it is.
bool takes(std::size_t place, const RayD&, const HitD& hit) {
    const std::uint32_t mix = hit.prim * 2654435761u + hit.geometry * 40503u + hit.instance * 97u +
                              static_cast<std::uint32_t>(place % 3);
    return ((mix >> 7) & 1) == 0;
}

TEST(DoubleShapes, AllHitsAndFiltersTakeThemToo) {
    std::size_t refused = 0, found = 0;
    for (std::uint32_t levels = 0; levels < 3; ++levels)
        for (int k = 0; k < 2 * static_cast<int>(thorough); ++k) {
            RandomWorlds random(7000 + 100 * levels + static_cast<std::uint64_t>(k));
            const auto world = random.world(recipe_of(levels, 2 + random.under(5), 0, k));
            const std::vector<RayD> rays = random.rays(150, world->home);
            const auto rows = look_for_all(*world, rays, every_mask);
            SceneTraceOptionsD options;
            options.threads = 1 + k % 2;
            const AllHitsD all = trace_all(world->scene, rays, options);
            options.filter = takes;
            const AllHitsD some = trace_all(world->scene, rays, options);
            const std::vector<HitD> hits = trace(world->scene, rays, options);
            std::vector<std::uint8_t> occluded(rays.size());
            trace_any(world->scene, rays, occluded, options);
            std::size_t wrong = 0;
            for (std::size_t i = 0; i < rays.size(); ++i) {
                const auto row = [&](const AllHitsD& of) {
                    const auto at = [&](std::size_t o) {
                        return of.hits.begin() + static_cast<std::ptrdiff_t>(of.offsets[o]);
                    };
                    return std::vector<HitD>(at(i), at(i + 1));
                };
                wrong += row(all) != rows[i];
                std::vector<HitD> taken;
                for (const HitD& hit : rows[i])
                    takes(i, rays[i], hit) ? taken.push_back(hit) : void(++refused);
                wrong += row(some) != taken;
                const HitD first = taken.empty() ? HitD{} : taken.front();
                wrong += hits[i] != first;
                wrong += (occluded[i] != 0) != first.hit();
                found += first.hit();
                const HitFilterD one = [&](std::size_t, const RayD& ray, const HitD& hit) {
                    return takes(i, ray, hit);
                };
                wrong += closest_hit(world->scene, rays[i], one) != first;
                wrong += any_hit(world->scene, rays[i], one) != first.hit();
            }
            EXPECT_EQ(wrong, 0u) << "levels " << levels << ", world " << k;
        }
    EXPECT_GT(refused, 30u * thorough);
    EXPECT_GT(found, 30u * thorough);
}

TEST(DoubleUserShapes, WhatTheirFunctionThrowsComesOutOfTheCall) {
    struct Stop {};
    const std::vector<AabbD> boxes(100, unit_box);
    SceneD scene;
    scene.add(UserGeometryD(boxes, [](std::uint32_t prim, const RayD&, HitD&) -> bool {
        if (prim == 57) throw Stop();
        return false;
    }));
    scene.commit();
    for (const std::size_t n : {std::size_t{1}, std::size_t{100}, std::size_t{60000}})
        for (const int threads : {1, 2}) {
            const std::vector<RayD> rays(n, down);
            SceneTraceOptionsD options;
            options.threads = threads;
            EXPECT_THROW(static_cast<void>(trace(scene, rays, options)), Stop);
            std::vector<std::uint8_t> occluded(n);
            EXPECT_THROW(trace_any(scene, rays, occluded, options), Stop);
            EXPECT_THROW(static_cast<void>(trace_all(scene, rays, options)), Stop);
        }
    EXPECT_THROW(static_cast<void>(closest_hit(scene, down)), Stop);
    EXPECT_THROW(static_cast<void>(any_hit(scene, down)), Stop);
    // Nothing of it is left behind.
    const SceneD other(one_triangle());
    for (const HitD& hit : trace(other, std::vector<RayD>(5000, down))) EXPECT_EQ(hit.t, 10);
}

TEST(DoubleUserShapes, HitsOutsideTheRayAreNone) {
    const double nan = std::numeric_limits<double>::quiet_NaN();
    struct Case {
        double t;
        RayD ray;
        bool hits;
    };
    const RayD ends{down.origin, 2, down.direction, 9.5};
    for (const Case& c :
         {Case{9.5, down, true}, Case{nan, down, false}, Case{-1, down, false},
          Case{infinity, down, false}, Case{9.5, ends, true}, Case{9.6, ends, false},
          Case{1.9, ends, false}, Case{-0.0, down, true}, Case{2, ends, true}}) {
        SceneD scene;
        // A box that the ray is in all the way.
        const AabbD box{{0, 0, -5}, {1, 1, 20}};
        const double t = c.t;
        scene.add(UserGeometryD(std::span(&box, 1), [t](std::uint32_t, RaysAtPrimitiveD& rays) {
            for (std::uint32_t k = 0; k < rays.count(); ++k) rays.hit(k, t, 0.5);
        }));
        scene.commit();
        const std::vector<RayD> rays(100, c.ray);
        for (const HitD& hit : trace(scene, rays)) {
            EXPECT_EQ(hit.hit(), c.hits) << c.t;
            if (!hit.hit()) continue;
            EXPECT_EQ(std::bit_cast<std::uint64_t>(hit.t), std::bit_cast<std::uint64_t>(c.t + 0.0));
            EXPECT_EQ(hit.u, 0.5);
        }
        EXPECT_EQ(closest_hit(scene, c.ray).hit(), c.hits);
        EXPECT_EQ(any_hit(scene, c.ray), c.hits);
        EXPECT_EQ(trace_all(scene, rays).hits.size(), c.hits ? 100u : 0u);
    }
}

TEST(DoubleUserShapes, GetTheRayOfTheCallerInTheirOwnSpace) {
    SceneD inner, outer;
    const AabbD box{{-1, -1, -1}, {1, 1, 1}};
    std::atomic<std::size_t> last{0};
    inner.add(UserGeometryD(std::span(&box, 1), [&](std::uint32_t, RaysAtPrimitiveD& rays) {
        for (std::uint32_t k = 0; k < rays.count(); ++k) {
            last = std::max(last.load(), rays.place(k));
            rays.hit(k, 7, rays.ray(k).origin.z, rays.ray(k).direction.z);
        }
    }));
    inner.commit();
    TransformD twice;
    for (std::size_t k = 0; k < 3; ++k) twice.m[k][k] = 2;
    outer.add(inner, twice);
    outer.commit();
    for (const double length : {1.0, 100.0, 0x1p-900}) {
        const RayD ray{{0, 0, 10}, 0, {0, 0, -length}};
        const HitD hit = closest_hit(outer, ray);
        ASSERT_TRUE(hit.hit());
        EXPECT_EQ(hit.t, 7) << length;
        EXPECT_EQ(hit.u, 5);
        EXPECT_EQ(hit.v, -0.5 * length);
        EXPECT_EQ(hit.instance, 1u);
        const std::vector<RayD> rays(64, ray);
        EXPECT_EQ(trace(outer, rays)[63], hit);
        EXPECT_EQ(last, 63u);
    }
}

/// Boxes that are points, and t that is off by nearly 2^-41 of itself.
TEST(DoubleUserShapes, MayBeBesideTheirBoxesByWhatIsPromised) {
    RandomD random(12);
    for (const double place : {0.0, 4.5e6, 1e11}) {
        const Vec3d home{place, -place, 0.1 * place};
        std::vector<AabbD> boxes;
        std::vector<double> times;
        std::vector<RayD> rays;
        for (int k = 0; k < 200; ++k) {
            // Far from small bounds: there the way that the ray has come is what counts.
            const Vec3d at = home + random.in({{-1e-3, -1e-3, -1e-3}, {1e-3, 1e-3, 1e-3}});
            const double t = random.between(1e4, 1e5);
            const Vec3d direction = random.direction();
            boxes.push_back({at, at});
            times.push_back(t * (1 + (k % 2 == 0 ? 0.9 : -0.9) * 0x1p-41));
            // It ends before the box, or begins behind it.
            rays.push_back({at - t * direction, 0, direction});
            (k % 2 == 0 ? rays.back().tmin : rays.back().tmax) = times.back();
        }
        SceneD inner, scene;
        inner.add(UserGeometryD(boxes, [&](std::uint32_t prim, RaysAtPrimitiveD& at) {
            for (std::uint32_t k = 0; k < at.count(); ++k)
                if (at.place(k) == prim) at.hit(k, times[prim]);
        }));
        inner.commit();
        scene.add(inner, TransformD{});
        scene.commit();
        for (const SceneD* const asked : {&inner, &scene}) {
            const std::vector<HitD> hits = trace(*asked, rays);
            std::size_t missed = 0;
            for (std::size_t k = 0; k < rays.size(); ++k) missed += hits[k].t != times[k];
            EXPECT_EQ(missed, 0u) << place;
        }
    }
}

TEST(DoubleShapes, OfRadiusNothingAndManyEqualOnes) {
    SceneD scene;
    const std::vector<Vec3d> points{{0.25, 0.25, 1}, {0, 0, 0}, {0, 0x1p-45, 0}};
    scene.add(std::span<const Vec3d>(points), 0.0);
    scene.add(std::span<const SphereD>(
        std::vector<SphereD>(sanitized ? 2000 : 300000, SphereD{{3, 3, 0}, 0.5})));
    scene.commit();
    const HitD point = closest_hit(scene, down);
    EXPECT_EQ(point.t, 9);
    EXPECT_EQ(point.geometry, 0u);
    EXPECT_EQ(closest_hit(scene, {{0, 0, 4}, 0, {0, 0, -1}}).prim, 1u);
    EXPECT_EQ(closest_hit(scene, {{0, 0x1p-45, 4}, 0, {0, 0, -1}}).prim, 2u);
    const RayD at_spheres{{3, 3, 10}, 0, {0, 0, -1}};
    const HitD sphere = closest_hit(scene, at_spheres);
    EXPECT_EQ(sphere.t, 9.5);
    EXPECT_EQ(sphere.geometry, 1u);
    EXPECT_EQ(sphere.prim, 0u);
    EXPECT_TRUE(any_hit(scene, at_spheres));
}

TEST(DoubleShapes, PlacesFarFromTheOriginCostNoDigits) {
    const std::vector<SphereD> spheres{{{0.5, 0.25, 0.125}, 0.5}};
    SceneD here, there;
    here.add(std::span<const SphereD>(spheres));
    here.commit();
    there.add(here, moved(1e11, -1e11, 5e10));
    there.commit();
    RandomD random(4);
    std::size_t hits = 0;
    for (int k = 0; k < 200; ++k) {
        // In steps that doubles have there.
        const auto step = [&] { return std::round(random.between(-4, 4) * 16384) / 16384; };
        const RayD ray{{step(), step(), step()}, 0, random.direction()};
        const RayD far{ray.origin + Vec3d{1e11, -1e11, 5e10}, 0, ray.direction};
        const HitD hit = closest_hit(here, ray), other = closest_hit(there, far);
        EXPECT_EQ(hit.t, other.t);
        EXPECT_EQ(hit.prim, other.prim);
        hits += hit.hit();
    }
    EXPECT_GT(hits, 1u);
}

TEST(DoubleShapes, ThatAreNoneAreLeftOut) {
    const double nan = std::numeric_limits<double>::quiet_NaN();
    SceneD scene;
    scene.add(std::span<const SphereD>());
    const std::vector<SphereD> bad{{{nan, 0, 0}, 1},
                                   {{0, 0, 0}, -1},
                                   {{0, 0, 0}, infinity},
                                   {{1e12, 0, 0}, 1e12},
                                   {{0.25, 0.25, 0}, 1}};
    scene.add(std::span<const SphereD>(bad));
    const CommitReport report = scene.commit();
    EXPECT_EQ(report.shapes, 2u);
    EXPECT_EQ(report.primitives, 5u);
    const HitD hit = closest_hit(scene, down);
    EXPECT_EQ(hit.prim, 4u);
    EXPECT_EQ(hit.geometry, 1u);
    SceneD none;
    none.add(std::span<const SphereD>(bad).first(4));
    none.commit();
    EXPECT_FALSE(closest_hit(none, down).hit());
    EXPECT_FALSE(trace(none, std::vector<RayD>(100, down))[99].hit());
    EXPECT_FALSE(none.bounds().lo.x <= none.bounds().hi.x);
}

TEST(DoubleShapes, ChangeLikeMeshesDo) {
    RandomWorlds random(77);
    std::vector<SphereD> now;
    for (int k = 0; k < 200; ++k) now.push_back({random.around({0, 0, 0}, 0.6), 0.02});
    SceneD scene;
    const std::uint32_t id = scene.add(std::span<const SphereD>(now));
    scene.add(one_triangle());
    scene.commit();
    const std::vector<RayD> rays = random.rays(500, {0, 0, 0});
    for (int step = 0; step < 3; ++step) {
        for (SphereD& sphere : now) sphere.center.x += 0.1;
        scene.update(id, std::span<const SphereD>(now));
        EXPECT_FALSE(scene.committed());
        EXPECT_EQ(scene.commit().trees_built, 1u);
        SceneD fresh;
        fresh.add(std::span<const SphereD>(now));
        fresh.add(one_triangle());
        fresh.commit();
        EXPECT_EQ(trace(scene, rays), trace(fresh, rays));
    }
    EXPECT_EQ(scene.commit().trees_built, 0u);
    scene.set_mask(id, 2);
    scene.commit();
    for (const RayD& ray : rays) EXPECT_NE(closest_hit(scene, ray, 1).geometry, id);
    scene.remove(id);
    scene.commit();
    for (const HitD& hit : trace(scene, rays)) EXPECT_NE(hit.geometry, id);
    EXPECT_EQ(message_of([&] { scene.update(1, std::span<const SphereD>(now)); }),
              "geometry 1 is a mesh, not spheres");
}

TEST(DoubleShapes, HavePointsAndNormals) {
    const Vec3d home{4.5e6, 5e5, 100};
    const std::vector<SphereD> spheres{{home, 2}};
    SceneD inner, outer;
    inner.add(std::span<const SphereD>(spheres));
    inner.commit();
    TransformD wide;  // stretched along x: circles become ellipses
    wide.m[0][0] = 3, wide.m[0][3] = -2 * home.x;
    outer.add(inner, wide);
    outer.commit();
    const std::vector<RayD> rays{{home + Vec3d{0, 0, -9}, 0, {0, 0, 1}},
                                 {home + Vec3d{-9, 0, 0}, 0, {1, 0, 0}},
                                 {home + Vec3d{1.5, 0, -9}, 0, {0, 0, 1}},
                                 {home + Vec3d{90, 0, 0}, 0, {0, 0, 1}}};
    const std::vector<HitD> hits = trace(outer, rays);
    const std::vector<Vec3d> points = positions(outer, rays, hits),
                             towards = normals(outer, rays, hits);
    ASSERT_EQ(points.size(), rays.size());
    const auto near = [](Vec3d a, Vec3d b) {
        return std::fabs(a.x - b.x) < 1e-8 && std::fabs(a.y - b.y) < 1e-8 &&
               std::fabs(a.z - b.z) < 1e-8;
    };
    EXPECT_TRUE(near(points[0], home + Vec3d{0, 0, -2}));
    EXPECT_TRUE(near(towards[0], {0, 0, -1}));
    EXPECT_TRUE(near(points[1], home + Vec3d{-6, 0, 0}));
    EXPECT_TRUE(near(towards[1], {-1, 0, 0}));
    EXPECT_TRUE(std::isnan(points[3].x) && std::isnan(towards[3].x));
    // The ellipse x^2 / 36 + z^2 / 4 = 1, at x = 1.5: the gradient.
    const double z = -2 * std::sqrt(1 - 1.5 * 1.5 / 36);
    const double gx = 1.5 / 36, gz = z / 4, length = std::sqrt(gx * gx + gz * gz);
    EXPECT_TRUE(near(towards[2], {gx / length, 0, gz / length}));
    EXPECT_EQ(message_of([&] { static_cast<void>(normals(outer, hits)); }),
              "hit 0: geometry 0 (spheres) on path 1 of instances has no triangles: give the rays "
              "too");
}

}  // namespace
}  // namespace raydix::test
