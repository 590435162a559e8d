// Scenes of which a small part is far away, or far larger than all else: the hits of brute force,
// without visits of boxes that only the size of the whole makes large.
#include <gtest/gtest.h>
#include <raydix/rdx_scene.h>
#include <raydix/scene.h>
#include <raydix/trace.h>
#include <raydix/wide.h>

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "engine/scene_state.h"
#include "engine/trace_on_this_thread.h"
#include "support/random.h"
#include "support/sanitized.h"
#include "support/support.h"
#include "support/temp_path.h"

namespace raydix {
namespace {

/// A detailed thing about `center`, and one triangle that reaches `far` away from there.
Mesh thing_with_stray(Vec3 center, float far, bool around, std::size_t triangles = 3000) {
    Mesh mesh = test::random_soup(triangles, 5, 0.03f);
    for (Vec3& v : mesh.vertices) v = v + center;
    const auto n = static_cast<std::uint32_t>(mesh.vertices.size());
    const float from = around ? -far : 0.0f;
    mesh.vertices.push_back({center.x + from, center.y + from, center.z - 0.2f});
    mesh.vertices.push_back({center.x + far, center.y + from, center.z - 0.2f});
    mesh.vertices.push_back({center.x + 0.1f * far, center.y + far, center.z - 0.2f});
    mesh.triangles.push_back({n, n + 1, n + 2});
    return mesh;
}

/// From the thing, from beside it, and from as far as `far`; some of odd length.
std::vector<Ray> rays_about(Vec3 center, float far, std::size_t count) {
    test::Random random(9);
    std::vector<Ray> rays;
    for (std::size_t i = 0; i < count; ++i) {
        const float out = i % 8 == 0 ? far : i % 4 == 0 ? 0.01f * far : 2.0f;
        const Vec3 from = center + random.in(-1, 1) * out, to = center + random.in(0, 1);
        Ray ray{from, 0, to - from};
        if (i % 3 == 0) ray.direction = random.in(-1, 1);
        if (i % 11 == 0) ray.direction = ray.direction * 1e-6f;
        if (i % 5 == 0) ray.tmax = 0.7f;
        if (i % 29 == 0) ray.origin = random.in(-1, 1) * 2e38f;  // sums of such overflow
        rays.push_back(ray);
    }
    return rays;
}

void expect_hits_of_brute_force(const Scene& scene, const Mesh& mesh, std::span<const Ray> rays) {
    const std::vector<Hit> expected = trace_brute_force(mesh, rays);
    for (const SimdPath path : {SimdPath::automatic, SimdPath::single, SimdPath::packet,
                                SimdPath::stream, SimdPath::sorted})
        for (const std::string& isa : simd_instruction_sets()) {
            SceneTraceOptions options;
            options.path = path;
            options.isa = isa;
            std::vector<std::uint8_t> occluded(rays.size());
            const std::vector<Hit> hits = trace(scene, rays, options);
            trace_any(scene, rays, occluded, options);
            const AllHits all = trace_all(scene, rays, options);
            for (std::size_t i = 0; i < rays.size(); ++i) {
                ASSERT_EQ(hits[i].prim, expected[i].prim) << "ray " << i << ", " << isa;
                ASSERT_EQ(hits[i].t, expected[i].t) << "ray " << i << ", " << isa;
                ASSERT_EQ(occluded[i] != 0, expected[i].hit()) << "ray " << i << ", " << isa;
                // Half-open edges may leave out what the closest hit has.
                if (all.offsets[i] != all.offsets[i + 1]) {
                    ASSERT_GE(all.hits[all.offsets[i]].t, expected[i].t) << "ray " << i;
                }
            }
        }
    for (std::size_t i = 0; i < rays.size(); ++i) {
        const Hit hit = closest_hit(scene, rays[i]);
        ASSERT_EQ(hit.prim, expected[i].prim) << "ray " << i;
        ASSERT_EQ(hit.t, expected[i].t) << "ray " << i;
        ASSERT_EQ(any_hit(scene, rays[i]), expected[i].hit()) << "ray " << i;
    }
}

double visits_a_ray(const Scene& scene, std::span<const Ray> rays) {
    std::vector<std::uint32_t> visits(rays.size());
    count_steps_on_this_thread(*SceneInternals::tree(scene), rays, visits);
    double sum = 0;
    for (const std::uint32_t of_ray : visits) sum += of_ray;
    return sum / static_cast<double>(rays.size());
}

TEST(LocalPads, HitsAreThoseOfBruteForce) {
    for (const Vec3 center : {Vec3{0, 0, 0}, Vec3{700, -300, 20}})
        for (const float far : {1e2f, 1e4f, 1e5f, 1e6f, 1e8f, 9e11f})
            for (const bool around : {false, true}) {
                SCOPED_TRACE(testing::Message() << center.x << ", " << far << ", " << around);
                const Mesh mesh = thing_with_stray(center, far, around, 600);
                const std::vector<Ray> rays = rays_about(center, far, test::fewer(150, 30));
                for (const bool compact : {false, true})
                    for (const Quality quality : {Quality::fast, Quality::balanced, Quality::high})
                        expect_hits_of_brute_force(
                            Scene(mesh, {.quality = quality, .compact = compact}), mesh, rays);
            }
}

/// Rays near the thing visit little more than if it were alone.
TEST(LocalPads, WhatIsFarCostsLittle) {
    for (const bool compact : {false, true})
        for (const bool around : {false, true}) {
            const std::vector<Ray> rays = rays_about({0, 0, 0}, 2.0f, 1000);
            const Mesh alone = test::random_soup(3000, 5, 0.03f);
            const double few = visits_a_ray(Scene(alone, {.compact = compact}), rays);
            for (const float far : {1e4f, 1e5f, 1e6f}) {
                const Mesh mesh = thing_with_stray({0, 0, 0}, far, around);
                EXPECT_LT(visits_a_ray(Scene(mesh, {.compact = compact}), rays), 2 * few + 8)
                    << far << ", " << around;
            }
        }
}

TEST(LocalPads, FilesAndRefitsKeepThem) {
    const test::TempPath file("local_pads", ".rdx");
    for (const bool compact : {false, true}) {
        const Mesh mesh = thing_with_stray({0, 0, 0}, 1e6f, false, 1000);
        const std::vector<Ray> rays = rays_about({0, 0, 0}, 2.0f, 300);
        const Scene scene(mesh, {.compact = compact});
        save_rdx(file.path(), scene);
        const Scene loaded = load_rdx_scene(file.path()).scene;
        expect_hits_of_brute_force(loaded, mesh, rays);
        EXPECT_EQ(visits_a_ray(loaded, rays), visits_a_ray(scene, rays));
    }
    const Mesh still = test::random_soup(1000, 5, 0.03f);
    Mesh moved = still;
    Scene scene;
    scene.add(still);
    scene.commit({.usage = Usage::moving});
    for (const float far : {1e6f, 0.0f, 1e5f}) {
        moved.vertices[300] = {far, far, 0.5f};
        scene.update(0, moved);
        const CommitReport report = scene.commit({.usage = Usage::moving, .refit_limit = 1e30});
        EXPECT_EQ(report.trees_refitted, 1u);
        const std::vector<Ray> rays = rays_about({0, 0, 0}, 2.0f, 300);
        expect_hits_of_brute_force(scene, moved, rays);
        EXPECT_LT(visits_a_ray(scene, rays), 60) << far;
    }
}

/// Such rays are valid, begin behind everything and have no hits: nothing may be written for them.
TEST(LocalPads, AllHitsOfRaysThatBeginAtInfinity) {
    const Mesh mesh = thing_with_stray({0, 0, 0}, 1e4f, true, 500);
    Scene inside;
    inside.add(mesh);
    inside.commit();
    Scene scene;
    scene.add(mesh);
    scene.add(inside, Transform{});
    scene.commit();
    std::vector<Ray> rays = rays_about({0, 0, 0}, 1e4f, 1000);
    for (Ray& ray : rays) ray.origin = ray.origin * 1e-6f, ray.direction = {0.1f, 0.2f, 1};
    SceneTraceOptions options;
    options.path = SimdPath::packet;
    options.threads = 1;
    static_cast<void>(trace(scene, std::span(rays).first(16), options));
    for (Ray& ray : std::span(rays).subspan(16)) ray.tmin = ray.tmax = infinity;
    const AllHits all = trace_all(scene, rays, options);
    EXPECT_EQ(all.offsets[16], all.offsets[rays.size()]);
    EXPECT_EQ(all.counts.invalid_rays, 0u);
}

}  // namespace
}  // namespace raydix
