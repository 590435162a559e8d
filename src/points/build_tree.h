// Points -> the tree of point_tree.h. Codes along a Morton curve are sorted and divided from the
// top until 256 points are left; those are parted into groups of 16 by medians; boxes are fitted
// from the bottom.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "points/point_arrays.h"

namespace raydix {

/// What a look at all points says: their box and how many are invalid.
template <class T, int Dim>
struct PointBounds {
    T lo[Dim], hi[Dim];  // of valid points; infinity and -infinity if there are none
    std::uint64_t left_out = 0;
    std::size_t first_left_out = 0;  // if left_out > 0
};

/// The sorted records [begin, end) are the points of bottom node `node`.
struct BottomRange {
    std::uint32_t begin, end, node;
};

/// points [n * Dim], one after the other.
template <class T, int Dim>
[[nodiscard]] PointBounds<T, Dim> bounds_of_points(const T* points, std::size_t n);

/// Codes of the points along the curve, ascending, to arrays.sort_scratch.records; invalid ones
/// last.
template <class T, int Dim>
void sort_along_curve(const T* points, std::size_t n, const PointBounds<T, Dim>& bounds,
                      detail::PointArrays<T, Dim>& arrays);

/// The first `valid` records -> nodes without boxes, and room for the groups. `kdtree` divides
/// where codes first differ, else into runs of the same length. Returns the records of each bottom
/// node.
template <class T, int Dim>
[[nodiscard]] std::vector<BottomRange> divide_into_nodes(const T* points, std::uint32_t valid,
                                                         bool kdtree,
                                                         detail::PointArrays<T, Dim>& arrays);

/// Points to groups, parted by medians of the widest side if `kdtree`; boxes of bottom nodes.
template <class T, int Dim>
void fill_leaves(const T* points, const std::vector<BottomRange>& bottoms, bool kdtree,
                 detail::PointArrays<T, Dim>& arrays);

/// Boxes of all other nodes.
template <class T, int Dim>
void fit_point_nodes(detail::PointArrays<T, Dim>& arrays);

}  // namespace raydix
