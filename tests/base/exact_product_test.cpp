// Differences of products against exact arithmetic: where both products round to the same double,
// where they are tiny, where one is 0.
#include "base/exact_product.h"

#include <gtest/gtest.h>

#include <boost/multiprecision/cpp_int.hpp>
#include <cmath>
#include <random>

#include "support/support.h"

namespace raydix {
namespace {

constexpr std::uint64_t exact_product_seed = 20051101;
using Exact = boost::multiprecision::cpp_rational;

int sign(double x) { return x > 0 ? 1 : x < 0 ? -1 : 0; }

int exact_sign(double a, double b, double c, double d) {
    return (Exact(a) * Exact(b) - Exact(c) * Exact(d)).sign();
}

/// A double with few or many digits, of either sign, at some power of two.
class Numbers {
public:
    double operator()(int power) {
        const int digits = 1 + static_cast<int>(engine_() % 53);
        const auto whole = static_cast<double>(engine_() >> (64 - digits));
        const double x = std::ldexp(whole, power - digits);
        return engine_() % 2 != 0 ? x : -x;
    }
    std::uint64_t below(std::uint64_t n) { return engine_() % n; }

private:
    std::mt19937_64 engine_{exact_product_seed};
};

TEST(ExactProduct, SignsAreThoseOfExactArithmetic) {
    Numbers numbers;
    int lost = 0, zeros = 0;
    for (int i = 0; i < 10000 * int{test::thorough}; ++i) {
        const int power = i % 4 == 3 ? -500 : 0;
        const double a = numbers(power), b = numbers(power);
        double c = a, d = b;
        if (i % 2 != 0) {  // as near as can be: steps in opposite directions
            c = std::nextafter(a, 2 * a);
            d = std::nextafter(b, 0.0);
        }
        if (numbers.below(2) != 0) std::swap(c, d);
        if (numbers.below(4) == 0) c *= 0.5, d *= 2.0;
        const int expected = exact_sign(a, b, c, d);
        ASSERT_EQ(sign(product_difference(a, b, c, d)), expected)
            << "seed " << exact_product_seed << ", " << i;
        ASSERT_EQ(sign(product_difference(c, d, a, b)), -expected);
        lost += a * b - c * d == 0.0 && expected != 0;
        zeros += expected == 0;
    }
    EXPECT_GT(lost, 50 * int{test::thorough});
    EXPECT_GT(zeros, 50 * int{test::thorough});
}

TEST(ExactProduct, ProductsThatUnderflowKeepTheirOrder) {
    const double least = std::numeric_limits<double>::denorm_min();
    EXPECT_EQ(sign(product_difference(1e-200, 1e-200, 1e-201, 1e-200)), 1);
    EXPECT_EQ(sign(product_difference(1e-200, -1e-200, 1e-300, 1e-300)), -1);
    EXPECT_EQ(sign(product_difference(least, least, 0.0, 1.0)), 1);
    EXPECT_EQ(sign(product_difference(0.0, 1.0, least, -least)), 1);
    EXPECT_EQ(sign(product_difference(least, 0.5, least, 0.25)), 1);
    EXPECT_EQ(sign(product_difference(least, 1.0, 2 * least, 0.5)), 0);
    EXPECT_EQ(sign(product_difference(0.0, 1.0, -0.0, 3.0)), 0);
    EXPECT_EQ(sign(product_difference(1e-170, 1e-170, -1e-170, 1e-170)), 1);
}

TEST(ExactProduct, TheValueIsRightToTheLastDigits) {
    Numbers numbers;
    for (int i = 0; i < 20000; ++i) {
        const double a = numbers(0), b = numbers(0);
        const double c = std::nextafter(a, 2 * a), d = std::nextafter(b, 0.0);
        if (a * b - c * d != 0.0) continue;
        const Exact wanted = Exact(a) * Exact(b) - Exact(c) * Exact(d);
        ASSERT_EQ(product_difference(a, b, c, d), static_cast<double>(wanted)) << i;
    }
}

}  // namespace
}  // namespace raydix
