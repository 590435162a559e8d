// Signs of determinants against integers: floats are whole numbers times powers of two, and small
// ones fit into 128 bits.
#include "base/exact_sign.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace raydix {
namespace {

constexpr std::uint64_t exact_sign_seed = 19970101;
__extension__ using Wide = __int128;

/// Lattice points with up to 22 bits a coordinate, often on one plane or line.
struct Lattice {
    std::mt19937_64 random{exact_sign_seed};
    std::int64_t range = 1 << 22;
    float coordinate() {
        return static_cast<float>(
            static_cast<std::int64_t>(random() % std::uint64_t(2 * range + 1)) - range);
    }
    Vec3 point() { return {coordinate(), coordinate(), coordinate()}; }
};

int sign(Wide x) { return x > 0 ? 1 : x < 0 ? -1 : 0; }
Wide whole(float x) { return static_cast<std::int64_t>(x); }

int wide_side(Vec3 a, Vec3 b, Vec3 c, Vec3 d) {
    const Wide bx = whole(b.x) - whole(a.x), by = whole(b.y) - whole(a.y),
               bz = whole(b.z) - whole(a.z);
    const Wide cx = whole(c.x) - whole(a.x), cy = whole(c.y) - whole(a.y),
               cz = whole(c.z) - whole(a.z);
    const Wide dx = whole(d.x) - whole(a.x), dy = whole(d.y) - whole(a.y),
               dz = whole(d.z) - whole(a.z);
    return sign((by * cz - bz * cy) * dx + (bz * cx - bx * cz) * dy + (bx * cy - by * cx) * dz);
}

TEST(ExactSign, SidesOfPlanesAreThoseOfIntegers) {
    Lattice lattice;
    int zeros = 0;
    for (int i = 0; i < 100000; ++i) {
        lattice.range = std::int64_t{1} << (1 + lattice.random() % 22);
        const Vec3 a = lattice.point(), b = lattice.point(), c = lattice.point();
        Vec3 d = lattice.point();
        if (i % 2) {  // in the plane or next to it
            const float s = float(int(lattice.random() % 3)), t = 1.0f - s;
            d = {a.x + s * (b.x - a.x) + t * (c.x - a.x), a.y + s * (b.y - a.y) + t * (c.y - a.y),
                 a.z + s * (b.z - a.z) + t * (c.z - a.z) + float(int(lattice.random() % 3)) - 1};
        }
        const int expected = wide_side(a, b, c, d);
        zeros += expected == 0;
        ASSERT_EQ(side_of_plane(a, b, c, d), expected)
            << "seed " << exact_sign_seed << " case " << i;
        ASSERT_EQ(side_of_plane(b, c, a, d), expected);
        ASSERT_EQ(side_of_plane(b, a, c, d), -expected);
        // The same far down in the range of floats, and turned around.
        const auto tiny = [](Vec3 p) {
            return Vec3{std::ldexp(p.x, -140), std::ldexp(p.y, -140), std::ldexp(p.z, -140)};
        };
        if (lattice.range <= 256) {
            ASSERT_EQ(side_of_plane(tiny(a), tiny(b), tiny(c), tiny(d)), expected);
        }
    }
    EXPECT_GT(zeros, 10000);
}

TEST(ExactSign, DecidesWhatDoubleCannot) {
    // A plane through points far apart; the last is one step of a float off it.
    const Vec3 a{0, 0, 0}, b{1e12f, 1, 0}, c{1e-12f, 1e12f, 0};
    const float step = 1.4e-45f;
    EXPECT_EQ(side_of_plane(a, b, c, {1e12f, 1e12f, 0}), 0);
    EXPECT_EQ(side_of_plane(a, b, c, {1e12f, 1e12f, step}), 1);
    EXPECT_EQ(side_of_plane(a, b, c, {1e12f, 1e12f, -step}), -1);
    EXPECT_EQ(turn_sign(Point2{0, 0}, Point2{3e38f, 3e38f},
                        Point2{3e38f, std::nextafter(3e38f, infinity)}),
              1);
    EXPECT_EQ(turn_sign(Point2{-3e38f, -3e38f}, Point2{3e38f, 3e38f}, Point2{step, 0}), -1);
    EXPECT_EQ(turn_sign(Point2{-3e38f, -3e38f}, Point2{3e38f, 3e38f}, Point2{step, step}), 0);
    EXPECT_EQ(turn_sign(Point2{0.1f, 0.1f}, Point2{0.3f, 0.3f}, Point2{0.7f, 0.7f}), 0);
}

TEST(ExactSign, TurnsAreThoseOfIntegers) {
    Lattice lattice;
    int zeros = 0;
    for (int i = 0; i < 100000; ++i) {
        lattice.range = std::int64_t{1} << (1 + lattice.random() % 22);
        const Vec3 p = lattice.point(), q = lattice.point();
        const Point2 a{p.x, p.y}, b{q.x, q.y},
            c = i % 2 ? Point2{2 * q.x - p.x, 2 * q.y - p.y + float(int(lattice.random() % 3)) - 1}
                      : Point2{p.z, q.z};
        const int expected = sign((whole(b.x) - whole(a.x)) * (whole(c.y) - whole(a.y)) -
                                  (whole(b.y) - whole(a.y)) * (whole(c.x) - whole(a.x)));
        zeros += expected == 0;
        ASSERT_EQ(turn_sign(a, b, c), expected) << "seed " << exact_sign_seed << " case " << i;
        ASSERT_EQ(turn_sign(c, b, a), -expected);
    }
    EXPECT_GT(zeros, 10000);
}

}  // namespace
}  // namespace raydix
