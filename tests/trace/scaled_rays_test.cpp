// Rays with long and short directions in batches: the bits of single calls, however they go.
#include "trace/simd/scaled_rays.h"

#include <gtest/gtest.h>
#include <raydix/scene.h>
#include <raydix/wide.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>
#include <vector>

#include "base/plain_scale.h"
#include "support/random.h"
#include "support/sanitized.h"
#include "support/support.h"
#include "trace/simd/wide_batch.h"

namespace raydix::test {
namespace {

constexpr float most = std::numeric_limits<float>::max();

/// Directions from subnormal to as long as floats are, limits on both sides, and rays that are
/// invalid. `odd`: of how many rays one has a direction far from unit length.
std::vector<Ray> any_rays(Random& random, std::size_t count, std::uint32_t odd) {
    std::vector<Ray> rays;
    for (std::size_t i = 0; i < count; ++i) {
        const Vec3 from = random.in(-2, 2), to = random.in(-1, 1);
        Vec3 way = to - from;
        way = way * (1.0f / std::sqrt(way.x * way.x + way.y * way.y + way.z * way.z));
        Ray ray{from, 0, way};
        if (i % odd == 0) {
            const int exponent = static_cast<int>(random.below(290)) - 160;
            const float factor = std::ldexp(random.between(0.5f, 1), exponent);
            ray.direction = way * factor;
            if (random.below(2) == 0) ray.tmax = random.between(0, 4) / factor;
            if (random.below(3) == 0) ray.tmin = random.between(0, 1) / factor;
        }
        switch (random.below(40)) {
            case 0:
                ray.direction = {0, 0, 0};
                break;
            case 1:
                ray.origin.y = infinity;
                break;
            case 2:
                ray.tmin = ray.tmax = most;
                break;
            case 3:
                ray.tmin = 2, ray.tmax = 1;
                break;
            case 4:
                ray.direction.x = std::numeric_limits<float>::quiet_NaN();
                break;
            default:
                break;
        }
        rays.push_back(ray);
    }
    return rays;
}

std::vector<Ray> along_a_curve(std::vector<Ray> rays) {
    std::ranges::sort(rays, {}, [](const Ray& ray) { return ray.origin.x; });
    return rays;
}

TEST(ScaledRays, PowersOfTwoFromBitsAreThoseOfDirectionScale) {
    Random random(3);
    const auto expect = [](auto length) {
        const bool near_unit = length > 0x1p-3f && length < 0x1p3f;
        if (near_unit || !is_plainly_scaled(length)) return;
        EXPECT_EQ(plain_scale(length), direction_scale(length)) << length;
    };
    for (int exponent = -100; exponent <= 100; ++exponent) {
        const double power = std::ldexp(1.0, exponent);
        expect(power), expect(static_cast<float>(power));
        expect(std::nextafter(power, 0.0)), expect(std::nextafterf(static_cast<float>(power), 0));
        const float between = static_cast<float>(power) * random.between(1, 2);
        expect(between), expect(double{between});
    }
}

TEST(ScaledRays, VectorsOfCopiesAreTheCopies) {
    Random random(9);
    const std::vector<Ray> rays = any_rays(random, 5000, 1);
    std::vector<std::uint32_t> order(rays.size());
    std::iota(order.rbegin(), order.rend(), 0u);
    for (const SimdKernels& kernels : simd_kernels())
        for (const std::uint32_t* const by : {static_cast<std::uint32_t*>(nullptr), order.data()})
            for (const std::size_t n : {std::size_t{1}, std::size_t{15}, rays.size()}) {
                std::vector<Ray> copies(n + spare_scaled_rays);
                std::vector<float> scales(n + spare_scaled_rays);
                kernels.scale(rays.data(), by, n, copies.data(), scales.data());
                for (std::size_t k = 0; k < n; ++k) {
                    Ray copy;
                    const float scale = scaled_copy(rays[by == nullptr ? k : by[k]], copy);
                    ASSERT_EQ(scales[k], scale) << kernels.isa << " " << k;
                    ASSERT_EQ(std::memcmp(&copies[k], &copy, sizeof(Ray)), 0) << k;
                }
            }
}

TEST(ScaledRays, CopiesHaveTheFrameOfTheRay) {
    Random random(4);
    std::size_t scaled = 0;
    for (const Ray& ray : any_rays(random, 20000, 1)) {
        Ray copy;
        const float scale = scaled_copy(ray, copy);
        EXPECT_EQ(is_valid(copy), is_valid(ray));
        if (!is_valid(ray)) continue;
        const RayFrame expected = make_frame(ray), frame = make_frame(copy);
        EXPECT_EQ(scale * frame.t_scale, expected.t_scale);
        if (scale == 1) {
            EXPECT_EQ(std::memcmp(&copy, &ray, sizeof(Ray)), 0);
            continue;
        }
        ++scaled;
        RayFrame same = frame;
        same.t_scale = expected.t_scale;
        EXPECT_EQ(std::memcmp(&same.origin, &expected.origin, sizeof(Vec3)), 0);
        EXPECT_EQ(std::memcmp(&same.direction, &expected.direction, sizeof(Vec3)), 0);
        EXPECT_EQ(same.tmin, expected.tmin);
        EXPECT_EQ(same.tmax, expected.tmax);
        EXPECT_EQ(frame.t_scale, 1.0f);
    }
    EXPECT_GT(scaled, 10000u);
}

/// By single calls.
void expect_same(const WideBvh& tree, const std::vector<Ray>& rays, std::size_t calls) {
    std::vector<Hit> expected;
    std::size_t invalid = 0, found = 0;
    for (const Ray& ray : rays) {
        expected.push_back(closest_hit(tree, ray));
        invalid += !is_valid(ray);
        found += expected.back().hit();
    }
    for (const int threads : {1, 2})
        for (std::size_t call = 0; call < calls; ++call) {  // trials go all ways
            std::vector<Hit> hits(rays.size());
            std::vector<std::uint8_t> occluded(rays.size());
            const TraceCounts counts = trace(tree, rays, hits, {.threads = threads});
            EXPECT_EQ(counts.invalid_rays, invalid);
            EXPECT_EQ(counts.hits, found);
            EXPECT_EQ(std::memcmp(hits.data(), expected.data(), hits.size() * sizeof(Hit)), 0);
            EXPECT_EQ(trace_any(tree, rays, occluded, {.threads = threads}).invalid_rays, invalid);
            for (std::size_t i = 0; i < rays.size(); ++i)
                ASSERT_EQ(occluded[i] != 0, expected[i].hit()) << i;
        }
}

TEST(ScaledRays, BatchesOfAllSizesHaveTheBitsOfSingleCalls) {
    const WideBvh tree = build_wide_bvh(random_soup(3000, 5, 0.2f));
    Random random(7);
    for (const std::uint32_t odd : {1u, 3u, 20u})
        for (const std::size_t count : {1u, 7u, 64u, 127u, 300u, 1024u, 5000u})
            expect_same(tree, any_rays(random, count, odd), fewer(count < 512 ? 24 : 6, 3));
}

TEST(ScaledRays, SortedBatchesToo) {
    const WideBvh tree = build_wide_bvh(random_soup(3000, 6, 0.2f));
    Random random(8);
    const std::vector<Ray> rays = any_rays(random, 20000, 2);
    const BatchLook look = look_at(tree.arrays().bounds, rays);
    EXPECT_EQ(look.path, SimdPath::sorted);
    EXPECT_TRUE(look.scaled);
    expect_same(tree, rays, fewer(4, 2));
    EXPECT_NE(look_at(tree.arrays().bounds, along_a_curve(rays)).kind.apart, 0u);
}

TEST(ScaledRays, AFewOddOnesAreNotWorthCopies) {
    const WideBvh tree = build_wide_bvh(random_soup(100, 6, 0.2f));
    Random random(9);
    EXPECT_FALSE(look_at(tree.arrays().bounds, any_rays(random, 5000, 50)).scaled);
    EXPECT_TRUE(look_at(tree.arrays().bounds, any_rays(random, 5000, 4)).scaled);
}

}  // namespace
}  // namespace raydix::test
