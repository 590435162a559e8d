// Support tables of meshes and boxes, and the boxes of instances that follow from them.
#include "engine/support.h"

#include <gtest/gtest.h>
#include <raydix/model.h>
#include <raydix/scene.h>

#include <random>

#include "engine/scene_state.h"
#include "support/sanitized.h"

namespace raydix {
namespace {

double farthest(const Mesh& mesh, Double3 d) {
    double most = -std::numeric_limits<double>::infinity();
    for (const Triangle& t : mesh.triangles)
        for (const std::uint32_t v : t) most = std::max(most, dot(Double3(mesh.vertices[v]), d));
    return most;
}

Double3 random_direction(std::mt19937& random) {
    std::uniform_real_distribution<double> sign(-1.0, 1.0);
    for (;;)
        if (const Double3 d{sign(random), sign(random), sign(random)}; length(d) > 0.1) return d;
}

const SceneTree& tree_of(const Scene& scene) { return *SceneInternals::tree(scene); }

TEST(Support, ReachesAsFarAsTheMeshAndLittleFarther) {
    const Mesh mesh = load_model("builtin:figure?triangles=5000", 5).mesh();
    for (const bool compact : {false, true})
        for (const Usage usage : {Usage::fixed, Usage::moving}) {
            Scene scene;
            scene.add(mesh);
            Mesh moved = mesh;
            for (Vec3& v : moved.vertices) v = v + Vec3{0.5f, 0.25f, 0.0f};
            scene.add(moved);
            scene.commit({.usage = usage, .compact = compact});
            const Support support = support_of(tree_of(scene));
            const double size = diagonal_of(scene.bounds());
            std::mt19937 random(7);
            constexpr std::size_t directions = test::fewer(500, 10);
            double spare = 0;
            for (std::size_t k = 0; k < directions; ++k) {
                const Double3 d = random_direction(random);
                const Reach reach = support.along(d);
                const double along = std::max(farthest(mesh, d), farthest(moved, d)),
                             against =
                                 std::max(farthest(mesh, d * -1.0), farthest(moved, d * -1.0));
                ASSERT_GE(reach.along, along);
                ASSERT_GE(reach.against, against);
                ASSERT_LE(reach.along, along + 0.05 * size * length(d));
                ASSERT_LE(reach.against, against + 0.05 * size * length(d));
                spare += (reach.along - along) / (double(directions) * size * length(d));
            }
            EXPECT_LT(spare, 0.01);
        }
}

TEST(Support, IsExactAlongAxesAndForBoxes) {
    Mesh box;
    for (int corner = 0; corner < 8; ++corner)
        box.vertices.push_back(
            {corner & 1 ? 3.0f : -1.0f, corner & 2 ? 2.0f : 0.5f, corner & 4 ? -4.0f : -7.0f});
    for (std::uint32_t a = 0; a < 8; ++a) box.triangles.push_back({a, (a + 1) % 8, (a + 3) % 8});
    const Scene scene(box);
    const Support support = support_of(tree_of(scene));
    std::mt19937 random(11);
    for (int k = 0; k < 200; ++k) {
        const Double3 d = k < 3 ? Double3{k == 0 ? -2.0 : 0.0, k == 1 ? 1.0 : 0.0, k == 2 ? 5.0 : 0}
                                : random_direction(random);
        const Reach reach = support.along(d);
        EXPECT_NEAR(reach.along, farthest(box, d), 1e-4);
        EXPECT_NEAR(reach.against, farthest(box, d * -1.0), 1e-4);
    }
    EXPECT_EQ(support.along({0, 0, 0}).along, 0);
}

TEST(Support, BoxesOfNestedInstancesHoldTheirVertices) {
    const Mesh mesh = load_model("builtin:figure?triangles=5000", 3).mesh();
    std::mt19937 random(13);
    std::uniform_real_distribution<float> entry(-1.0f, 1.0f);
    const auto transform = [&] {
        Transform t;
        for (auto& row : t.m)
            for (float& x : row) x = entry(random);
        return t;
    };
    for (int round = 0; round < 20; ++round) {
        const Transform outer = transform(), inner = transform();
        Scene leaf(mesh), middle, top;
        middle.add(leaf, inner);
        middle.commit();
        top.add(middle, outer);
        top.commit();
        const Affine a = affine_of(inner), b = affine_of(outer);
        Double3 lo{1e9, 1e9, 1e9}, hi{-1e9, -1e9, -1e9};
        for (const Triangle& t : mesh.triangles)
            for (const std::uint32_t v : t) {
                const Double3 p = b.point(a.point(Double3(mesh.vertices[v])));
                lo = {std::min(lo.x, p.x), std::min(lo.y, p.y), std::min(lo.z, p.z)};
                hi = {std::max(hi.x, p.x), std::max(hi.y, p.y), std::max(hi.z, p.z)};
            }
        const Aabb box = top.bounds();
        const double spare = 0.05 * length(hi - lo);
        for (const auto& [inside, outside] : {std::pair{lo.x, box.lo.x},
                                              {lo.y, box.lo.y},
                                              {lo.z, box.lo.z},
                                              {-hi.x, -box.hi.x},
                                              {-hi.y, -box.hi.y},
                                              {-hi.z, -box.hi.z}}) {
            EXPECT_LE(double{outside}, inside);
            EXPECT_GE(double{outside}, inside - spare);
        }
    }
}

}  // namespace
}  // namespace raydix
