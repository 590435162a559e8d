// Box centre -> cell of one cubic grid -> Morton code, x highest in each triple (contract.md 2;
// Karras 2012, section 4).
#pragma once

#include <raydix/types.h>

#include <cstdint>
#include <limits>

#include "base/hd.h"
#include "base/math.h"

namespace raydix {

template <class Key>
struct CodeFormat;  // how many bits of `Key` are code, per axis and in all
template <>
struct CodeFormat<std::uint32_t> {
    static constexpr int axis_bits = 10, bits = 30;
};
template <>
struct CodeFormat<std::uint64_t> {
    static constexpr int axis_bits = 21, bits = 63;
};

/// The key of a primitive that is left out: above every code, so that sorting moves it to the end.
template <class Key>
inline constexpr Key left_out_key = std::numeric_limits<Key>::max();

struct Cell {
    std::uint32_t x, y, z;
};

struct Grid {
    Vec3 lo{};
    float cells_per_unit = 0.0f;  // 0: everything is in cell 0
    float last_cell = 0.0f;

    [[nodiscard]] RAYDIX_HD Cell cell(Vec3 center) const {
        const Vec3 at = (center - lo) * cells_per_unit;
        // The limit comes before the conversion: what lies beyond the last cell need not fit an
        // integer.
        return {static_cast<std::uint32_t>(min_of(at.x, last_cell)),
                static_cast<std::uint32_t>(min_of(at.y, last_cell)),
                static_cast<std::uint32_t>(min_of(at.z, last_cell))};
    }
};

/// `scene` is the box around all valid primitives; empty gives a grid of one cell.
RAYDIX_HD inline Grid make_grid(const Aabb& scene, int axis_bits) {
    if (is_empty(scene)) return {};
    const Vec3 size = scene.hi - scene.lo;
    const float longest = max_of(max_of(size.x, size.y), size.z);
    const auto cells = static_cast<float>(1u << axis_bits);
    Grid grid{scene.lo, 0.0f, cells - 1.0f};
    // A box thinner than 1e-32 would overflow the quotient; any large finite number serves there.
    if (longest > 0.0f)
        grid.cells_per_unit = min_of(cells / longest, std::numeric_limits<float>::max());
    return grid;
}

/// Moves bit k of a 10-bit number to bit 3k.
RAYDIX_HD inline std::uint32_t spread_bits(std::uint32_t v) {
    v = (v | v << 16) & 0x030000FFu;
    v = (v | v << 8) & 0x0300F00Fu;
    v = (v | v << 4) & 0x030C30C3u;
    v = (v | v << 2) & 0x09249249u;
    return v;
}

/// Moves bit k of a 21-bit number to bit 3k.
RAYDIX_HD inline std::uint64_t spread_bits(std::uint64_t v) {
    v = (v | v << 32) & 0x001F00000000FFFFull;
    v = (v | v << 16) & 0x001F0000FF0000FFull;
    v = (v | v << 8) & 0x100F00F00F00F00Full;
    v = (v | v << 4) & 0x10C30C30C30C30C3ull;
    v = (v | v << 2) & 0x1249249249249249ull;
    return v;
}

/// The inverse of spread_bits: every third bit from bit 0 on, moved together.
RAYDIX_HD inline std::uint32_t gather_bits(std::uint32_t v) {
    v &= 0x09249249u;
    v = (v | v >> 2) & 0x030C30C3u;
    v = (v | v >> 4) & 0x0300F00Fu;
    v = (v | v >> 8) & 0x030000FFu;
    return (v | v >> 16) & 0x000003FFu;
}
RAYDIX_HD inline std::uint64_t gather_bits(std::uint64_t v) {
    v &= 0x1249249249249249ull;
    v = (v | v >> 2) & 0x10C30C30C30C30C3ull;
    v = (v | v >> 4) & 0x100F00F00F00F00Full;
    v = (v | v >> 8) & 0x001F0000FF0000FFull;
    v = (v | v >> 16) & 0x001F00000000FFFFull;
    return (v | v >> 32) & 0x00000000001FFFFFull;
}

template <class Key>
RAYDIX_HD inline Key interleave(Cell c) {
    return spread_bits(Key{c.x}) << 2 | spread_bits(Key{c.y}) << 1 | spread_bits(Key{c.z});
}

/// Primitive -> code, or left_out_key. sources [n] -> codes [n].
template <class Source, class Key>
struct EncodeMorton {
    Source source;
    Grid grid;
    Key* codes;
    RAYDIX_HD void operator()(std::size_t i) const {
        Aabb box;
        const bool valid = source.box(static_cast<std::uint32_t>(i), box);
        codes[i] = valid ? interleave<Key>(grid.cell(center_of(box))) : left_out_key<Key>;
    }
};

}  // namespace raydix
