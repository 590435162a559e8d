// End-point overlap of a tree of triangles: how much surface lies inside nodes that it does not
// belong to. Aila, Karras, Laine 2013, "On Quality Metrics of Bounding Volume Hierarchies".
#pragma once

#include <raydix/bvh.h>

#include <optional>

namespace raydix {

/// Sum over nodes of cost(n) * area(triangles outside n's subtree, clipped to n's box) / total
/// area. `sample` in (0, 1] is the part of the triangles that is summed over, evenly spread along
/// the order; their own area is then the total. None for trees without triangles or without area.
/// Throws InputError if `sample` is outside its range.
[[nodiscard]] std::optional<double> end_point_overlap(const Bvh& bvh, const SahConstants& cost,
                                                      double sample);

}  // namespace raydix
