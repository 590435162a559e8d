// Morton codes: which bit of which axis goes where, and which cell a point falls in.
#include "keys/morton.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <random>

#include "primitives/sources.h"

namespace raydix::test {
namespace {

TEST(Morton, BitPatternsOf30BitCodes) {
    const auto code = [](std::uint32_t x, std::uint32_t y, std::uint32_t z) {
        return interleave<std::uint32_t>({x, y, z});
    };
    // Bit 9 of each axis on the left, bit 0 on the right; x y z within a triple.
    EXPECT_EQ(code(0, 0, 0),
              /**/ 0b000'000'000'000'000'000'000'000'000'000u);
    EXPECT_EQ(code(0b1111111111, 0, 0),
              /**/ 0b100'100'100'100'100'100'100'100'100'100u);
    EXPECT_EQ(code(0, 0b1111111111, 0),
              /**/ 0b010'010'010'010'010'010'010'010'010'010u);
    EXPECT_EQ(code(0, 0, 0b1111111111),
              /**/ 0b001'001'001'001'001'001'001'001'001'001u);
    EXPECT_EQ(code(0b1000000000, 0b0100000000, 0b0010000000),
              /**/ 0b100'010'001'000'000'000'000'000'000'000u);
    EXPECT_EQ(code(0b0000000100, 0b0000000010, 0b0000000001),
              /**/ 0b000'000'000'000'000'000'000'100'010'001u);
    EXPECT_EQ(code(0b1010101010, 0b0101010101, 0b1100110011),
              /**/ 0b101'011'100'010'101'011'100'010'101'011u);
    EXPECT_EQ(code(0b1111111111, 0b1111111111, 0b1111111111),
              /**/ 0b111'111'111'111'111'111'111'111'111'111u);
}

TEST(Morton, BitPatternsOf63BitCodes) {
    const auto code = [](std::uint32_t x, std::uint32_t y, std::uint32_t z) {
        return interleave<std::uint64_t>({x, y, z});
    };
    constexpr std::uint32_t all = 0b111111111111111111111u;
    EXPECT_EQ(
        code(all, 0, 0),
        0b100'100'100'100'100'100'100'100'100'100'100'100'100'100'100'100'100'100'100'100'100u);
    EXPECT_EQ(
        code(0, all, 0),
        0b010'010'010'010'010'010'010'010'010'010'010'010'010'010'010'010'010'010'010'010'010u);
    EXPECT_EQ(
        code(0, 0, all),
        0b001'001'001'001'001'001'001'001'001'001'001'001'001'001'001'001'001'001'001'001'001u);
    EXPECT_EQ(
        code(1u << 20, 1u << 19, 1u << 18),
        0b100'010'001'000'000'000'000'000'000'000'000'000'000'000'000'000'000'000'000'000'000u);
    EXPECT_EQ(
        code(0b101010101010101010101u, 0b010101010101010101010u, 0b110011001100110011001u),
        0b101'011'100'010'101'011'100'010'101'011'100'010'101'011'100'010'101'011'100'010'101u);
    EXPECT_EQ(
        code(4, 2, 1),
        0b000'000'000'000'000'000'000'000'000'000'000'000'000'000'000'000'000'000'100'010'001u);
}

/// Bit by bit, without masks.
template <class Key>
Key interleave_slowly(Cell c, int axis_bits) {
    Key code = 0;
    for (int bit = axis_bits - 1; bit >= 0; --bit)
        for (const std::uint32_t axis : {c.x, c.y, c.z})
            code = static_cast<Key>(code << 1 | (axis >> bit & 1u));
    return code;
}

template <class Key>
void expect_random_codes() {
    constexpr int bits = CodeFormat<Key>::axis_bits;
    constexpr std::uint64_t seed = 31;
    std::mt19937_64 random(seed);
    for (int i = 0; i < 100'000; ++i) {
        const auto axis = [&] { return static_cast<std::uint32_t>(random() >> (64 - bits)); };
        const Cell cell{axis(), axis(), axis()};
        ASSERT_EQ(interleave<Key>(cell), interleave_slowly<Key>(cell, bits))
            << cell.x << " " << cell.y << " " << cell.z << ", seed " << seed;
    }
}

TEST(Morton, RandomCodesBitByBit) {
    expect_random_codes<std::uint32_t>();
    expect_random_codes<std::uint64_t>();
}

void expect_cell(const Grid& grid, Vec3 point, Cell wanted) {
    const Cell cell = grid.cell(point);
    EXPECT_EQ(cell.x, wanted.x);
    EXPECT_EQ(cell.y, wanted.y);
    EXPECT_EQ(cell.z, wanted.z);
}

TEST(MortonGrid, BordersBelongToTheUpperCell) {
    for (const int bits : {10, 21}) {
        const auto cells = static_cast<float>(1u << bits);
        const std::uint32_t last = (1u << bits) - 1;
        const Grid grid = make_grid({{0, 0, 0}, {cells, cells, cells}}, bits);
        for (const std::uint32_t k : {1u, 2u, 3u, 511u, 512u, 1000u, last}) {
            const auto border = static_cast<float>(k);
            const float below = std::nextafter(border, 0.0f), above = std::nextafter(border, cells);
            expect_cell(grid, {border, below, above}, {k, k - 1, k});
        }
        // The upper face has no cell of its own.
        expect_cell(grid, {cells, std::nextafter(cells, 0.0f), 0.0f}, {last, last, 0});
        expect_cell(grid, {0, cells, cells}, {0, last, last});
    }
}

TEST(MortonGrid, IsCubicWithTheLongestEdge) {
    const Grid grid = make_grid({{-100, 5, 7}, {100, 105, 57}}, 10);
    expect_cell(grid, {-100, 5, 7}, {0, 0, 0});
    expect_cell(grid, {100, 105, 57}, {1023, 512, 256});
    expect_cell(grid, {0, 55, 32}, {512, 256, 128});
}

TEST(MortonGrid, WithoutExtentEverythingIsInCellZero) {
    for (const int bits : {10, 21}) {
        const Grid point = make_grid({{3, -4, 5}, {3, -4, 5}}, bits);
        expect_cell(point, {3, -4, 5}, {0, 0, 0});
        const Grid nothing = make_grid(empty_box(), bits);
        expect_cell(nothing, {0, 0, 0}, {0, 0, 0});
        const Grid flat = make_grid({{0, 2, 0}, {8, 2, 0}}, bits);
        expect_cell(flat, {4, 2, 0}, {1u << (bits - 1), 0, 0});
    }
}

TEST(MortonGrid, HugeAndTinyBoxes) {
    for (const int bits : {10, 21}) {
        const std::uint32_t last = (1u << bits) - 1, half = 1u << (bits - 1);
        for (const float size : {1e-30f, 1e-12f, 1e-3f, 1.0f, 1e5f, 1e12f}) {
            const Grid grid = make_grid({{-size, -size, -size}, {size, size, size}}, bits);
            expect_cell(grid, {-size, 0, size}, {0, half, last});
        }
        for (const float size : {1e-33f, 1e-38f, 1e-42f, 1e-45f}) {  // the quotient would overflow
            const Grid grid = make_grid({{0, 0, 0}, {size, size, size}}, bits);
            EXPECT_TRUE(std::isfinite(grid.cells_per_unit));
            const Cell low = grid.cell({0, 0, 0}), high = grid.cell({size, size / 2, 0});
            EXPECT_EQ(low.x + low.y + low.z + high.z, 0u);
            EXPECT_LE(high.x, last);
            EXPECT_LE(high.y, high.x);
        }
    }
}

template <class Key>
void expect_left_out_above() {
    const std::uint32_t last = (1u << CodeFormat<Key>::axis_bits) - 1;
    const Key highest = interleave<Key>({last, last, last});
    EXPECT_EQ(highest, (Key{1} << CodeFormat<Key>::bits) - 1);
    EXPECT_GT(left_out_key<Key>, highest);

    const float bad = std::nanf("");
    const Vec3 points[] = {{0, 0, 0}, {bad, 0, 0}, {8, 8, 8}, {0, infinity, 0}, {0, 0, 2e12f}};
    Key codes[5];
    const EncodeMorton<PointSource, Key> encode{
        {points}, make_grid({{0, 0, 0}, {8, 8, 8}}, CodeFormat<Key>::axis_bits), codes};
    for (std::size_t i = 0; i < 5; ++i) encode(i);
    EXPECT_EQ(codes[0], Key{0});
    EXPECT_EQ(codes[2], highest);
    for (const int i : {1, 3, 4}) EXPECT_EQ(codes[i], left_out_key<Key>) << i;
}

TEST(Morton, KeyOfLeftOutPrimitivesIsAboveAllCodes) {
    expect_left_out_above<std::uint32_t>();
    expect_left_out_above<std::uint64_t>();
}

TEST(Morton, CodeIsThatOfTheBoxCentre) {
    const Vec3 vertices[] = {{0, 0, 0}, {4, 0, 0}, {0, 2, 8}};
    const Triangle triangles[] = {{0, 1, 2}};
    std::uint32_t code = 0;
    const EncodeMorton<TriangleSource, std::uint32_t> encode{
        {vertices, triangles, 3}, make_grid({{0, 0, 0}, {8, 8, 8}}, 10), &code};
    encode(0);
    EXPECT_EQ(code, interleave_slowly<std::uint32_t>({256, 128, 512}, 10));
}

}  // namespace
}  // namespace raydix::test
