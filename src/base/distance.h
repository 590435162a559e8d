// What queries by distance agree on, for host and device.
#pragma once

#include <raydix/types.h>

#include "base/hd.h"

namespace raydix {

/// As contract.md 8 has it.
template <class Vec>
RAYDIX_HD auto squared_distance(Vec a, Vec b) {
    const auto dx = a.x - b.x, dy = a.y - b.y, dz = a.z - b.z;
    return (dx * dx + dy * dy) + dz * dz;
}

/// 0 times NaN or Inf is NaN.
RAYDIX_HD inline bool is_finite(Vec3 p) { return (p.x * 0.0f + p.y * 0.0f) + p.z * 0.0f == 0.0f; }
RAYDIX_HD inline bool is_finite(Vec3d p) { return (p.x * 0.0 + p.y * 0.0) + p.z * 0.0 == 0.0; }

}  // namespace raydix
