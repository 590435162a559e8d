// Affine maps: where an instance or a node of a file stands.
#pragma once

#include <array>

namespace raydix {

/// Affine: x' = m[0][0]*x + m[0][1]*y + m[0][2]*z + m[0][3], and so on; from the space of what is
/// placed to that of what it stands in. It may mirror and shear, but not flatten.
struct Transform {
    std::array<std::array<float, 4>, 3> m{{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};
};

/// As Transform.
struct TransformD {
    std::array<std::array<double, 4>, 3> m{{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};
};

}  // namespace raydix
