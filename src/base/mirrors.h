// Whether affine maps turn the outside of a body in.
#pragma once

#include <algorithm>
#include <cmath>

#include "base/double3.h"

namespace raydix {

/// Whether a map that does not flatten mirrors; its rows may be of any size.
inline bool mirrors(Double3 x, Double3 y, Double3 z) {
    const auto of_unit_size = [](Double3 row) {
        int exponent;
        std::frexp(std::max({std::fabs(row.x), std::fabs(row.y), std::fabs(row.z)}), &exponent);
        // In two steps: 2^1074 is no double.
        return row * std::ldexp(1.0, -exponent / 2) * std::ldexp(1.0, -exponent - -exponent / 2);
    };
    return dot(of_unit_size(x), cross(of_unit_size(y), of_unit_size(z))) < 0;
}

}  // namespace raydix
