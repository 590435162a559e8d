// Affine maps: where an instance or a node of a file stands.
#pragma once

#include <array>

namespace raydix {

/// Affine: x' = m[0][0]*x + m[0][1]*y + m[0][2]*z + m[0][3], and so on; from the space of what is
/// placed to that of what it stands in. It may mirror and shear, but not flatten.
template <class Scalar>
struct BasicTransform {
    std::array<std::array<Scalar, 4>, 3> m{{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};
};
using Transform = BasicTransform<float>;
using TransformD = BasicTransform<double>;

}  // namespace raydix
