// Moving scenes whose meshes change: the same answers from refitted trees as from new ones.
#include <gtest/gtest.h>
#include <raydix/error.h>
#include <raydix/scene.h>
#include <raydix/trace.h>

#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <map>
#include <utility>
#include <vector>

#include "support/random.h"
#include "support/sanitized.h"

namespace raydix {
namespace {

constexpr float nan = std::numeric_limits<float>::quiet_NaN();

bool same(const Hit& a, const Hit& b) { return std::memcmp(&a, &b, sizeof(Hit)) == 0; }

/// From around the unit square to places on it and beside it.
std::vector<Ray> rays_about(test::Random& random, std::size_t count) {
    std::vector<Ray> rays;
    for (std::size_t i = 0; i < count; ++i) {
        const Vec3 from = random.in(-2, 3), to = i % 2 == 0 ? random.in(0, 1) : random.in(-3, 3);
        Ray ray{from, 0, {to.x - from.x, to.y - from.y, to.z - from.z}};
        if (i % 5 == 0) ray.tmax = random.between(0.2f, 1.0f);
        if (i % 97 == 0) ray.direction = {0, 0, 0};
        rays.push_back(ray);
    }
    return rays;
}

/// A wavy sheet of 2 * side^2 triangles, and one without area.
Mesh sheet(std::uint32_t side, float height, float phase) {
    Mesh mesh;
    for (std::uint32_t y = 0; y <= side; ++y)
        for (std::uint32_t x = 0; x <= side; ++x) {
            const float u = static_cast<float>(x) / static_cast<float>(side),
                        v = static_cast<float>(y) / static_cast<float>(side);
            mesh.vertices.push_back({u, v, height * std::sin(20 * u + 15 * v + phase)});
        }
    for (std::uint32_t y = 0; y < side; ++y)
        for (std::uint32_t x = 0; x < side; ++x) {
            const std::uint32_t a = y * (side + 1) + x, b = a + side + 1;
            mesh.triangles.push_back({a, a + 1, b});
            mesh.triangles.push_back({a + 1, b + 1, b});
        }
    mesh.triangles.push_back({0, 1, 1});
    return mesh;
}

Transform placed(test::Random& random, Vec3 at) {
    Transform t;
    for (auto& row : t.m)
        for (int c = 0; c < 3; ++c) row[c] = random.between(-0.2f, 0.2f);
    for (int a = 0; a < 3; ++a) t.m[a][a] += 0.4f;
    t.m[0][3] = at.x, t.m[1][3] = at.y, t.m[2][3] = at.z;
    return t;
}

TEST(SceneRefit, MovedInstancesRefitTheTreeOverPartsWhileItIsGood) {
    test::Random random(17);
    const Scene leaf(sheet(6, 0.3f, 0));
    const SceneOptions moving{.usage = Usage::moving};
    constexpr std::uint32_t side = 9, count = side * side * side;
    const auto home = [&](std::uint32_t k, float by) {
        const auto at = [&](std::uint32_t n) {
            return static_cast<float>(n) + random.between(-by, by);
        };
        return Vec3{at(k % side), at(k / side % side), at(k / side / side)};
    };
    Scene scene;
    std::map<std::uint32_t, Transform> places;
    const auto add = [&](Vec3 at) {
        const Transform place = placed(random, at);
        places[scene.add(leaf, place)] = place;
    };
    const auto move = [&](std::uint32_t id, Vec3 at) {
        places[id] = placed(random, at);
        scene.set_transform(id, places[id]);
    };
    scene.add(sheet(20, 0.5f, 1));  // a part of its own
    for (std::uint32_t k = 0; k < count; ++k) add(home(k, 0.2f));
    std::vector<Ray> rays;
    for (int i = 0; i < 3000; ++i) {
        const Vec3 from = random.in(-1, side), to = random.in(-1, side);
        rays.push_back({from, 0, {to.x - from.x, to.y - from.y, to.z - from.z}});
    }
    EXPECT_FALSE(scene.commit(moving).parts_refitted);
    const auto commit = [&](const SceneOptions& options, bool refitted, const char* what) {
        SCOPED_TRACE(what);
        EXPECT_EQ(scene.commit(options).parts_refitted, refitted);
        Scene fresh;  // the same geometries
        fresh.add(sheet(20, 0.5f, 1));
        for (const auto& [id, place] : places) fresh.add(leaf, place, {.id = id});
        fresh.commit({.usage = Usage::fixed});
        const std::vector<Hit> hits = trace(scene, rays), wanted = trace(fresh, rays);
        std::size_t different = 0, found = 0;
        for (std::size_t i = 0; i < rays.size(); ++i)
            different += !same(hits[i], wanted[i]), found += hits[i].hit();
        EXPECT_EQ(different, 0u);
        EXPECT_GT(found, rays.size() / 2);
        const Aabb box = scene.bounds(), other = fresh.bounds();
        EXPECT_EQ(std::memcmp(&box, &other, sizeof box), 0);
    };
    commit(moving, false, "nothing moved");
    for (int turn = 0; turn < 3; ++turn) {
        for (std::uint32_t k = 0; k < count; ++k) move(k + 1, home(k, 0.4f));
        commit(moving, true, "a little");
    }
    for (std::uint32_t k = 0; k < count; ++k) move(k + 1, random.in(0, side));
    commit(moving, false, "to other places");
    SceneOptions other = moving;
    other.refit_limit = 1e9;
    for (std::uint32_t k = 0; k < count; ++k) move(k + 1, home(k, 0.2f));
    commit(other, true, "a limit out of reach");
    other.refit_limit = 0;
    commit(other, false, "never");
    commit({.usage = Usage::fixed}, false, "another usage");
    commit(moving, false, "and back");
    add(home(0, 0.2f));
    commit(moving, false, "one more");
    scene.remove(5);
    places.erase(5);
    commit(moving, false, "one less");
    commit(moving, false, "as it is");
}

TEST(SceneRefit, MovedVerticesRefitATreeWhileItIsGood) {
    Mesh mesh = sheet(40, 0.02f, 0);
    const SceneOptions moving{.usage = Usage::moving};
    test::Random random(3);
    const std::vector<Ray> rays = rays_about(random, test::fewer(3000, 30));
    for (const Quality quality : {Quality::fast, Quality::balanced}) {
        SceneOptions options = moving;
        options.quality = quality;
        Scene scene;
        scene.add(mesh);
        EXPECT_EQ(scene.commit(options).trees_built, 1u);
        const auto commit = [&](const Mesh& other, bool refitted, const char* what) {
            SCOPED_TRACE(what);
            scene.update(0, other);
            const CommitReport report = scene.commit(options);
            EXPECT_EQ(report.trees_refitted, refitted ? 1u : 0u);
            EXPECT_EQ(report.trees_built, refitted ? 0u : 1u);
            const std::vector<Hit> hits = trace(scene, rays),
                                   wanted = trace_brute_force(other, rays);
            std::size_t different = 0, found = 0;
            for (std::size_t i = 0; i < rays.size(); ++i)
                different += !same(hits[i], wanted[i]), found += hits[i].hit();
            EXPECT_EQ(different, 0u);
            EXPECT_GT(found, test::fewer(20, 20));
            const Aabb box = scene.bounds(), fresh = Scene(other).bounds();
            EXPECT_EQ(std::memcmp(&box, &fresh, sizeof box), 0);
            return report.sah_ratio;
        };
        EXPECT_NEAR(commit(mesh, true, "nothing moved"), 1.0, 1e-9);
        for (int k = 1; k < 4; ++k)
            EXPECT_LE(commit(sheet(40, 0.02f, static_cast<float>(k)), true, "waves"), 1.5);
        Mesh other = mesh;
        for (Vec3& v : other.vertices) v = {v.x * 7 - 3, v.y * 7 + 2, v.z * 7};
        EXPECT_NEAR(commit(other, true, "moved as one"), 1.0, 0.01);
        commit(mesh, true, "back");

        std::vector<Vec3> places = mesh.vertices;
        for (std::size_t i = places.size(); i > 1; --i)
            std::swap(places[i - 1], places[random.below(i)]);
        other.vertices = places;
        EXPECT_GT(commit(other, false, "shuffled"), 1.5);
        options.refit_limit = 1000;
        commit(mesh, true, "a limit out of reach");
        options.refit_limit = 0;
        commit(mesh, false, "never");
        options.refit_limit = 1.5;

        other = mesh;
        other.triangles.back() = {0, 1, 50};
        commit(other, false, "a triangle got area");
        commit(mesh, false, "a triangle lost its area");
        other = mesh;
        other.vertices[100].x = nan;
        commit(other, false, "triangles went out");
        commit(mesh, false, "triangles came in");
        other = mesh;
        other.triangles.push_back({0, 1, 50});
        commit(other, false, "one more");
        scene.update(0, mesh);
        options.compact = true;
        scene.commit(options);
        commit(mesh, false, "compact");
    }
    Scene scene;
    scene.add(mesh);
    EXPECT_THROW(scene.commit({.refit_limit = -1}), InputError);
    EXPECT_THROW(scene.commit({.refit_limit = std::numeric_limits<double>::quiet_NaN()}),
                 InputError);
}

}  // namespace
}  // namespace raydix
