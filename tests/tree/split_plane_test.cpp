// src/tree/split_plane.h: bits there and back, and planes that part centres exactly as cells do.
#include "tree/split_plane.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "tree/octree_walk.h"  // once had another function of the same name: both headers in one source did not compile

namespace raydix {
namespace {

TEST(GatherBits, IsTheInverseOfSpreadBits) {
    std::mt19937_64 random(5);
    for (int i = 0; i < 10'000; ++i) {
        const std::uint64_t noise = random(), v = random() & 0x1FFFFF;
        const std::uint64_t spread = spread_bits(v);
        ASSERT_EQ(gather_bits(spread), v);
        ASSERT_EQ(cell_of_code(spread << 1).y, v);
        ASSERT_EQ(gather_bits(spread | (noise & ~std::uint64_t{0x1249249249249249})), v);
        const auto narrow = static_cast<std::uint32_t>(v & 0x3FF);
        ASSERT_EQ(gather_bits(spread_bits(narrow)), narrow);
    }
}

TEST(Ordinals, FollowTheOrderOfFloats) {
    const float values[] = {-infinity, -1e12f, -1.0f, -1e-45f, 0.0f,
                            1e-45f,    1e-38f, 1.0f,  1e12f,   infinity};
    for (std::size_t i = 1; i < std::size(values); ++i)
        EXPECT_LT(ordinal_of(values[i - 1]), ordinal_of(values[i]));
    for (const float x : values) EXPECT_EQ(float_at(ordinal_of(x)), x);
    EXPECT_EQ(ordinal_of(-0.0f), ordinal_of(0.0f));
    EXPECT_FALSE(std::signbit(float_at(0)));
    EXPECT_EQ(ordinal_of(std::nextafter(1.0f, 2.0f)), ordinal_of(1.0f) + 1);
    EXPECT_EQ(ordinal_of(std::nextafter(-1.0f, -2.0f)), ordinal_of(-1.0f) - 1);
}

/// The plane itself lies in the cell, the float before it does not.
void expect_least(float lo, float hi, int axis_bits, std::uint32_t cell) {
    const Grid grid = make_grid({{lo, lo, lo}, {hi, lo, lo}}, axis_bits);
    const float plane = split_plane({lo, grid.cells_per_unit}, cell);
    const auto cell_of = [&](float x) { return grid.cell({x, lo, lo}).x; };
    EXPECT_GE(cell_of(plane), cell) << lo << " to " << hi << ", cell " << cell;
    EXPECT_LT(cell_of(std::nextafter(plane, -infinity)), cell)
        << lo << " to " << hi << ", cell " << cell;
    // A grid that cannot be as fine as it should be does not reach its last cells within the scene.
    EXPECT_TRUE(plane <= hi || cell_of(hi) < cell);
    EXPECT_GT(plane, lo);
}

TEST(SplitPlane, IsTheLeastFloatOfItsCell) {
    std::mt19937_64 random(9);
    const float ends[][2] = {{0, 1},           {-1, 1},          {-1, 1e-30f},
                             {1e5f, 1e5f + 3}, {5e6f, 5e6f + 1}, {-1e12f, 1e12f},
                             {0, 1e-30f},      {0, 1e-44f},      {-3e-39f, 1e-38f},
                             {-1e12f, 1e-3f},  {7, 7.0000005f}};
    for (const auto& [lo, hi] : ends)
        for (const int axis_bits : {10, 21}) {
            const std::uint32_t last = (1u << axis_bits) - 1;
            expect_least(lo, hi, axis_bits, 1);
            expect_least(lo, hi, axis_bits, 1u << (axis_bits - 1));
            expect_least(lo, hi, axis_bits, last);
            for (int i = 0; i < 200; ++i)
                expect_least(lo, hi, axis_bits, 1 + static_cast<std::uint32_t>(random() % last));
        }
}

TEST(SplitOfPrefix, TakesAxesInTurnFromTheHighestBit) {
    const Grid grid = make_grid({{0, 0, 0}, {1024, 1024, 1024}}, 10);
    const auto code = interleave<std::uint32_t>({0x2AA, 0x155, 0x3FF});
    // prefix 4: y's second bit; 0x155 is 01 0101 0101, so the plane is at 01 0000 0000.
    EXPECT_EQ(split_of_prefix(grid, code, 4).axis, 1u);
    EXPECT_EQ(split_of_prefix(grid, code, 4).plane, 256.0f);
    EXPECT_EQ(split_of_prefix(grid, code, 0).axis, 0u);
    EXPECT_EQ(split_of_prefix(grid, code, 0).plane, 512.0f);
    EXPECT_EQ(split_of_prefix(grid, code, 29).axis, 2u);
    EXPECT_EQ(split_of_prefix(grid, code, 29).plane, 1023.0f);
    EXPECT_EQ(split_of_prefix(grid, code, 30).plane, infinity);
    EXPECT_EQ(split_of_prefix(grid, code, 31).axis, 1u);
}

}  // namespace
}  // namespace raydix
