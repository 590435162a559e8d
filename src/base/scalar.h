// What functions that are written once for float and double must know of the type.
#pragma once

namespace raydix {

/// Half the distance from 1 to the next number: what one rounding may add, relatively.
template <class Scalar>
inline constexpr Scalar rounding_of = 0;
template <>
inline constexpr float rounding_of<float> = 0x1p-24f;
template <>
inline constexpr double rounding_of<double> = 0x1p-53;

}  // namespace raydix
