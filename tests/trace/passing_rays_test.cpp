// Rays from outside of which many pass the scene's bounds by: they are told apart before they
// visit a node, and have the hits of brute force all the same.
#include <gtest/gtest.h>
#include <raydix/expert.h>
#include <raydix/raydix.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <random>
#include <string>
#include <vector>

#include "support/sanitized.h"
#include "support/scenes.h"
#include "support/support.h"
#include "trace/simd/wide_batch.h"

namespace raydix::test {
namespace {

/// From a cube about the box to points in and around it; some along an axis, on a plane of the box
/// or a step of floats beside it.
std::vector<Ray> rays_from_outside(const Aabb& box, std::size_t count, std::uint64_t seed) {
    std::mt19937_64 random(seed);
    const auto unit = [&] { return static_cast<float>(random() >> 40) * 0x1p-24f; };
    const Vec3 size = box.hi - box.lo, middle = 0.5f * (box.lo + box.hi);
    const float reach = std::max({size.x, size.y, size.z, 1e-6f * std::abs(middle.x), 1e-20f});
    std::vector<Ray> rays(count);
    for (std::size_t i = 0; i < count; ++i) {
        const auto off = [&](float part) {
            return Vec3{part * (2 * unit() - 1), part * (2 * unit() - 1), part * (2 * unit() - 1)};
        };
        Ray& ray = rays[i];
        ray.origin = middle + reach * off(3.0f);
        const Vec3 to =
            middle + Vec3{size.x * (1.5f * unit() - 0.75f), size.y * (1.5f * unit() - 0.75f),
                          size.z * (1.5f * unit() - 0.75f)};
        ray.direction = to - ray.origin;
        if (i % 4 == 1) {
            const int along = static_cast<int>(random() % 3), across = (along + 1) % 3;
            ray.direction = {0, 0, 0};
            (&ray.direction.x)[along] = random() % 2 == 0 ? 1.0f : -1.0f;
            ray.origin = to;
            (&ray.origin.x)[along] = (&middle.x)[along] - 2 * reach * (&ray.direction.x)[along];
            const float plane = random() % 2 == 0 ? (&box.lo.x)[across] : (&box.hi.x)[across];
            const float steps[] = {plane, std::nextafter(plane, -infinity),
                                   std::nextafter(plane, infinity)};
            (&ray.origin.x)[across] = steps[random() % 3];
        }
        if (i % 8 == 2) ray.tmax = unit() * 2;
        if (i % 8 == 3) ray.direction = -1.0f * ray.direction;
    }
    return rays;
}

void expect_hits_of_brute_force(const std::string& name, const Mesh& mesh, std::uint64_t seed) {
    SCOPED_TRACE(name);
    const Scene scene(mesh);
    const std::size_t count = mesh.triangles.size() > 2000 ? fewer(2000, 5) : 2000;
    const std::vector<Ray> rays = rays_from_outside(scene.bounds(), count, seed);
    const std::vector<Hit> wanted = trace_brute_force(mesh, rays);
    EXPECT_TRUE(look_at(scene.bounds(), rays).passing);
    const std::vector<Hit> hits = trace(scene, rays);
    std::vector<std::uint8_t> occluded(rays.size());
    trace_any(scene, rays, occluded);
    std::size_t differ = 0, hit = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
        const bool same = hits[i].prim == wanted[i].prim && hits[i].t == wanted[i].t &&
                          hits[i].u == wanted[i].u && hits[i].v == wanted[i].v;
        hit += wanted[i].hit();
        if ((!same || (occluded[i] != 0) != wanted[i].hit()) && ++differ <= 3)
            ADD_FAILURE() << "ray " << i << ": t " << hits[i].t << ", brute force " << wanted[i].t;
    }
    EXPECT_EQ(differ, 0u);
    EXPECT_GT(hit, 0u);
}

Mesh flat(Mesh mesh, int axis) {
    for (Vec3& v : mesh.vertices) (&v.x)[axis] = 0.3f;
    return mesh;
}

TEST(PassingRays, HaveTheHitsOfBruteForce) {
    const Mesh soup = random_soup(500, 5, 0.2f);
    expect_hits_of_brute_force("soup", soup, 1);
    expect_hits_of_brute_force("lattice", lattice_mesh(300, 5, 3), 2);
    for (int axis = 0; axis < 3; ++axis)
        expect_hits_of_brute_force("flat", flat(soup, axis), 3 + static_cast<std::uint64_t>(axis));
    expect_hits_of_brute_force("needle", flat(flat(random_soup(300, 6, 0.9f), 0), 0), 7);
    expect_hits_of_brute_force("one", random_soup(1, 8, 1.0f), 8);
    expect_hits_of_brute_force("far away", moved(soup, {1e6f, -3e5f, 1e4f}), 9);
    expect_hits_of_brute_force("tiny", scaled(soup, 1e-9f), 10);
    expect_hits_of_brute_force("huge", scaled(soup, 1e9f), 11);
    for (const Model& model : builtin_triangle_scenes(500))
        expect_hits_of_brute_force(model.name, model.mesh(), 12);
}

TEST(PassingRays, OnlyWhereManyDo) {
    const Scene scene(random_soup(500, 5, 0.2f));
    std::vector<Ray> rays = rays_from_outside(scene.bounds(), 2000, 1);
    for (Ray& ray : rays) ray.origin = {0.5f, 0.5f, 0.5f}, ray.tmax = infinity;
    EXPECT_FALSE(look_at(scene.bounds(), rays).passing);
    EXPECT_FALSE(look_at(scene.bounds(), std::span(rays).first(0)).passing);
}

}  // namespace
}  // namespace raydix::test
