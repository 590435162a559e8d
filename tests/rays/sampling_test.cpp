// src/rays/sampling.h
#include "rays/sampling.h"

#include <gtest/gtest.h>

#include <set>

namespace raydix {
namespace {

TEST(Halton, FirstValues) {
    const double base2[] = {0.0,     1 / 2.0, 1 / 4.0, 3 / 4.0, 1 / 8.0,
                            5 / 8.0, 3 / 8.0, 7 / 8.0, 1 / 16.0};
    const double base3[] = {0.0,     1 / 3.0, 2 / 3.0, 1 / 9.0, 4 / 9.0,
                            7 / 9.0, 2 / 9.0, 5 / 9.0, 8 / 9.0};
    for (std::uint32_t i = 0; i < 9; ++i) {
        EXPECT_DOUBLE_EQ(radical_inverse(2, i), base2[i]) << i;
        EXPECT_DOUBLE_EQ(radical_inverse(3, i), base3[i]) << i;
    }
    EXPECT_LT(radical_inverse(3, 0xFFFFFFFFu), 1.0);
}

TEST(CosineDirections, MomentsOfTheCosineLaw) {
    const auto directions = halton_directions(1, 20000);
    double x = 0, y = 0, z = 0, xx = 0, zz = 0;
    for (const Vec3& d : directions) {
        ASSERT_GT(d.z, 0.0f);
        ASSERT_NEAR(d.x * d.x + d.y * d.y + d.z * d.z, 1.0, 1e-6);
        x += d.x, y += d.y, z += d.z, xx += d.x * d.x, zz += d.z * d.z;
    }
    const double n = 20000;
    EXPECT_NEAR(x / n, 0.0, 2e-3);
    EXPECT_NEAR(y / n, 0.0, 2e-3);
    EXPECT_NEAR(z / n, 2.0 / 3.0, 1e-3);
    EXPECT_NEAR(xx / n, 0.25, 1e-3);
    EXPECT_NEAR(zz / n, 0.5, 1e-3);
}

TEST(CosineDirections, RunsContinueEachOther) {
    const auto all = halton_directions(1, 12), tail = halton_directions(5, 8);
    for (std::size_t k = 0; k < tail.size(); ++k) EXPECT_EQ(all[k + 4].x, tail[k].x);
}

TEST(SphereDirections, CoverTheSphereEvenly) {
    double x = 0, z = 0, zz = 0;
    for (std::uint32_t k = 1; k <= 4096; ++k) {
        const Vec3 d = sphere_direction(radical_inverse(2, k), radical_inverse(3, k));
        ASSERT_NEAR(d.x * d.x + d.y * d.y + d.z * d.z, 1.0, 1e-6);
        x += d.x, z += d.z, zz += d.z * d.z;
    }
    EXPECT_NEAR(x / 4096, 0.0, 5e-3);
    EXPECT_NEAR(z / 4096, 0.0, 5e-3);
    EXPECT_NEAR(zz / 4096, 1.0 / 3.0, 5e-3);
}

TEST(Hash, SpreadsAndRepeats) {
    std::set<std::uint64_t> seen;
    double mean = 0;
    for (std::uint64_t seed = 0; seed < 4; ++seed)
        for (std::uint64_t id = 0; id < 10000; ++id) {
            const std::uint64_t hash = hash_of(seed, id);
            EXPECT_TRUE(seen.insert(hash).second);
            EXPECT_GE(unit_from(hash), 0.0f);
            EXPECT_LT(unit_from(hash), 1.0f);
            mean += unit_from(hash) / 40000.0;
        }
    EXPECT_NEAR(mean, 0.5, 0.01);
    EXPECT_EQ(unit_from(~std::uint64_t{0}), 1.0f - 0x1p-24f);
}

}  // namespace
}  // namespace raydix
