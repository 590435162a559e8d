// Triangles, segments and points against a search for separating directions in whole numbers, on
// lattices so small that they touch in every way there is.
#include "primitives/exact_overlap.h"

#include <gtest/gtest.h>

#include <cmath>
#include <iostream>
#include <random>

#include "support/exact_overlap_reference.h"
#include "support/support.h"

namespace raydix {
namespace {

constexpr std::uint64_t exact_overlap_seed = 20030112;

struct Lattice {
    std::mt19937_64 random{exact_overlap_seed};
    unsigned side = 2;
    float coordinate() { return static_cast<float>(random() % (side + 1)); }
    Vec3 point() { return {coordinate(), coordinate(), coordinate()}; }
    LeafTriangle triangle() {
        const Vec3 a = point(), b = point(), c = point();
        switch (random() % 8) {
            case 0:
                return {a, b, b};
            case 1:
                return {a, a, a};
            case 2:  // all in the plane z = 1
                return {{a.x, a.y, 1}, {b.x, b.y, 1}, {c.x, c.y, 1}};
            default:
                return {a, b, c};
        }
    }
};

LeafTriangle moved(const LeafTriangle& t, Vec3 by, float scale) {
    return {scale * t.v0 + by, scale * t.v1 + by, scale * t.v2 + by};
}

TEST(ExactOverlap, TrianglesTouchAsInWholeNumbers) {
    Lattice lattice;
    std::size_t touching = 0;
    const std::size_t cases = 20000 * test::thorough;
    for (std::size_t i = 0; i < cases; ++i) {
        lattice.side = 1 + static_cast<unsigned>(i % 12);
        const LeafTriangle s = lattice.triangle(), t = lattice.triangle();
        const bool expected = test::whole_triangles_touch(s, t);
        touching += expected;
        ASSERT_EQ(triangles_touch(s, t), expected)
            << "seed " << exact_overlap_seed << " case " << i;
        ASSERT_EQ(triangles_touch(t, s), expected);
        ASSERT_EQ(triangles_touch(LeafTriangle{s.v1, s.v2, s.v0}, LeafTriangle{t.v0, t.v2, t.v1}),
                  expected);
        // The same, small and far from the origin where that is exact, and huge.
        const Vec3 by{1024.0f, -2048.0f, 4096.0f};
        ASSERT_EQ(triangles_touch(moved(s, by, 0x1p-9f), moved(t, by, 0x1p-9f)), expected);
        ASSERT_EQ(triangles_touch(moved(s, {}, 0x1p35f), moved(t, {}, 0x1p35f)), expected);
    }
    std::cout << cases << " pairs, " << touching << " touch, seed " << exact_overlap_seed << '\n';
    EXPECT_GT(touching, cases / 10);
    EXPECT_LT(touching, cases * 9 / 10);
}

TEST(ExactOverlap, SegmentsAndPointsTouchAsInWholeNumbers) {
    Lattice lattice;
    std::size_t touching = 0, on = 0;
    const std::size_t cases = 20000 * test::thorough;
    for (std::size_t i = 0; i < cases; ++i) {
        lattice.side = 1 + static_cast<unsigned>(i % 12);
        const LeafTriangle t = lattice.triangle();
        const Vec3 p = lattice.point(), q = lattice.point();
        const bool expected = test::whole_triangles_touch({p, q, q}, t);
        const bool p_on = test::whole_triangles_touch({p, p, p}, t);
        touching += expected;
        on += p_on;
        ASSERT_EQ(segment_touches_triangle(p, q, t), expected)
            << "seed " << exact_overlap_seed << " case " << i;
        ASSERT_EQ(segment_touches_triangle(q, p, LeafTriangle{t.v2, t.v1, t.v0}), expected);
        ASSERT_EQ(point_on_triangle(p, t), p_on);
    }
    std::cout << cases << " segments, " << touching << " touch; " << on << " points on, seed "
              << exact_overlap_seed << '\n';
    EXPECT_GT(touching, cases / 20);
    EXPECT_GT(on, cases / 200);
}

TEST(ExactOverlap, OneStepOfAFloatDecides) {
    const LeafTriangle floor{{0, 0, 0.1f}, {1, 0, 0.1f}, {0, 1, 0.1f}};
    const float above = std::nextafter(0.1f, 1.0f);
    const Vec3 tip{0.25f, 0.25f, 0.1f}, over{0.25f, 0.25f, above};
    const Vec3 b{0.3f, 0.2f, 1}, c{0.2f, 0.3f, 1};
    EXPECT_TRUE(triangles_touch(floor, {tip, b, c}));
    EXPECT_FALSE(triangles_touch(floor, {over, b, c}));
    EXPECT_TRUE(point_on_triangle(tip, floor));
    EXPECT_FALSE(point_on_triangle(over, floor));
}

TEST(ExactOverlap, SharedCornersAreFoundByPlace) {
    const LeafTriangle a{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, b{{5, 5, 5}, {0, 1, 0}, {7, 7, 7}},
        c{{0, 0, 1}, {1, 0, 1}, {0, 1, 1}};
    EXPECT_TRUE(share_a_corner(a, b));
    EXPECT_TRUE(share_a_corner(b, a));
    EXPECT_FALSE(share_a_corner(a, c));
}

}  // namespace
}  // namespace raydix
