// One mesh in a SceneD, by every instruction set, path and number of threads, against every
// triangle: places, sizes and rays at the ends of what doubles hold.
#include <gtest/gtest.h>
#include <raydix/double.h>
#include <raydix/scene.h>
#include <raydix/wide.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "engine/double_world.h"
#include "support/double_scenes.h"
#include "support/sanitized.h"
#include "support/support.h"

namespace raydix::test {
namespace {

constexpr double largest = std::numeric_limits<double>::max();

/// From one point toward a grid in the box, row by row: what packets take as it comes.
std::vector<RayD> fan(const MeshD& mesh, Vec3d from, std::uint32_t side) {
    const AabbD box = box_of_mesh(mesh);
    std::vector<RayD> rays;
    for (std::uint32_t y = 0; y < side; ++y)
        for (std::uint32_t x = 0; x < side; ++x) {
            const double u = (x + 0.5) / side, v = (y + 0.5) / side;
            const Vec3d at{box.lo.x + u * (box.hi.x - box.lo.x),
                           box.lo.y + v * (box.hi.y - box.lo.y), 0.5 * (box.lo.z + box.hi.z)};
            const Vec3d way = at - from;
            const double longest =
                max_of(max_of(std::fabs(way.x), std::fabs(way.y)), std::fabs(way.z));
            rays.push_back({from, 0, longest > 0 ? (1 / longest) * way : Vec3d{0, 0, 1}});
        }
    return rays;
}

/// The rays once more: from farther and farther behind, with long and short directions.
std::vector<RayD> with_extremes(const std::vector<RayD>& rays) {
    std::vector<RayD> out = rays;
    const double back[] = {3, 100, 1e4, 1e7, 1e10, 1e13, 1e16, 1e30, 1e60, 1e200, 1e305};
    const double scale[] = {0x1p-1074, 0x1p-1040, 0x1p-1000, 0x1p-130, 0x1p120, 0x1p127, 0x1p900};
    for (std::size_t i = 0; i < rays.size(); ++i) {
        RayD far = rays[i];
        far.origin = far.origin - back[i % std::size(back)] * far.direction;
        far.tmax = std::numeric_limits<double>::infinity();
        out.push_back(far);
        RayD other = rays[i];
        const double by = scale[i % std::size(scale)];
        other.direction = by * other.direction;
        other.tmin = min_of(other.tmin / by, largest);
        other.tmax = other.tmax / by;
        out.push_back(other);
    }
    return out;
}

std::size_t differences(const SceneD& scene, std::span<const RayD> rays,
                        std::span<const HitD> wanted, const SceneTraceOptionsD& options) {
    std::vector<HitD> hits(rays.size());
    std::vector<std::uint8_t> occluded(rays.size(), 7);
    const TraceCounts closest = trace(scene, rays, hits, options),
                      any = trace_any(scene, rays, occluded, options);
    std::size_t wrong = 0, found = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
        wrong += hits[i] != wanted[i];
        wrong += occluded[i] != (wanted[i].hit() ? 1 : 0);
        found += wanted[i].hit();
    }
    return wrong + (closest.hits != found) + (any.hits != found) +
           (closest.invalid_rays != any.invalid_rays);
}

/// Over everything that may decide how rays go.
void expect_hits_of_all_triangles(const MeshD& mesh, std::span<const RayD> rays) {
    const std::vector<HitD> wanted = trace_brute_force(mesh, rays);
    const AllHitsD all = trace_all(build_bvh(mesh), rays);
    for (const Quality quality : {Quality::fast, Quality::balanced, Quality::high}) {
        SCOPED_TRACE(static_cast<int>(quality));
        const SceneD scene(mesh, {.quality = quality});
        for (const std::string& isa : simd_instruction_sets()) {
            SceneTraceOptionsD options;
            options.isa = isa, options.threads = 1;
            for (const SimdPath path : {SimdPath::single, SimdPath::packet, SimdPath::sorted}) {
                options.path = path;
                EXPECT_EQ(differences(scene, rays, wanted, options), 0u)
                    << isa << ", " << simd_path_name(path);
            }
            EXPECT_EQ(trace_all(scene, rays, options).hits, all.hits) << isa;
        }
        for (const int threads : {2, 3})
            EXPECT_EQ(differences(scene, rays, wanted, {.threads = threads}), 0u)
                << threads << " threads";
        std::size_t wrong = 0;
        for (std::size_t i = 0; i < rays.size(); i += 7) {
            wrong += closest_hit(scene, rays[i]) != wanted[i];
            wrong += any_hit(scene, rays[i]) != wanted[i].hit();
        }
        EXPECT_EQ(wrong, 0u) << "one by one";
    }
}

std::vector<RayD> rays_of(const MeshD& mesh, std::size_t count, std::uint64_t seed) {
    std::vector<RayD> rays = mixed_rays(mesh, count, seed);
    const AabbD box = box_of_mesh(mesh);
    const Vec3d size = box.hi - box.lo, middle = 0.5 * box.lo + 0.5 * box.hi;
    for (const double back : {1.2, 40.0, 3000.0}) {
        const auto more = fan(mesh, middle + back * Vec3d{0.1 * size.x, -0.2 * size.y, size.z},
                              sanitized ? 6 : 16);
        rays.insert(rays.end(), more.begin(), more.end());
    }
    return rays;
}

void expect_all_hits(const std::string& what, const MeshD& mesh, std::size_t least_hits) {
    SCOPED_TRACE(what);
    const std::vector<RayD> rays = with_extremes(rays_of(mesh, fewer(200, 8), 11));
    expect_hits_of_all_triangles(mesh, rays);
    const std::vector<HitD> hits = trace_brute_force(mesh, rays);
    EXPECT_GE(static_cast<std::size_t>(
                  std::ranges::count_if(hits, [](const HitD& hit) { return hit.hit(); })),
              fewer(least_hits, 10));
    SCOPED_TRACE("to the hits");
    expect_hits_of_all_triangles(mesh, rays_to_hits(rays, hits));
}

MeshD soup_at(Vec3d at, double scale) {
    MeshD mesh = random_soup_d(fewer(400, 2), 5, sanitized ? 0.3 : 0.2);
    for (Vec3d& v : mesh.vertices) v = scale * v + at;
    return mesh;
}

TEST(DoubleMesh, AtAnyPlaceHasTheHitsOfAllTriangles) {
    expect_all_hits("at the origin", soup_at({0, 0, 0}, 1), 200);
    expect_all_hits("at 1e7", soup_at({1e7, -3e6, 1e5}, 1), 200);
    expect_all_hits("at 1e11", soup_at({1e11, -1e11, 3e10}, 1), 20);
    expect_all_hits("a millionth", soup_at({4e5, 4e6, 100}, 1e-6), 20);
    expect_all_hits("tiny", soup_at({0, 0, 0}, 1e-10), 100);
    expect_all_hits("to the edge of the range", soup_at({-9e11, -9e11, -9e11}, 1.8e12), 100);
}

TEST(DoubleMesh, OfAnyShapeHasTheHitsOfAllTriangles) {
    expect_all_hits("one triangle", {"", {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}}, 20);
    MeshD flat = random_soup_d(300, 8, 0.3);
    for (Vec3d& v : flat.vertices) v.y = 0.25;
    expect_all_hits("in a plane", flat, 100);
    expect_all_hits("slivers", slivers_d(300, 4), 20);
    expect_all_hits("a stray triangle", with_stray(soup_at({0, 0, 0}, 1), {4.5e6, 4.5e6, 4.5e6}),
                    100);
    expect_all_hits("a stray triangle at the edge", with_stray(slivers_d(200, 9), {1e12, 0, 0}),
                    10);
    MeshD equal = random_soup_d(1, 3, 0.9);
    for (int k = 0; k < 20; ++k) equal.triangles.push_back(equal.triangles[0]);
    expect_all_hits("all equal", equal, 20);
    MeshD mixed = random_soup_d(100, 2, 0.3);
    mixed.triangles.push_back({0, 0, 1});  // without an area
    mixed.triangles.push_back({5, 6, 5});
    mixed.vertices[20].x = std::numeric_limits<double>::quiet_NaN();
    mixed.vertices[31].y = 3e12;
    expect_all_hits("with some that are left out", mixed, 50);
}

TEST(DoubleMesh, RaysInPlanesOfTriangles) {
    const MeshD mesh = slivers_d(200, 21);
    const std::vector<RayD> rays = rays_in_planes(mesh, fewer(1500, 5), 6);
    expect_hits_of_all_triangles(mesh, rays);
    const std::vector<HitD> hits = trace_brute_force(mesh, rays);
    SCOPED_TRACE("to the hits");
    expect_hits_of_all_triangles(mesh, rays_to_hits(rays, hits));
}

TEST(DoubleMesh, RaysThatAreNoneCountAsInvalid) {
    constexpr double nan = std::numeric_limits<double>::quiet_NaN();
    const MeshD mesh = soup_at({0, 0, 0}, 1);
    std::vector<RayD> rays = fan(mesh, {0.5, 0.5, 4}, 64);
    std::size_t invalid = 0;
    for (std::size_t i = 0; i < rays.size(); i += 13, ++invalid) {
        RayD& ray = rays[i];
        if (i % 5 == 0)
            ray.origin.y = nan;
        else if (i % 5 == 1)
            ray.direction = {0, 0, 0};
        else if (i % 5 == 2)
            ray.tmax = -1;
        else if (i % 5 == 3)
            ray.direction.z = std::numeric_limits<double>::infinity();
        else
            ray.tmin = nan;
    }
    const SceneD scene(mesh);
    const std::vector<HitD> wanted = trace_brute_force(mesh, rays);
    for (const SimdPath path : {SimdPath::automatic, SimdPath::single, SimdPath::packet}) {
        SceneTraceOptionsD options;
        options.path = path;
        EXPECT_EQ(differences(scene, rays, wanted, options), 0u);
        std::vector<HitD> hits(rays.size());
        EXPECT_EQ(trace(scene, rays, hits, options).invalid_rays, invalid);
        EXPECT_EQ(trace_all(scene, rays, options).counts.invalid_rays, invalid);
    }
}

TEST(DoubleMesh, MasksOfRaysAndOfTheMesh) {
    const MeshD mesh = soup_at({1e6, 0, 0}, 1);
    SceneD scene;
    scene.add(mesh, {.mask = 6});
    scene.commit();
    const std::vector<RayD> rays = fan(mesh, {1e6 + 0.5, 0.5, 3}, 40);
    const std::vector<HitD> seen = trace_brute_force(mesh, rays);
    std::vector<std::uint32_t> masks;
    std::vector<HitD> wanted = seen;
    for (std::size_t i = 0; i < rays.size(); ++i) {
        masks.push_back(1u << i % 4);
        if ((masks[i] & 6) == 0) wanted[i] = {};
    }
    EXPECT_EQ(differences(scene, rays, wanted, {.masks = masks}), 0u);
    EXPECT_EQ(differences(scene, rays, seen, {.mask = 2}), 0u);
    EXPECT_EQ(differences(scene, rays, std::vector<HitD>(rays.size()), {.mask = 9}), 0u);
}

TEST(DoubleMesh, LargeBatchesOfAllKindsOfRays) {
    // Enough jobs for all ways to take part.
    MeshD mesh = random_soup_d(3000, 12, 0.1);
    for (Vec3d& v : mesh.vertices) v = v + utm_place;
    const BvhD tree = build_bvh(mesh);
    const SceneD scene(mesh);
    std::vector<RayD> near;
    for (int k = 0; k < 8; ++k) {
        const auto more = fan(mesh, utm_place + Vec3d{0.1 * k, 0.4, 1.7}, 50);
        near.insert(near.end(), more.begin(), more.end());
    }
    std::vector<RayD> anywhere = mixed_rays(mesh, 20000, 3);
    for (const std::vector<RayD>& rays : {near, anywhere}) {
        const std::vector<HitD> wanted = trace(tree, rays);
        for (const int threads : {1, 2})
            EXPECT_EQ(differences(scene, rays, wanted, {.threads = threads}), 0u);
    }
}

}  // namespace
}  // namespace raydix::test
