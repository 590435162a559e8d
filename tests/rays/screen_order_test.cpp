// src/rays/screen_order.h
#include "rays/screen_order.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <utility>

namespace raydix {
namespace {

std::uint64_t code_of(std::uint32_t x, std::uint32_t y) {
    std::uint64_t code = 0;
    for (int bit = 31; bit >= 0; --bit) code = code << 2 | (y >> bit & 1u) << 1 | (x >> bit & 1u);
    return code;
}

TEST(ScreenOrder, FourByFourByHand) {
    const std::vector<std::uint32_t> expected{0, 1, 4, 5, 2, 3, 6, 7, 8, 9, 12, 13, 10, 11, 14, 15};
    EXPECT_EQ(pixels_in_morton_order(4, 4), expected);
}

TEST(ScreenOrder, ThreeByTwoSkipsWhatIsOutside) {
    EXPECT_EQ(pixels_in_morton_order(3, 2), (std::vector<std::uint32_t>{0, 1, 3, 4, 2, 5}));
}

TEST(ScreenOrder, EveryPixelOnceInCodeOrder) {
    const std::pair<std::uint32_t, std::uint32_t> sizes[] = {
        {1, 1},   {2, 1},    {1, 2},    {7, 5},     {64, 64},
        {65, 63}, {1000, 1}, {1, 1000}, {320, 240}, {16384, 2}};
    for (const auto& [width, height] : sizes) {
        SCOPED_TRACE(testing::Message() << width << " x " << height);
        std::vector<std::uint32_t> pixels = pixels_in_morton_order(width, height);
        ASSERT_EQ(pixels.size(), std::size_t{width} * height);
        for (std::size_t i = 1; i < pixels.size(); ++i)
            ASSERT_LT(code_of(pixels[i - 1] % width, pixels[i - 1] / width),
                      code_of(pixels[i] % width, pixels[i] / width));
        std::sort(pixels.begin(), pixels.end());
        for (std::size_t i = 0; i < pixels.size(); ++i) ASSERT_EQ(pixels[i], i);
    }
}

}  // namespace
}  // namespace raydix
