// Triangles without area.
#pragma once

#include <raydix/bvh.h>

#include "base/hd.h"

namespace raydix {

/// Whether the cross product of two edges, in double, is 0: such triangles are never hit by rays.
RAYDIX_HD inline bool has_zero_area(const LeafTriangle& t) {
    const double ax = double(t.v1.x) - t.v0.x, ay = double(t.v1.y) - t.v0.y,
                 az = double(t.v1.z) - t.v0.z;
    const double bx = double(t.v2.x) - t.v0.x, by = double(t.v2.y) - t.v0.y,
                 bz = double(t.v2.z) - t.v0.z;
    return ay * bz == az * by && az * bx == ax * bz && ax * by == ay * bx;
}

}  // namespace raydix
