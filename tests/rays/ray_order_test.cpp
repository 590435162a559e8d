// src/rays/ray_order.h
#include "rays/ray_order.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numeric>
#include <random>
#include <string>

#include "base/double3.h"
#include "exec/parallel.h"

namespace raydix {
namespace {

/// Unit directions; tmin carries the position, so that each ray can be told from the others.
std::vector<Ray> random_rays(std::size_t count, float tmax) {
    std::mt19937 random(11);
    std::uniform_real_distribution<float> place(-5.0f, 5.0f);
    std::normal_distribution<double> normal;
    std::vector<Ray> rays(count);
    for (std::size_t i = 0; i < count; ++i)
        rays[i] = {{place(random), place(random), 2.0f},
                   static_cast<float>(i),
                   normalized(Double3(normal(random), normal(random), normal(random))).rounded(),
                   tmax};
    return rays;
}

std::string bits_of(std::uint64_t word, int count) {
    std::string text;
    for (int bit = count - 1; bit >= 0; --bit) text += (word >> bit & 1) ? '1' : '0';
    return text;
}

std::string text_of(const RayKey& key) {
    return bits_of(key.high, 51) + bits_of(key.middle, 60) + bits_of(key.low, 24);
}

/// The same key put together bit by bit, as its definition reads.
std::string reference_key(const Ray& ray, const Aabb& box) {
    const double o[] = {ray.origin.x, ray.origin.y, ray.origin.z};
    const double lo[] = {box.lo.x, box.lo.y, box.lo.z}, hi[] = {box.hi.x, box.hi.y, box.hi.z};
    const Double3 unit = normalized(Double3(ray.direction));
    const double d[] = {unit.x, unit.y, unit.z};
    std::uint64_t cells[6];
    for (int k = 0; k < 3; ++k) {
        const double part = hi[k] > lo[k] ? (o[k] - lo[k]) / (hi[k] - lo[k]) : 0.0;
        cells[k] = static_cast<std::uint64_t>(std::clamp(part * 16777216.0, 0.0, 16777215.0));
        cells[3 + k] =
            static_cast<std::uint64_t>(std::clamp((d[k] * 0.5 + 0.5) * 2097152.0, 0.0, 2097151.0));
    }
    std::string text;
    for (int level = 23; level >= 0; --level)
        for (int k = 0; k < (level > 20 ? 3 : 6); ++k) text += (cells[k] >> level & 1) ? '1' : '0';
    return text;
}

std::vector<float> identities(const std::vector<Ray>& rays) {
    std::vector<float> ids;
    for (const Ray& ray : rays) ids.push_back(ray.tmin);
    return ids;
}

TEST(EndPointBox, HoldsBothEndsWhereTheyAreFinite) {
    const std::vector<Ray> rays{{{0, 0, 0}, 0.0f, {1, 2, 0}, 3.0f},
                                {{-1, 0, 5}, 0.0f, {0, 0, 1}, infinity}};
    const Aabb box = end_point_box(rays, infinity);
    EXPECT_EQ(box.lo.x, -1.0f);
    EXPECT_EQ(box.hi.x, 3.0f);
    EXPECT_EQ(box.hi.y, 6.0f);
    EXPECT_EQ(box.hi.z, 5.0f);
    EXPECT_EQ(end_point_box(rays, 7.0f).hi.z, 12.0f);
}

TEST(RayKey, BitsByHand) {
    const Aabb box{{0, 0, 0}, {1, 1, 1}};
    // Origin x in the upper half: the first bit. Direction +z: all its bits, x and y just the
    // middle (bit 20).
    const RayKey key = ray_key({{0.5f, 0, 0}, 0.0f, {0, 0, 3}, 1.0f}, box);
    std::string expected =
        "100"
        "000"
        "000"
        "000111";
    for (int level = 19; level >= 0; --level) expected += "000001";
    EXPECT_EQ(text_of(key), expected);
    // The far corner is clamped into the last cell.
    EXPECT_EQ(text_of(ray_key({{1, 1, 1}, 0.0f, {-1, 0, 0}, 1.0f}, box)).substr(0, 15),
              "111111111"
              "111011");
}

TEST(RayKey, EqualsItsDefinition) {
    const auto rays = random_rays(2000, 4.0f);
    const Aabb box = end_point_box(rays, infinity);
    for (const Ray& ray : rays) ASSERT_EQ(text_of(ray_key(ray, box)), reference_key(ray, box));
}

TEST(RayKey, TakesAnyRay) {
    const float nan = std::nanf("");
    const Aabb box{{0, 0, 0}, {1, 0, 1}};
    (void)ray_key({{nan, nan, nan}, 0.0f, {nan, 0, 0}, 1.0f}, box);
    (void)ray_key({{infinity, -infinity, 9}, 0.0f, {0, 0, 0}, nan}, box);
    const RayKey flat = ray_key({{0, 0.7f, 0}, 0.0f, {-1, 0, 0}, 1.0f}, box);
    EXPECT_EQ(text_of(flat).substr(0, 9), "000000000");
}

TEST(SortRays, AscendingKeysOfTheSameRays) {
    const std::size_t count = 150000;  // several blocks and an odd number of merges
    auto rays = random_rays(count, infinity);
    const Aabb box = end_point_box(rays, infinity);
    sort_rays(rays, infinity);
    for (std::size_t i = 1; i < count; ++i)
        ASSERT_LE(ray_key(rays[i - 1], box), ray_key(rays[i], box)) << i;
    auto ids = identities(rays);
    std::sort(ids.begin(), ids.end());
    for (std::size_t i = 0; i < count; ++i) ASSERT_EQ(ids[i], static_cast<float>(i));
}

TEST(SortRays, EqualKeysKeepTheirOrder) {
    std::vector<Ray> rays(100000, Ray{{1, 1, 1}, 0.0f, {0, 1, 0}, 1.0f});
    for (std::size_t i = 0; i < rays.size(); ++i) rays[i].tmax = static_cast<float>(i) * 1e-9f;
    sort_rays(rays, infinity);
    for (std::size_t i = 1; i < rays.size(); ++i) ASSERT_LT(rays[i - 1].tmax, rays[i].tmax);
}

TEST(RayOrder, IsTheSameForEveryThreadCount) {
    std::vector<Ray> sorted[3], shuffled[3];
    const int threads[] = {1, 2, 7};
    for (int k = 0; k < 3; ++k)
        with_threads(threads[k], [&] {
            sorted[k] = shuffled[k] = random_rays(100000, 1.0f);
            sort_rays(sorted[k], infinity);
            shuffle_rays(shuffled[k], 5);
        });
    for (int k = 1; k < 3; ++k) {
        EXPECT_EQ(std::memcmp(sorted[0].data(), sorted[k].data(), 100000 * sizeof(Ray)), 0);
        EXPECT_EQ(std::memcmp(shuffled[0].data(), shuffled[k].data(), 100000 * sizeof(Ray)), 0);
    }
}

TEST(ShuffleRays, IsAPermutationThatDependsOnTheSeed) {
    const auto original = random_rays(10000, 1.0f);
    auto one = original, two = original;
    shuffle_rays(one, 1);
    shuffle_rays(two, 2);
    EXPECT_NE(identities(one), identities(two));
    auto ids = identities(one);
    // Neighbours end up about a third of the batch apart.
    double apart = 0;
    for (std::size_t i = 1; i < ids.size(); ++i) apart += std::abs(ids[i] - ids[i - 1]) / 1e8;
    EXPECT_NEAR(apart, 1.0 / 3.0, 0.02);
    std::sort(ids.begin(), ids.end());
    EXPECT_EQ(ids, identities(original));
}

TEST(RayOrder, NoneAndOne) {
    std::vector<Ray> rays;
    sort_rays(rays, infinity);
    shuffle_rays(rays, 1);
    EXPECT_TRUE(rays.empty());
    rays = random_rays(1, 1.0f);
    sort_rays(rays, infinity);
    EXPECT_EQ(rays.size(), 1u);
}

}  // namespace
}  // namespace raydix
