#include "report/number_text.h"

#include <gtest/gtest.h>

#include <limits>

namespace raydix::report {
namespace {

constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();
constexpr double endless = std::numeric_limits<double>::infinity();
const std::string dash = "\xE2\x80\x93", minus = "\xE2\x88\x92";

TEST(Grouped, PutsCommasAtThousands) {
    EXPECT_EQ(grouped(0), "0");
    EXPECT_EQ(grouped(999), "999");
    EXPECT_EQ(grouped(1000), "1,000");
    EXPECT_EQ(grouped(1234567), "1,234,567");
    EXPECT_EQ(grouped(std::numeric_limits<std::uint64_t>::max()), "18,446,744,073,709,551,615");
}

TEST(WithDecimals, GroupsTheWholePartOnly) {
    EXPECT_EQ(with_decimals(1234.5678, 3), "1,234.568");
    EXPECT_EQ(with_decimals(-1234567.25, 1), minus + "1,234,567.2");
    EXPECT_EQ(with_decimals(-0.001, 1), "0.0");
    EXPECT_EQ(with_decimals(not_a_number, 2), dash);
    EXPECT_EQ(with_decimals(-endless, 2), dash);
}

TEST(Significant, KeepsTheDigitsThatCount) {
    EXPECT_EQ(significant(0.012345), "0.0123");
    EXPECT_EQ(significant(12.345), "12.3");
    EXPECT_EQ(significant(1234.5), "1,234");
    EXPECT_EQ(significant(0), "0");
    EXPECT_EQ(significant(-3.14159, 4), minus + "3.142");
    EXPECT_EQ(significant(1e-9), "1.00e-09");
    EXPECT_EQ(significant(1e20), "1.00e+20");
    EXPECT_EQ(significant(0.99999), "1.00");
    EXPECT_EQ(significant(9.996), "10.0");
    EXPECT_EQ(significant(not_a_number), dash);
}

TEST(ShortNumber, IsShortOnAxes) {
    EXPECT_EQ(short_number(1000), "1k");
    EXPECT_EQ(short_number(2.5e6), "2.5M");
    EXPECT_EQ(short_number(0.05), "0.05");
    EXPECT_EQ(short_number(0.002), "0.002");
    EXPECT_EQ(short_number(64), "64");
    EXPECT_EQ(short_number(0), "0");
    EXPECT_EQ(short_number(endless), dash);
}

TEST(Percent, OfAPart) {
    EXPECT_EQ(percent(0.4231), "42.3 %");
    EXPECT_EQ(percent(6.129), "612.9 %");
    EXPECT_EQ(percent(not_a_number), dash);
}

TEST(DecimalsFor, OneColumnHasOneNumberOfDigits) {
    EXPECT_EQ(decimals_for({}), 0);
    EXPECT_EQ(decimals_for({1, 2, 300}), 0);
    EXPECT_EQ(decimals_for({24.1, 300}), 1);
    EXPECT_EQ(decimals_for({0.12, 300}), 2);
    EXPECT_EQ(decimals_for({0.00001, 300}), 4);
    EXPECT_EQ(decimals_for({not_a_number, 5}), 0);
}

}  // namespace
}  // namespace raydix::report
