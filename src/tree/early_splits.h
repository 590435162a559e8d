// Early split clipping: before a build, triangles whose boxes are mostly empty are cut into parts
// with boxes of their own. Ernst and Greiner 2007, "Early Split Clipping for Bounding Volume
// Hierarchies"; how many parts each triangle gets follows Karras and Aila 2013, "Fast Parallel
// Construction of High-Quality Bounding Volume Hierarchies", section 4.
#pragma once

#include <raydix/buffer.h>

#include <cstdint>

#include "tree/sah_reference.h"
#include "tree/triangle_corners.h"

namespace raydix {

/// More parts: better boxes, more memory and time.
struct EarlySplits {
    double budget = 0.5;      // references beyond one a triangle, at most, over triangles
    double least_waste = 64;  // triangles with a smaller waste than this many even shares of the
                              // scene's half surface stay whole
};

/// references [n]: one for each triangle that is not left out, n >= 1, inside `scene`. On return
/// they are those of the parts: a triangle's stand together, triangles in the old order. The boxes
/// of a triangle's parts cover it. At most (1 + budget) n.
void split_early(const TriangleCorners& corners, const Aabb& scene, const EarlySplits& options,
                 Buffer<SahReference>& references, Buffer<SahReference>& spare);

}  // namespace raydix
