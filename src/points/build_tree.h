// Points -> the tree of point_tree.h: sorted along a Morton curve, put into groups of 16 (which may
// be parted again by medians), boxes fitted level by level.
#pragma once

#include <cstddef>
#include <cstdint>

#include "points/point_arrays.h"

namespace raydix {

/// What a look at all points says: their box and how many are invalid.
template <class T, int Dim>
struct PointBounds {
    T lo[Dim], hi[Dim];  // of valid points; infinity and -infinity if there are none
    std::uint64_t left_out = 0;
    std::size_t first_left_out = 0;  // if left_out > 0
};

/// points [n * Dim], one after the other.
template <class T, int Dim>
[[nodiscard]] PointBounds<T, Dim> bounds_of_points(const T* points, std::size_t n);

/// Copies the valid points into arrays.leaves in the order of the curve.
template <class T, int Dim>
void sort_into_leaves(const T* points, std::size_t n, const PointBounds<T, Dim>& bounds,
                      detail::PointArrays<T, Dim>& arrays);

/// Parts each run of groups that becomes one node by medians of the widest side.
template <class T, int Dim>
void halve_runs(detail::PointArrays<T, Dim>& arrays);

/// Nodes from leaves, and the view.
template <class T, int Dim>
void fit_point_nodes(detail::PointArrays<T, Dim>& arrays);

}  // namespace raydix
