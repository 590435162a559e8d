// What a PointIndex owns.
#pragma once

#include <raydix/buffer.h>
#include <raydix/points.h>

#include <vector>

#include "points/point_tree.h"
#include "sort/radix_sort.h"

namespace raydix {

using PointCode = std::uint32_t;  // a place on the curve

namespace detail {

template <class Scalar, int Dim>
struct PointArrays {
    Buffer<PointLeaf<Scalar, Dim>> leaves;
    Buffer<PointNode<Scalar, Dim>> nodes;
    std::vector<std::size_t> level_starts;  // nodes of level i: [i], ... [i + 1]
    PointTreeView<Scalar, Dim> tree;
    typename PointOf<Scalar, Dim>::Box bounds;
    PointsOptions options;
    PointsTree chosen = PointsTree::kdtree;
    std::uint64_t input_count = 0, left_out = 0, peak_bytes = 0;
    PointsBuildMs ms;
    SortScratch<PointCode> sort_scratch;  // kept from the first rebuild on
};

}  // namespace detail
}  // namespace raydix
