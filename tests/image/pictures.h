// What tests of pictures share: all views, a camera, and how far two pictures are apart.
#pragma once

#include <raydix/picture.h>

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>

#include "report/srgb.h"

namespace raydix::test {

inline constexpr View all_views[] = {View::shaded, View::normal,  View::depth, View::primitive,
                                     View::ao,     View::diffuse, View::steps, View::path};

/// Before the ball and the boxes of shapes.h.
inline Camera camera_before_ball() {
    return {"before the ball", {1.5f, 3.0f, 7.5f}, {0.1f, 0.9f, 0}, {0, 1, 0}, 40};
}

inline RenderOptions options_for(View view, std::uint32_t width = 64, std::uint32_t height = 48) {
    RenderOptions options;
    options.view = view;
    options.width = width;
    options.height = height;
    return options;
}

inline bool same_pixels(const Picture& a, const Picture& b) {
    return a.pixels.size() == b.pixels.size() &&
           std::memcmp(a.pixels.data(), b.pixels.data(), a.pixels.size() * sizeof(Vec3)) == 0;
}

/// Pixels that differ by more than one level in a channel.
inline std::size_t count_different(const Picture& a, const Picture& b) {
    const auto apart = [](float x, float y) { return std::abs(srgb_byte(x) - srgb_byte(y)) > 1; };
    std::size_t count = 0;
    for (std::size_t i = 0; i < a.pixels.size(); ++i)
        count += apart(a.pixels[i].x, b.pixels[i].x) || apart(a.pixels[i].y, b.pixels[i].y) ||
                 apart(a.pixels[i].z, b.pixels[i].z);
    return count;
}

}  // namespace raydix::test
