// Colours for numbers: a heat map for amounts, one colour for each id. All in linear light.
#pragma once

#include <raydix/types.h>

#include <cstdint>

namespace raydix {

/// 0 -> nearly black indigo, over purple, red and orange, to pale yellow at 1; every step looks
/// lighter than the one before. Clamped; NaN counts as 0.
[[nodiscard]] Vec3 heat_colour(float part);

/// A bright colour of its own for each id; neighbours differ strongly. The same on every machine.
[[nodiscard]] Vec3 id_colour(std::uint32_t id);

}  // namespace raydix
