// Whether a set of boxes covers a triangle: the invariant of trees that hold parts of triangles.
#pragma once

#include <raydix/bvh.h>

#include <span>

namespace raydix {

/// True if every point of the triangle is in one of the boxes, up to the rounding of double.
/// Patient in proportion to the number of boxes: what no builder makes may be refused.
[[nodiscard]] bool boxes_cover(const LeafTriangle& triangle, std::span<const Aabb> boxes);

}  // namespace raydix
