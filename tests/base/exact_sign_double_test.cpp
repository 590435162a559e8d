// Signs of determinants of doubles against exact arithmetic, most of them of points that are on one
// plane or line, or one step off it.
#include "base/exact_sign_double.h"

#include <gtest/gtest.h>

#include <cmath>

#include "support/double_scenes.h"
#include "support/exact.h"
#include "support/support.h"

namespace raydix::test {
namespace {

constexpr std::uint64_t exact_sign_double_seed = 19971002;

int exact_side(Vec3d a, Vec3d b, Vec3d c, Vec3d d) {
    const ExactPoint at = exact(a);
    return dot(cross(exact(b) - at, exact(c) - at), exact(d) - at).sign();
}
int exact_turn(Point2d a, Point2d b, Point2d c) {
    const auto at = [](Point2d p) { return exact({p.x, p.y, 0.0}); };
    return cross(at(b) - at(a), at(c) - at(a)).z.sign();
}

double step(double x, RandomD& random) {
    return random.below(3) == 0 ? std::nextafter(x, random.below(2) != 0 ? 1e300 : -1e300) : x;
}

/// Near the plane of a, b, c, as near as rounding lets it be.
Vec3d near_plane(Vec3d a, Vec3d b, Vec3d c, RandomD& random) {
    const Vec3d p = a + random.between(-1, 2) * (b - a) + random.between(-1, 2) * (c - a);
    return {step(p.x, random), step(p.y, random), step(p.z, random)};
}

TEST(ExactSignDouble, AreThoseOfExactArithmetic) {
    RandomD random(exact_sign_double_seed);
    int zeros = 0;
    for (int i = 0; i < 1000 * int{thorough}; ++i) {
        const double scale = i % 3 == 0 ? 1e12 : i % 3 == 1 ? 1.0 : 0x1p-490;
        AabbD box{{-scale, -scale, -scale}, {scale, scale, scale}};
        if (i % 5 == 0) box.lo.z = box.hi.z = scale / 3;
        Vec3d a = random.in(box), b = random.in(box), c = random.in(box), d = random.in(box);
        if (i % 2 != 0) d = near_plane(a, b, c, random);
        if (i % 7 == 0) d = 0.5 * (a + b);
        a = without_tiny(a), b = without_tiny(b), c = without_tiny(c), d = without_tiny(d);
        const int expected = exact_side(a, b, c, d);
        zeros += expected == 0;
        ASSERT_EQ(side_of_plane(a, b, c, d), expected)
            << "seed " << exact_sign_double_seed << ", " << i;
        ASSERT_EQ(side_of_plane(b, a, c, d), -expected) << i;
        ASSERT_EQ(exact_side_of_plane(a, b, c, d), expected) << i;
        const Point2d p{a.x, a.y}, q{b.x, b.y}, r{d.x, d.y};
        ASSERT_EQ(turn_sign(p, q, r), exact_turn(p, q, r)) << i;
        ASSERT_EQ(exact_turn_sign(p, q, r), exact_turn(p, q, r)) << i;
    }
    EXPECT_GT(zeros, 50 * int{thorough});
}

TEST(ExactSignDouble, DecidesWhatDoublesCannot) {
    const Vec3d a{0, 0, 0}, b{1e12, 1, 0}, c{1e-12, 1e12, 0};
    const double least = 0x1p-500;
    EXPECT_EQ(side_of_plane(a, b, c, {1e12, 1e12, 0}), 0);
    EXPECT_EQ(side_of_plane(a, b, c, {1e12, 1e12, least}), 1);
    EXPECT_EQ(side_of_plane(a, b, c, {1e12, 1e12, -least}), -1);
    EXPECT_EQ(turn_sign(Point2d{-1e12, -1e12}, Point2d{1e12, 1e12}, Point2d{least, 0}), -1);
    EXPECT_EQ(turn_sign(Point2d{0.1, 0.1}, Point2d{0.3, 0.3}, Point2d{0.7, 0.7}), 0);
}

TEST(ExactSignDouble, TinyCountsAsZeroAndNanStays) {
    EXPECT_FALSE(std::signbit(without_tiny(-0.0)));
    EXPECT_EQ(without_tiny(-0x1p-501), 0.0);
    EXPECT_EQ(without_tiny(-0x1p-500), -0x1p-500);
    EXPECT_TRUE(std::isnan(without_tiny(std::nan(""))));
    EXPECT_EQ(without_tiny(-HUGE_VAL), -HUGE_VAL);
}

}  // namespace
}  // namespace raydix::test
