// src/report/line_mask.h: coverage of lines and dots, in any order, clipped to the raster.
#include "report/line_mask.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <numeric>

namespace raydix {
namespace {

double full(std::size_t, double) { return 1.0; }

double sum_of(const LineMask& mask) {
    return std::accumulate(mask.coverage().begin(), mask.coverage().end(), 0.0);
}

TEST(LineMask, CoversItsWidthTimesItsLengthAtAnyAngle) {
    for (const double degrees : {0.0, 10.0, 45.0, 80.0, 90.0, 135.0, 200.0}) {
        const double c = std::cos(degrees * std::numbers::pi / 180),
                     s = std::sin(degrees * std::numbers::pi / 180);
        LineMask mask(100, 100);
        mask.add_line({50 - 30 * c, 50 - 30 * s, 1}, {50 + 30 * c, 50 + 30 * s, 1}, 3.0, full);
        // Round ends add up to half a disc of the line's reach each.
        EXPECT_NEAR(sum_of(mask), 60 * 3 + 7, 5) << degrees;
    }
}

TEST(LineMask, HorizontalLineIsWhereItShouldBe) {
    LineMask mask(10, 10);
    mask.add_line({2, 5, 1}, {8, 5, 1}, 2.0, full);
    for (std::size_t x = 2; x < 8; ++x) {
        EXPECT_FLOAT_EQ(mask.coverage()[4 * 10 + x], 1.0f);
        EXPECT_FLOAT_EQ(mask.coverage()[5 * 10 + x], 1.0f);
        EXPECT_EQ(mask.coverage()[3 * 10 + x], 0.0f);
        EXPECT_EQ(mask.coverage()[6 * 10 + x], 0.0f);
    }
}

TEST(LineMask, OrderAndDirectionDoNotMatter) {
    LineMask a(40, 40), b(40, 40);
    const LineMask::End p{3, 5, 1}, q{35, 30, 1}, r{6, 38, 1};
    a.add_line(p, q, 2, full);
    a.add_line(q, r, 2, full);
    b.add_line(r, q, 2, full);
    b.add_line(q, p, 2, full);
    for (std::size_t i = 0; i < a.coverage().size(); ++i)
        ASSERT_NEAR(a.coverage()[i], b.coverage()[i], 1e-6f);
    a.clear();
    EXPECT_EQ(sum_of(a), 0.0);
}

TEST(LineMask, FarEndsCostNothingAndHarmNothing) {
    LineMask far(20, 20), near(20, 20);
    far.add_line({-1e9, 10, 1}, {1e9, 10, 1}, 1.0, full);
    near.add_line({-50, 10, 1}, {50, 10, 1}, 1.0, full);
    EXPECT_NEAR(sum_of(far), sum_of(near), 1e-3);
    far.clear();
    far.add_line({-5, -5, 1}, {-5, 100, 1}, 1.0, full);
    far.add_line({1e6, 1e6, 1}, {1e7, 1e6, 1}, 3.0, full);
    EXPECT_EQ(sum_of(far), 0.0);
}

TEST(LineMask, DotsAreRound) {
    LineMask mask(21, 21);
    mask.add_line({10.5, 10.5, 1}, {10.5, 10.5, 1}, 6.0, full);
    EXPECT_NEAR(sum_of(mask), std::numbers::pi * 9, 2.0);
    EXPECT_EQ(mask.coverage()[10 * 21 + 10], 1.0f);
    EXPECT_EQ(mask.coverage()[6 * 21 + 6], 0.0f);
    EXPECT_EQ(mask.coverage()[10 * 21 + 8], mask.coverage()[12 * 21 + 10]);
}

TEST(LineMask, ShadeSeesTheDepthAlongTheLine) {
    LineMask mask(100, 3);
    mask.add_line({0, 1.5, 0.0}, {100, 1.5, 1.0}, 1.0,
                  [](std::size_t, double inverse_depth) { return inverse_depth; });
    EXPECT_NEAR(mask.coverage()[100 + 25], 0.255f, 0.01f);
    EXPECT_NEAR(mask.coverage()[100 + 75], 0.755f, 0.01f);
}

}  // namespace
}  // namespace raydix
