// Linear light <-> the 8-bit sRGB values of picture files.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace raydix {

/// A film-like curve from [0, inf) to [0, 1): a short toe, 0.18 stays 0.18, 1 becomes 0.78,
/// highlights roll off.
[[nodiscard]] inline float film_curve(float x) {
    x = std::max(x, 0.0f);
    if (x > 1e6f) return 1.0f;
    return x * (x + 0.05f) / (x * (x + 0.181f) + 0.165f);
}

/// IEC 61966-2-1. NaN and below become 0, above becomes 1.
[[nodiscard]] inline float srgb_from_linear(float x) {
    if (!(x > 0.0f)) return 0.0f;
    if (x >= 1.0f) return 1.0f;
    return x <= 0.0031308f ? 12.92f * x : 1.055f * std::pow(x, 1.0f / 2.4f) - 0.055f;
}

[[nodiscard]] inline float linear_from_srgb(float x) {
    return x <= 0.04045f ? x / 12.92f : std::pow((x + 0.055f) / 1.055f, 2.4f);
}

[[nodiscard]] inline std::uint8_t srgb_byte(float linear) {
    return static_cast<std::uint8_t>(srgb_from_linear(linear) * 255.0f + 0.5f);
}

}  // namespace raydix
