// The chance in the ray protocol: Halton points, a hash per pixel, cosine-weighted directions about
// +z.
#pragma once

#include <raydix/types.h>

#include <cmath>
#include <cstdint>
#include <numbers>
#include <vector>

namespace raydix {

/// The digits of `index` in `base`, mirrored behind the point: the Halton sequence of that base. In
/// [0, 1).
[[nodiscard]] inline double radical_inverse(std::uint32_t base, std::uint32_t index) {
    std::uint64_t mirrored = 0, scale = 1;
    for (; index != 0; index /= base) {
        mirrored = mirrored * base + index % base;
        scale *= base;
    }
    return static_cast<double>(mirrored) / static_cast<double>(scale);
}

/// Spreads every bit of `x` over the whole word: two rounds of multiply and xor-shift (the finisher
/// of splitmix64).
[[nodiscard]] inline std::uint64_t mix_bits(std::uint64_t x) {
    x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9u;
    x = (x ^ (x >> 27)) * 0x94D049BB133111EBu;
    return x ^ (x >> 31);
}

/// One 64-bit number per (seed, id): equal for equal arguments on every machine.
[[nodiscard]] inline std::uint64_t hash_of(std::uint64_t seed, std::uint64_t id) {
    return mix_bits(mix_bits(seed + 0x9E3779B97F4A7C15u) + id * 0x9E3779B97F4A7C15u);
}

/// The top 24 bits as a number in [0, 1).
[[nodiscard]] inline float unit_from(std::uint64_t hash) {
    return static_cast<float>(hash >> 40) * 0x1p-24f;
}

/// Unit direction about +z with density cos(angle to z) / pi, from a point of the unit square.
[[nodiscard]] inline Vec3 cosine_direction(double radial, double angular) {
    const double radius = std::sqrt(radial), angle = 2.0 * std::numbers::pi * angular;
    return {static_cast<float>(radius * std::cos(angle)),
            static_cast<float>(radius * std::sin(angle)),
            static_cast<float>(std::sqrt(1.0 - radial))};
}

/// Unit direction with equal density over the whole sphere, from a point of the unit square.
[[nodiscard]] inline Vec3 sphere_direction(double height, double angular) {
    const double z = 1.0 - 2.0 * height, radius = std::sqrt(1.0 - z * z);
    const double angle = 2.0 * std::numbers::pi * angular;
    return {static_cast<float>(radius * std::cos(angle)),
            static_cast<float>(radius * std::sin(angle)), static_cast<float>(z)};
}

/// Cosine-weighted directions from the Halton points (bases 2 and 3) of indices [first, first +
/// count).
[[nodiscard]] inline std::vector<Vec3> halton_directions(std::uint32_t first, std::uint32_t count) {
    std::vector<Vec3> directions(count);
    for (std::uint32_t k = 0; k < count; ++k)
        directions[k] =
            cosine_direction(radical_inverse(2, first + k), radical_inverse(3, first + k));
    return directions;
}

}  // namespace raydix
