// Places on a Morton curve through a box, in 2-D and 3-D, of floats and doubles.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>

#include "keys/morton.h"

namespace raydix {

/// Moves bit k of a 31-bit number to bit 2k.
inline std::uint64_t spread_bits_2d(std::uint64_t v) {
    v = (v | v << 16) & 0x0000FFFF0000FFFFull;
    v = (v | v << 8) & 0x00FF00FF00FF00FFull;
    v = (v | v << 4) & 0x0F0F0F0F0F0F0F0Full;
    v = (v | v << 2) & 0x3333333333333333ull;
    return (v | v << 1) & 0x5555555555555555ull;
}

/// 2^axis_bits cells along the longest side. What lies beyond the box is in its outermost cells,
/// NaN in cell 0.
template <class T, int Dim>
class CurveGrid {
public:
    static constexpr int most_axis_bits = Dim == 3 ? 21 : 31;

    CurveGrid(const T* lo, const T* hi, int axis_bits) {
        T longest = 0;
        for (int d = 0; d < Dim; ++d) {
            lo_[d] = lo[d];
            longest = std::max(longest, hi[d] - lo[d]);
        }
        const T cells = static_cast<T>(std::uint64_t{1} << axis_bits);
        last_ = std::nexttoward(cells, T{0});
        // A very thin box would overflow the quotient; any large finite number serves there.
        if (longest > 0) scale_ = std::min(cells / longest, std::numeric_limits<T>::max());
    }

    [[nodiscard]] std::uint64_t code(const T* point) const {
        std::uint64_t cell[Dim];
        for (int d = 0; d < Dim; ++d) {
            const T at = (point[d] - lo_[d]) * scale_;
            cell[d] = static_cast<std::uint64_t>(
                static_cast<std::int64_t>(std::min(at > 0 ? at : T{0}, last_)));
        }
        if constexpr (Dim == 3)
            return spread_bits(cell[0]) << 2 | spread_bits(cell[1]) << 1 | spread_bits(cell[2]);
        else
            return spread_bits_2d(cell[0]) << 1 | spread_bits_2d(cell[1]);
    }

private:
    T lo_[Dim], scale_ = 0, last_;
};

}  // namespace raydix
