#include "report/plot_axis.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

namespace raydix::report {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double infinite = std::numeric_limits<double>::infinity();

std::vector<std::string> labels(const Axis& axis) {
    std::vector<std::string> all;
    for (const Tick& tick : axis.ticks) all.push_back(tick.label);
    return all;
}

void expect_sound(const Axis& axis, const std::vector<double>& values) {
    EXPECT_TRUE(std::isfinite(axis.lo) && std::isfinite(axis.hi));
    EXPECT_LT(axis.lo, axis.hi);
    EXPECT_LE(axis.ticks.size(), 12u);
    const double slack = 1e-9 * std::fmax(std::fabs(axis.lo), std::fabs(axis.hi));
    for (const Tick& tick : axis.ticks) {
        EXPECT_GE(tick.value, axis.lo - slack);
        EXPECT_LE(tick.value, axis.hi + slack);
    }
    for (const double v : values) {
        if (!axis.shows(v)) continue;
        EXPECT_GE(v, axis.lo - slack);
        EXPECT_LE(v, axis.hi + slack);
        EXPECT_GE(axis.place(v), 0);
        EXPECT_LE(axis.place(v), 1);
    }
}

TEST(LinearAxis, BeginsAtZeroAndEndsRound) {
    const std::vector<double> values{3, 24.4};
    const Axis axis = linear_axis(values);
    EXPECT_EQ(labels(axis), (std::vector<std::string>{"0", "5", "10", "15", "20", "25"}));
    EXPECT_DOUBLE_EQ(axis.place(0), 0);
    EXPECT_DOUBLE_EQ(axis.place(12.5), 0.5);
    EXPECT_DOUBLE_EQ(axis.place(25), 1);
    expect_sound(axis, values);
}

TEST(LinearAxis, NegativeValuesMoveItsStart) {
    const std::vector<double> values{-30, 40};
    const Axis axis = linear_axis(values);
    EXPECT_LE(axis.lo, -30);
    expect_sound(axis, values);
    expect_sound(linear_axis(std::vector<double>{-5, -1}), {-5, -1});
}

TEST(LinearAxis, OddInputsHaveAnAxis) {
    for (const std::vector<double>& values : {std::vector<double>{},
                                              {nan},
                                              {infinite, -infinite},
                                              {0},
                                              {7},
                                              {-7},
                                              {7, 7, 7},
                                              {1e-300},
                                              {1e300},
                                              {nan, 5, infinite},
                                              {1e15, 1e15 + 1}})
        for (const bool from_zero : {true, false})
            expect_sound(linear_axis(values, from_zero), values);
}

TEST(LogAxis, HasPowersOfTenAndTheirParts) {
    EXPECT_EQ(labels(log_axis(std::vector<double>{0.02, 4000})),
              (std::vector<std::string>{"0.1", "1", "10", "100", "1k"}));
    EXPECT_EQ(labels(log_axis(std::vector<double>{1, 64})),
              (std::vector<std::string>{"1", "2", "5", "10", "20", "50"}));
    const Axis axis = log_axis(std::vector<double>{1, 100});
    EXPECT_NEAR(axis.place(10), 0.5, 0.01);
}

TEST(LogAxis, NarrowRangesHaveEvenTicks) {
    const Axis axis = log_axis(std::vector<double>{1, 1.45});
    EXPECT_GE(axis.ticks.size(), 3u);
    expect_sound(axis, {1, 1.45});
}

TEST(LogAxis, DoesNotShowWhatHasNoLogarithm) {
    const std::vector<double> values{0, -5, nan, infinite, 10, 1000};
    const Axis axis = log_axis(values);
    EXPECT_FALSE(axis.shows(0));
    EXPECT_FALSE(axis.shows(-5));
    EXPECT_FALSE(axis.shows(nan));
    EXPECT_FALSE(axis.shows(infinite));
    EXPECT_TRUE(axis.shows(10));
    EXPECT_GT(axis.lo, 5);
    expect_sound(axis, values);
}

TEST(LogAxis, OddInputsHaveAnAxis) {
    for (const std::vector<double>& values :
         {std::vector<double>{}, {nan}, {0}, {-1, -2}, {7}, {7, 7}, {1e-300, 1e300}, {1e-12, 1}}) {
        expect_sound(log_axis(values), values);
        EXPECT_LE(log_axis(values).ticks.size(), 8u);
    }
}

TEST(LogAxisAt, HasATickAtEachValue) {
    const std::vector<double> widths{1, 2, 4, 8, 16, 32, 64, 64};
    EXPECT_EQ(labels(log_axis_at(widths)),
              (std::vector<std::string>{"1", "2", "4", "8", "16", "32", "64"}));
    expect_sound(log_axis_at(widths), widths);
    expect_sound(log_axis_at(std::vector<double>{5}), {5});
    expect_sound(log_axis_at({}), {});
}

}  // namespace
}  // namespace raydix::report
