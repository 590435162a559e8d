// Places on a Morton curve through a box, in 2-D and 3-D, of floats and doubles.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

namespace raydix {

/// Moves bit k of a 10-bit number to bit 3k, or of a 15-bit number to bit 2k.
template <int Dim>
std::uint32_t spread_cell(std::uint32_t v) {
    if constexpr (Dim == 3) {
        v = (v | v << 16) & 0x030000FFu;
        v = (v | v << 8) & 0x0300F00Fu;
        v = (v | v << 4) & 0x030C30C3u;
        return (v | v << 2) & 0x09249249u;
    } else {
        v = (v | v << 8) & 0x00FF00FFu;
        v = (v | v << 4) & 0x0F0F0F0Fu;
        v = (v | v << 2) & 0x33333333u;
        return (v | v << 1) & 0x55555555u;
    }
}

/// 2^axis_bits cells along the longest side. What lies beyond the box is in its outermost cells,
/// NaN in cell 0.
template <class T, int Dim>
class CurveGrid {
public:
    static constexpr int axis_bits = Dim == 3 ? 10 : 15;
    static constexpr int bits = axis_bits * Dim;

    CurveGrid(const T* lo, const T* hi) {
        T longest = 0;
        for (int d = 0; d < Dim; ++d) {
            lo_[d] = lo[d];
            longest = std::max(longest, hi[d] - lo[d]);
        }
        constexpr T cells = 1 << axis_bits;
        last_ = std::nexttoward(cells, T{0});
        // A very thin box would overflow the quotient; any large finite number serves there.
        if (longest > 0) scale_ = std::min(cells / longest, std::numeric_limits<T>::max());
    }

    /// Codes of n points, each `stride` values after the other. In blocks, so that all steps but
    /// the first are loops over plain arrays, which compilers turn into vectors.
    void codes(const T* points, std::size_t n, std::uint32_t* codes,
               std::size_t stride = Dim) const {
        constexpr std::size_t block = 64;
        T at[Dim][block];
        for (std::size_t begin = 0; begin < n; begin += block) {
            const std::size_t size = std::min(block, n - begin);
            for (std::size_t i = 0; i < size; ++i)
                for (int d = 0; d < Dim; ++d) at[d][i] = points[(begin + i) * stride + d];
            std::uint32_t sum[block] = {};
            for (int d = 0; d < Dim; ++d)
                for (std::size_t i = 0; i < size; ++i)
                    sum[i] |= spread_cell<Dim>(cell(at[d][i], d)) << (Dim - 1 - d);
            std::copy_n(sum, size, codes + begin);
        }
    }

private:
    [[nodiscard]] std::uint32_t cell(T x, int d) const {
        const T at = (x - lo_[d]) * scale_;
        const T inside = at > 0 ? at : T{0};
        return static_cast<std::uint32_t>(
            static_cast<std::int32_t>(inside < last_ ? inside : last_));
    }

    T lo_[Dim], scale_ = 0, last_;
};

}  // namespace raydix
