// Which point and box go with which scalar, for functions that are written once for float and
// double.
#pragma once

#include <raydix/types.h>

namespace raydix {

template <class Scalar>
struct ScalarTypes;
template <>
struct ScalarTypes<float> {
    using Vec = Vec3;
    using Box = Aabb;
    /// Half the distance from 1 to the next number: what one rounding may add, relatively.
    static constexpr float rounding = 0x1p-24f;
};
template <>
struct ScalarTypes<double> {
    using Vec = Vec3d;
    using Box = AabbD;
    static constexpr double rounding = 0x1p-53;
};

template <class Scalar>
using VecOf = typename ScalarTypes<Scalar>::Vec;
template <class Scalar>
using BoxOf = typename ScalarTypes<Scalar>::Box;
template <class Scalar>
inline constexpr Scalar rounding_of = ScalarTypes<Scalar>::rounding;

}  // namespace raydix
