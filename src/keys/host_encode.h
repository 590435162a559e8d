// EncodeMorton (morton.h) for the host's loop: same bits, fewer instructions. source [n] -> codes
// [n].
#pragma once

#include <cstdint>

#include "keys/morton.h"
#include "primitives/host_box.h"

#if defined(__SSE2__)
#include <emmintrin.h>
#endif

namespace raydix {

#if defined(__SSE2__)

/// spread_bits of two numbers at once.
inline __m128i spread_bits(__m128i v) {
    const auto step = [](__m128i x, int shift, long long mask) {
        return _mm_and_si128(_mm_or_si128(x, _mm_slli_epi64(x, shift)), _mm_set1_epi64x(mask));
    };
    v = step(v, 32, 0x001F00000000FFFFll);
    v = step(v, 16, 0x001F0000FF0000FFll);
    v = step(v, 8, 0x100F00F00F00F00Fll);
    v = step(v, 4, 0x10C30C30C30C30C3ll);
    return step(v, 2, 0x1249249249249249ll);
}

/// The grid in registers.
struct HostGrid {
    Float3 lo, cells_per_unit, last_cell;

    explicit HostGrid(const Grid& grid)
        : lo(Float3::load(grid.lo)),
          cells_per_unit(Float3::all(grid.cells_per_unit)),
          last_cell(Float3::all(grid.last_cell)) {}

    template <class Key>
    [[nodiscard]] Key code(const Box3& box) const {
        const Float3 center = Float3::all(0.5f) * (box.lo + box.hi);
        const __m128i cell = _mm_cvttps_epi32(min_of((center - lo) * cells_per_unit, last_cell).v);
        const auto z = static_cast<std::uint32_t>(_mm_cvtsi128_si32(_mm_shuffle_epi32(cell, 2)));
        if constexpr (sizeof(Key) == 4) {
            const auto x = static_cast<std::uint32_t>(_mm_cvtsi128_si32(cell));
            const auto y =
                static_cast<std::uint32_t>(_mm_cvtsi128_si32(_mm_shuffle_epi32(cell, 1)));
            return interleave<Key>({x, y, z});
        } else {
            const __m128i xy = spread_bits(_mm_unpacklo_epi32(cell, _mm_setzero_si128()));
            const auto x = static_cast<std::uint64_t>(_mm_cvtsi128_si64(xy));
            const auto y =
                static_cast<std::uint64_t>(_mm_cvtsi128_si64(_mm_unpackhi_epi64(xy, xy)));
            return x << 2 | y << 1 | spread_bits(std::uint64_t{z});
        }
    }
};

#else

struct HostGrid {
    Grid grid;

    explicit HostGrid(const Grid& g) : grid(g) {}
    template <class Key>
    [[nodiscard]] Key code(const Box3& box) const {
        return interleave<Key>(grid.cell(center_of(box.box())));
    }
};

#endif

template <class Source, class Key>
struct HostEncodeMorton {
    Source source;
    HostGrid grid;
    Key* codes;
    void operator()(std::size_t i) const {
        Box3 box;
        const bool valid = host_box(source, static_cast<std::uint32_t>(i), box);
        codes[i] = valid ? grid.code<Key>(box) : left_out_key<Key>;
    }
};

}  // namespace raydix
