// Rays whose directions agree in sign and in the longest axis form a class: boxes and triangles
// read the same planes and corners for all of them.
#pragma once

#include <array>
#include <cstdint>

namespace raydix {

/// Codes 0 to 23 are negative + 8 * kz; code 24 holds rays that packets do not take: invalid ones,
/// and those with directions so long or short that they are scaled.
inline constexpr std::uint32_t ray_class_count = 25, odd_ray_class = 24;

struct RayClass {
    std::uint32_t negatives;   // bit a: component a of the direction is negative (or -0)
    std::uint32_t kx, ky, kz;  // as in RayFrame

    /// kx, ky and kz.
    [[nodiscard]] constexpr std::uint32_t axis(std::size_t k) const {
        return k == 0 ? kx : k == 1 ? ky : kz;
    }
    [[nodiscard]] constexpr bool negative(int axis) const { return (negatives >> axis & 1) != 0; }
};

constexpr RayClass ray_class_of(std::uint32_t code) {
    RayClass out{code & 7, 0, 0, code >> 3};
    out.kx = out.kz == 2 ? 0 : out.kz + 1;
    out.ky = out.kx == 2 ? 0 : out.kx + 1;
    if (out.negative(static_cast<int>(out.kz))) {
        const std::uint32_t swapped = out.kx;
        out.kx = out.ky;
        out.ky = swapped;
    }
    return out;
}

/// [code]
inline constexpr auto ray_classes = [] {
    std::array<RayClass, odd_ray_class> table{};
    for (std::uint32_t code = 0; code < odd_ray_class; ++code) table[code] = ray_class_of(code);
    return table;
}();

/// Where the planes that a ray meets first and last are among lo[3][8], hi[3][8] of a node.
struct PlanePlaces {
    std::uint32_t near[3], far[3];
};
/// [RayClass::negatives]
inline constexpr auto plane_places = [] {
    std::array<PlanePlaces, 8> table{};
    for (std::uint32_t negatives = 0; negatives < 8; ++negatives)
        for (std::uint32_t axis = 0; axis < 3; ++axis) {
            const std::uint32_t negative = negatives >> axis & 1;
            table[negatives].near[axis] = 8 * axis + 24 * negative;
            table[negatives].far[axis] = 8 * axis + 24 * (1 - negative);
        }
    return table;
}();

/// [RayClass::negatives], a byte each: where the near and the far plane of x are, then of y and z.
inline constexpr auto packed_plane_places = [] {
    std::array<std::uint64_t, 8> table{};
    for (std::uint32_t negatives = 0; negatives < 8; ++negatives)
        for (std::uint32_t axis = 0; axis < 3; ++axis)
            table[negatives] |= std::uint64_t{plane_places[negatives].near[axis] |
                                              plane_places[negatives].far[axis] << 8}
                                << 16 * axis;
    return table;
}();

}  // namespace raydix
