// Both maps are picked as they look on a screen (sRGB) and handed out as linear light.
#include "report/colour_map.h"

#include <algorithm>
#include <cmath>

#include "report/srgb.h"

namespace raydix {
namespace {

/// Screen values of the heat map at equal steps; their lightness grows evenly.
constexpr Vec3 heat_stops[] = {{0.03f, 0.02f, 0.12f}, {0.20f, 0.07f, 0.36f}, {0.42f, 0.11f, 0.47f},
                               {0.66f, 0.18f, 0.41f}, {0.86f, 0.31f, 0.25f}, {0.96f, 0.52f, 0.12f},
                               {0.98f, 0.74f, 0.22f}, {0.99f, 0.95f, 0.66f}};
constexpr int last_stop = static_cast<int>(std::size(heat_stops)) - 1;

Vec3 linear(float r, float g, float b) {
    return {linear_from_srgb(r), linear_from_srgb(g), linear_from_srgb(b)};
}

}  // namespace

Vec3 heat_colour(float part) {
    const float clamped = part > 0.0f ? std::min(part, 1.0f) : 0.0f;
    const float place = clamped * last_stop;
    const int stop = std::min(static_cast<int>(place), last_stop - 1);
    const float f = place - static_cast<float>(stop);
    const Vec3 a = heat_stops[stop], b = heat_stops[stop + 1];
    return linear(a.x + f * (b.x - a.x), a.y + f * (b.y - a.y), a.z + f * (b.z - a.z));
}

Vec3 id_colour(std::uint32_t id) {
    std::uint32_t h =
        (id + 1) *
        0x9E3779B1u;  // odd multiplier near 2^32 / golden ratio: ids spread over the circle
    h ^= h >> 15;
    const float hue = static_cast<float>(h & 0xFFFFu) * (6.0f / 65536.0f);
    const float value = 0.70f + 0.28f * static_cast<float>(h >> 16 & 0xFFu) / 255.0f;
    const float saturation = 0.40f + 0.35f * static_cast<float>(h >> 24) / 255.0f;
    const auto channel = [&](float middle) {
        const float off = std::abs(hue - middle), around = std::min(off, 6.0f - off);
        const float pure = std::clamp(2.0f - around, 0.0f, 1.0f);
        return value * (1.0f - saturation * (1.0f - pure));
    };
    return linear(channel(0.0f), channel(2.0f), channel(4.0f));
}

}  // namespace raydix
