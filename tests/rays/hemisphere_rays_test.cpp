// src/rays/hemisphere_rays.h
#include "rays/hemisphere_rays.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <random>
#include <vector>

#include "base/double3.h"
#include "exec/parallel.h"
#include "rays/sampling.h"

namespace raydix {
namespace {

std::vector<SurfacePoint> random_points(std::size_t count) {
    std::mt19937 random(7);
    std::normal_distribution<double> normal;
    std::vector<SurfacePoint> points(count);
    for (std::size_t i = 0; i < count; ++i) {
        const Double3 n(normal(random), normal(random), normal(random));
        points[i] = {{1, 2, 3}, normalized(n).rounded(), static_cast<std::uint32_t>(i), 0};
    }
    points[0].normal = {1, 0, 0};
    points[1].normal = {0, -1, 0};
    points[2].normal = {0, 0, 1};
    return points;
}

std::vector<Ray> rays_of(const std::vector<SurfacePoint>& points, const HemisphereOptions& options,
                         int threads = 1) {
    std::vector<Ray> rays(points.size() * options.samples);
    with_threads(threads, [&] { make_hemisphere_rays(points, options, rays); });
    return rays;
}

TEST(HemisphereRays, KeepTheHaltonAnglesAboutEveryNormal) {
    const auto points = random_points(100);
    const auto directions = halton_directions(1, 32);
    const auto rays = rays_of(points, {.samples = 32, .tmax = 5.0f});
    for (std::size_t i = 0; i < points.size(); ++i)
        for (std::size_t k = 0; k < 32; ++k) {
            const Ray& ray = rays[i * 32 + k];
            const Double3 d(ray.direction);
            EXPECT_NEAR(dot(d, Double3(points[i].normal)), directions[k].z, 1e-6);
            EXPECT_NEAR(length(d), 1.0, 1e-6);
            EXPECT_EQ(ray.tmin, 0.0f);
            EXPECT_EQ(ray.tmax, 5.0f);
            EXPECT_EQ(ray.origin.y, 2.0f);
        }
}

TEST(HemisphereRays, TurnTogetherByTheHashOfThePixel) {
    // About +z, ray k points at the Halton angle plus one angle that is the same for all k.
    const auto directions = halton_directions(1, 16);
    for (const std::uint32_t pixel : {0u, 5u, 1000000u}) {
        const std::vector<SurfacePoint> points{{{0, 0, 0}, {0, 0, 1}, pixel, 0}};
        const auto rays = rays_of(points, {.samples = 16, .seed = 3});
        const auto turn = [&](std::size_t k) {
            const double a = std::atan2(rays[k].direction.y, rays[k].direction.x) -
                             std::atan2(directions[k].y, directions[k].x);
            return std::remainder(a, 2 * std::numbers::pi);
        };
        for (std::size_t k = 1; k < 16; ++k)
            EXPECT_NEAR(std::remainder(turn(k) - turn(0), 2 * std::numbers::pi), 0.0, 1e-5);
        const std::vector<SurfacePoint> first{{{0, 0, 0}, {0, 0, 1}, 9, 0}};
        const auto other = rays_of(first, {.samples = 16, .seed = 3});
        EXPECT_NE(other[0].direction.x, rays[0].direction.x);
        const double expected = 2 * std::numbers::pi *
                                (double(unit_from(hash_of(3, pixel))) - unit_from(hash_of(3, 9)));
        const double between = std::atan2(rays[0].direction.y, rays[0].direction.x) -
                               std::atan2(other[0].direction.y, other[0].direction.x);
        EXPECT_NEAR(std::remainder(between - expected, 2 * std::numbers::pi), 0.0, 1e-5);
    }
}

TEST(HemisphereRays, SequencesShareOneRunOfPoints) {
    std::vector<SurfacePoint> parts(4, {{0, 0, 0}, {0, 0, 1}, 77, 0});
    for (std::uint32_t s = 0; s < 4; ++s) parts[s].sequence = s;
    const auto split = rays_of(parts, {.samples = 8, .sequences = 4});
    const auto whole = rays_of({parts[0]}, {.samples = 32});
    ASSERT_EQ(split.size(), whole.size());
    EXPECT_EQ(std::memcmp(split.data(), whole.data(), whole.size() * sizeof(Ray)), 0);
}

TEST(HemisphereRays, AreTheSameForEveryThreadCount) {
    const auto points = random_points(5000);
    const auto one = rays_of(points, {}, 1);
    for (const int threads : {2, 7}) {
        const auto many = rays_of(points, {}, threads);
        EXPECT_EQ(std::memcmp(one.data(), many.data(), one.size() * sizeof(Ray)), 0);
    }
}

TEST(SurfaceNormal, TurnsTowardTheRay) {
    const Vec3 a{0, 0, 0}, b{2, 0, 0}, c{0, 3, 0};
    EXPECT_EQ(normal_of(a, b, c).z, 6.0);
    EXPECT_EQ(normal_toward(normal_of(a, b, c), {0, 0, -1}).z, 1.0f);
    EXPECT_EQ(normal_toward(normal_of(a, b, c), {0, 0, 1}).z, -1.0f);
    EXPECT_EQ(normal_toward(normal_of(a, c, b), {0.5f, 0, -1}).z, 1.0f);
    EXPECT_EQ(normal_toward(normal_of(a, a, b), {0, -2, 0}).y, 1.0f);  // no area: against the ray
    // Far too small for float32 products.
    const Double3 small = normal_of({0, 0, 0}, {1e-30f, 0, 0}, {0, 1e-30f, 0});
    EXPECT_EQ(normal_toward(small, {0, 0, -1}).z, 1.0f);
}

TEST(SurfacePointBefore, StepsBackByADistanceNotByT) {
    const Ray ray{{0, 0, 10}, 0.0f, {0, 0, -4}, infinity};
    EXPECT_FLOAT_EQ(point_before(ray, 2.0f, 0.5).z, 2.5f);
    EXPECT_EQ(point_before(ray, 2.0f, 0.0).z, 2.0f);
}

}  // namespace
}  // namespace raydix
