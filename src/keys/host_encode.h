// EncodeMorton (morton.h) for the host's loop: same bits, fewer instructions. source [n] -> codes
// [n].
#pragma once

#include <cstdint>

#include "exec/parallel.h"
#include "keys/morton.h"
#include "primitives/host_box.h"

#if defined(__SSE2__)
#include <emmintrin.h>
#endif
#if defined(__x86_64__)
#include <immintrin.h>
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

    /// x, y, z and a lane of no meaning.
    [[nodiscard]] __m128i cell(const Box3& box) const {
        const Float3 center = Float3::all(0.5f) * (box.lo + box.hi);
        return _mm_cvttps_epi32(min_of((center - lo) * cells_per_unit, last_cell).v);
    }
    template <class Key>
    [[nodiscard]] Key code(const Box3& box) const {
        const __m128i cell = this->cell(box);
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

/// encode[i] for i in [begin, end), in the baseline instruction set. `all_valid`: nothing is to be left out, so
/// nothing is checked.
template <bool all_valid, class Source, class Key>
void encode_range(const Source& source, const HostGrid& grid, Key* codes, std::size_t begin,
                  std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
        const auto k = static_cast<std::uint32_t>(i);
        if constexpr (all_valid) {
            codes[i] = grid.code<Key>(valid_box(source, k));
        } else {
            Box3 box;
            const bool valid = host_box(source, k, box);
            codes[i] = valid ? grid.code<Key>(box) : left_out_key<Key>;
        }
    }
}

#if defined(__x86_64__)

[[gnu::target("avx2")]] inline void spread_step(__m256i& v, int shift, long long mask) {
    v = _mm256_and_si256(_mm256_or_si256(v, _mm256_slli_epi64(v, shift)),
                         _mm256_set1_epi64x(mask));
}

/// 63-bit codes with all three axes spread at once.
template <class Source>
[[gnu::target("avx2")]] void encode_valid_range_avx2(const Source& source, const HostGrid& grid,
                                                     std::uint64_t* codes, std::size_t begin,
                                                     std::size_t end) {
    const __m256i axis_shift = _mm256_set_epi64x(64, 0, 1, 2);  // 64: the fourth lane becomes 0
    for (std::size_t i = begin; i < end; ++i) {
        const Box3 box = valid_box(source, static_cast<std::uint32_t>(i));
        __m256i v = _mm256_cvtepu32_epi64(grid.cell(box));
        spread_step(v, 32, 0x001F00000000FFFFll);
        spread_step(v, 16, 0x001F0000FF0000FFll);
        spread_step(v, 8, 0x100F00F00F00F00Fll);
        spread_step(v, 4, 0x10C30C30C30C30C3ll);
        spread_step(v, 2, 0x1249249249249249ll);
        v = _mm256_sllv_epi64(v, axis_shift);
        const __m128i pair =
            _mm_or_si128(_mm256_castsi256_si128(v), _mm256_extracti128_si256(v, 1));
        codes[i] = static_cast<std::uint64_t>(
            _mm_cvtsi128_si64(_mm_or_si128(pair, _mm_unpackhi_epi64(pair, pair))));
    }
}

#endif

/// Primitive -> code, or left_out_key: EncodeMorton in the best instruction set that the machine has. source [n]
/// -> codes [n].
template <class Source, class Key>
void host_encode(const Source& source, const Grid& grid, bool all_valid, std::size_t n,
                 Key* codes) {
    const HostGrid host_grid(grid);
    for_each_range(n, 4096, [&](std::size_t begin, std::size_t end) {
#if defined(__x86_64__)
        if constexpr (sizeof(Key) == 8)
            if (all_valid && __builtin_cpu_supports("avx2"))
                return encode_valid_range_avx2(source, host_grid, codes, begin, end);
#endif
        if (all_valid)
            encode_range<true>(source, host_grid, codes, begin, end);
        else
            encode_range<false>(source, host_grid, codes, begin, end);
    });
}

}  // namespace raydix
