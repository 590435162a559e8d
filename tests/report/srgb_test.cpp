// src/report/srgb.h and colour_map.h
#include "report/srgb.h"

#include <gtest/gtest.h>

#include <limits>
#include <set>
#include <tuple>

#include "report/colour_map.h"

namespace raydix {
namespace {

TEST(Srgb, KnownValues) {
    EXPECT_EQ(srgb_byte(0.0f), 0);
    EXPECT_EQ(srgb_byte(1.0f), 255);
    EXPECT_EQ(srgb_byte(0.5f), 188);
    EXPECT_EQ(srgb_byte(0.21586f), 128);
    EXPECT_EQ(srgb_byte(-3.0f), 0);
    EXPECT_EQ(srgb_byte(1e30f), 255);
    EXPECT_EQ(srgb_byte(std::numeric_limits<float>::quiet_NaN()), 0);
}

TEST(Srgb, EveryByteComesBack) {
    for (int byte = 0; byte < 256; ++byte)
        EXPECT_EQ(srgb_byte(linear_from_srgb(static_cast<float>(byte) / 255.0f)), byte);
}

TEST(FilmCurve, KeepsMiddleGreyAndNeverFalls) {
    EXPECT_EQ(film_curve(0.0f), 0.0f);
    EXPECT_EQ(film_curve(-1.0f), 0.0f);
    EXPECT_NEAR(film_curve(0.18f), 0.18f, 0.002f);
    EXPECT_NEAR(film_curve(1.0f), 0.78f, 0.002f);
    float before = 0.0f;
    for (float x = 1e-4f; x < 1e9f; x *= 1.1f) {
        EXPECT_GE(film_curve(x), before - 1e-6f);
        EXPECT_LE(film_curve(x), 1.0f);
        before = film_curve(x);
    }
}

TEST(HeatColour, GrowsLighterAllTheWay) {
    const auto luminance = [](Vec3 c) { return 0.2126 * c.x + 0.7152 * c.y + 0.0722 * c.z; };
    for (int i = 1; i <= 255; ++i)
        EXPECT_GT(luminance(heat_colour(static_cast<float>(i) / 255.0f)),
                  luminance(heat_colour(static_cast<float>(i - 1) / 255.0f)));
    EXPECT_EQ(heat_colour(-1.0f).x, heat_colour(0.0f).x);
    EXPECT_EQ(heat_colour(9.0f).x, heat_colour(1.0f).x);
    EXPECT_EQ(heat_colour(std::numeric_limits<float>::quiet_NaN()).x, heat_colour(0.0f).x);
}

TEST(IdColour, ManyIdsManyColours) {
    std::set<std::tuple<int, int, int>> seen;
    for (std::uint32_t id = 0; id < 1000; ++id) {
        const Vec3 c = id_colour(id);
        seen.insert({srgb_byte(c.x), srgb_byte(c.y), srgb_byte(c.z)});
        EXPECT_GT(c.x + c.y + c.z, 0.2f);
    }
    EXPECT_GT(seen.size(), 990u);
}

}  // namespace
}  // namespace raydix
