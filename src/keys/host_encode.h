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

/// Codes of primitives [begin, end) to out[0], out[1], ... in the baseline instruction set.
/// `all_valid`: nothing is to be left out, so nothing is checked.
template <bool all_valid, class Source, class Key>
void encode_range(const Source& source, const HostGrid& grid, std::size_t begin, std::size_t end,
                  Key* out) {
    for (std::size_t i = begin; i < end; ++i) {
        const auto k = static_cast<std::uint32_t>(i);
        if constexpr (all_valid) {
            *out++ = grid.code<Key>(valid_box(source, k));
        } else {
            Box3 box;
            const bool valid = host_box(source, k, box);
            *out++ = valid ? grid.code<Key>(box) : left_out_key<Key>;
        }
    }
}

#if defined(__x86_64__)

/// Whether this machine deposits bits in a few cycles: early Zen does it in microcode, at one or
/// two bits a cycle.
inline bool deposits_bits_fast() {
    static const bool fast = __builtin_cpu_supports("bmi2") && !__builtin_cpu_is("znver1") &&
                             !__builtin_cpu_is("znver2") && !__builtin_cpu_is("bdver4");
    return fast;
}

/// encode_range with the bits of every third place, from the highest code bit down, by one
/// instruction an axis.
template <bool all_valid, class Source, class Key>
[[gnu::target("bmi2,sse4.1")]] void encode_range_bmi2(const Source& source, const HostGrid& grid,
                                                      std::size_t begin, std::size_t end,
                                                      Key* out) {
    constexpr auto third = static_cast<std::uint64_t>(0x1249249249249249);  // places of z
    for (std::size_t i = begin; i < end; ++i) {
        const auto k = static_cast<std::uint32_t>(i);
        Box3 box;
        bool valid = true;
        if constexpr (all_valid)
            box = valid_box(source, k);
        else
            valid = host_box(source, k, box);
        const __m128i cell = grid.cell(box);
        const auto xy = static_cast<std::uint64_t>(_mm_cvtsi128_si64(cell));
        const auto z = static_cast<std::uint32_t>(_mm_extract_epi32(cell, 2));
        // The 21 lowest places are taken, so the upper half of xy does not get into x.
        const auto code = static_cast<Key>(_pdep_u64(xy, third << 2) |
                                           _pdep_u64(xy >> 32, third << 1) | _pdep_u64(z, third));
        *out++ = valid ? code : left_out_key<Key>;
    }
}

#endif

/// EncodeMorton for primitives [begin, end) in the best instruction set that the machine has.
template <class Source, class Key>
void host_encode_range(const Source& source, const HostGrid& grid, bool all_valid,
                       std::size_t begin, std::size_t end, Key* out) {
#if defined(__x86_64__)
    if (deposits_bits_fast())
        return all_valid ? encode_range_bmi2<true>(source, grid, begin, end, out)
                         : encode_range_bmi2<false>(source, grid, begin, end, out);
#endif
    if (all_valid)
        encode_range<true>(source, grid, begin, end, out);
    else
        encode_range<false>(source, grid, begin, end, out);
}

/// Primitive -> code, or left_out_key. source [n] -> codes [n].
template <class Source, class Key>
void host_encode(const Source& source, const Grid& grid, bool all_valid, std::size_t n,
                 Key* codes) {
    const HostGrid host_grid(grid);
    for_each_range(n, 4096, [&](std::size_t begin, std::size_t end) {
        host_encode_range(source, host_grid, all_valid, begin, end, codes + begin);
    });
}

}  // namespace raydix
