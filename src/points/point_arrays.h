// What a PointIndex owns.
#pragma once

#include <raydix/buffer.h>
#include <raydix/points.h>

#include <vector>

#include "points/point_tree.h"
#include "sort/radix_sort.h"

namespace raydix {

using PointCode = std::uint32_t;  // a place on the curve

/// One of the trees of an index that changed (point_forest.h), in its arrays. The root stands
/// apart, below the top node.
struct PointLevel {
    std::uint32_t first_leaf, leaves, first_node, nodes;
    std::uint32_t built;  // points, those removed since included
    std::uint32_t depth;
};

struct PointForestState {
    bool begun = false;  // false: the index is one tree, as it was built
    std::vector<PointLevel> levels;
    std::vector<std::uint32_t> leaf_of;  // [input_count]: no_primitive for what is not in the index
    std::vector<std::uint32_t> parent_of_leaf, parent_of_node;
};

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
    PointForestState forest;
    SortScratch<PointCode> sort_scratch;  // kept from the first rebuild on
};

}  // namespace detail
}  // namespace raydix
