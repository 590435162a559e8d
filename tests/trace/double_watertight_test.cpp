// Rays in double through the corners and edges of a closed surface, at home and where georeferenced
// meshes lie: none slips through, and crossings are counted right.
#include <gtest/gtest.h>
#include <raydix/raydix.h>

#include <iostream>

#include "support/double_scenes.h"
#include "support/random.h"
#include "support/support.h"
#include "trace/triangle_test.h"

namespace raydix::test {
namespace {

constexpr std::uint64_t double_watertight_seed = 20120731;

struct Closed {
    MeshD mesh;
    std::vector<Vec3d> inside;  // with room to the surface
};

Closed closed_figure(double scale, Vec3d move) {
    const Mesh home = load_model("builtin:figure?triangles=20000").mesh();
    const Bvh bvh = build_bvh(home);
    const Solid solid(bvh);
    Random random(double_watertight_seed);
    Closed closed{in_double(home, scale, move), {}};
    while (closed.inside.size() < 100) {
        const Vec3 p = random.in(bvh.bounds());
        if (signed_distance(solid, p) < -0.01f)
            closed.inside.push_back(scale * Vec3d{p.x, p.y, p.z} + move);
    }
    return closed;
}

/// A corner, the middle of an edge, or any point of one, in turn: what rays are aimed at.
Vec3d target(const MeshD& mesh, std::size_t kind, RandomD& random) {
    const Triangle& t = mesh.triangles[random.below(mesh.triangles.size())];
    const Vec3d a = mesh.vertices[t[0]], b = mesh.vertices[t[1]];
    return kind % 3 == 0 ? a : kind % 3 == 1 ? 0.5 * (a + b) : a + random.unit() * (b - a);
}

std::vector<RayD> rays_from_inside(const Closed& closed, std::size_t count) {
    RandomD random(double_watertight_seed);
    std::vector<RayD> rays(count);
    for (std::size_t i = 0; i < count; ++i) {
        const Vec3d from = closed.inside[random.below(closed.inside.size())];
        rays[i] = {from, 0.0, target(closed.mesh, i, random) - from};
    }
    return rays;
}

/// As far from the mesh as a sun would be.
std::vector<RayD> rays_from_outside(const Closed& closed, std::size_t count) {
    RandomD random(double_watertight_seed + 1);
    const AabbD box = box_of_mesh(closed.mesh);
    const double far = 1000.0 * (box.hi.z - box.lo.z);
    std::vector<RayD> rays(count);
    for (std::size_t i = 0; i < count; ++i) {
        const Vec3d d = random.direction();
        rays[i] = {target(closed.mesh, i, random) - far * d, 0.0, d};
    }
    return rays;
}

/// Out minus in. Which way a triangle faces is read in the ray's sheared plane, where crossings
/// are counted.
std::size_t count_wrong_crossings(const MeshD& mesh, const BvhD& bvh, std::span<const RayD> rays,
                                  int expected) {
    const AllHitsD all = trace_all(bvh, rays);
    EXPECT_GT(all.hits.size(), 0u);
    std::size_t wrong = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
        const RayFrameD frame = make_frame(rays[i]);
        int sum = 0;
        for (std::size_t k = all.offsets[i]; k < all.offsets[i + 1]; ++k) {
            const Triangle& t = mesh.triangles[all.hits[k].prim];
            sum += perturbed_edge_sign(shear(frame, mesh.vertices[t[0]]),
                                       shear(frame, mesh.vertices[t[1]]));
        }
        wrong += sum != expected;
    }
    return wrong;
}

void expect_watertight(const char* name, double scale, Vec3d move) {
    const Closed closed = closed_figure(scale, move);
    const BvhD bvh = build_bvh(closed.mesh);
    ASSERT_EQ(bvh.left_out(), 0u);
    const std::vector<RayD> rays = rays_from_inside(closed, 10'000 * thorough);
    std::size_t leaks = 0;
    for (const HitD& hit : trace(bvh, rays)) leaks += !hit.hit();
    EXPECT_EQ(leaks, 0u) << name << ", seed " << double_watertight_seed;
    const std::span<const RayD> some = std::span(rays).first(rays.size() / 2);
    const std::size_t inside_wrong = count_wrong_crossings(closed.mesh, bvh, some, 1);
    const std::size_t outside_wrong =
        count_wrong_crossings(closed.mesh, bvh, rays_from_outside(closed, rays.size() / 2), 0);
    EXPECT_EQ(inside_wrong, 0u) << name;
    EXPECT_EQ(outside_wrong, 0u) << name;
    std::cout << name << ": " << rays.size() << " rays, " << leaks << " leaks; crossings of "
              << rays.size() << " rays, " << inside_wrong + outside_wrong << " wrong\n";
}

TEST(DoubleWatertight, WhereItIs) { expect_watertight("at home", 1.0, {0.0, 0.0, 0.0}); }
TEST(DoubleWatertight, Georeferenced) {
    expect_watertight("at a UTM place", 0.37, utm_place);
    expect_watertight("a millimetre at a UTM place", 1e-4, utm_place);
}
TEST(DoubleWatertight, TinyAndHuge) {
    expect_watertight("1e-9 x", 1e-9, {0.0, 0.0, 0.0});
    expect_watertight("1e10 x", 1e10, {0.0, 0.0, 0.0});
}

}  // namespace
}  // namespace raydix::test
