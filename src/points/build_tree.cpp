// The stages of a build over points, for each scalar and dimension.
#include "points/build_tree.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "base/math.h"
#include "exec/parallel.h"
#include "points/curve.h"

namespace raydix {
namespace {

constexpr std::size_t points_per_block = 1u << 15;

template <class T, int Dim>
bool is_valid(const T* p) {
    bool valid = true;
    for (int d = 0; d < Dim; ++d)
        valid &= std::abs(p[d]) <= static_cast<T>(max_coordinate);  // false for NaN
    return valid;
}

template <class T, int Dim>
PointBounds<T, Dim> no_bounds() {
    PointBounds<T, Dim> bounds;
    std::fill_n(bounds.lo, Dim, std::numeric_limits<T>::infinity());
    std::fill_n(bounds.hi, Dim, -std::numeric_limits<T>::infinity());
    return bounds;
}

template <class T, int Dim>
void grow(PointBounds<T, Dim>& bounds, const T* lo, const T* hi) {
    for (int d = 0; d < Dim; ++d) {
        bounds.lo[d] = lo[d] < bounds.lo[d] ? lo[d] : bounds.lo[d];
        bounds.hi[d] = hi[d] > bounds.hi[d] ? hi[d] : bounds.hi[d];
    }
}

/// A point on its way from one group to another.
template <class T, int Dim>
struct MovingPoint {
    T at[Dim];
    std::uint32_t id;
};

template <class T, int Dim>
int widest_side(const MovingPoint<T, Dim>* points, std::size_t n) {
    PointBounds<T, Dim> box = no_bounds<T, Dim>();
    for (std::size_t i = 0; i < n; ++i) grow(box, points[i].at, points[i].at);
    int widest = 0;
    for (int d = 1; d < Dim; ++d)
        if (box.hi[d] - box.lo[d] > box.hi[widest] - box.lo[widest]) widest = d;
    return widest;
}

/// Parts points so that each 16 of them are neighbours. The order of (coordinate, id) is total, so
/// which points come together does not depend on the library's selection.
template <class T, int Dim>
void halve(MovingPoint<T, Dim>* points, std::size_t n) {
    while (n > points_per_leaf) {
        const std::size_t leaves = (n + points_per_leaf - 1) / points_per_leaf;
        const std::size_t left = (leaves + 1) / 2 * points_per_leaf;
        const int side = widest_side(points, n);
        std::nth_element(points, points + left, points + n,
                         [side](const MovingPoint<T, Dim>& a, const MovingPoint<T, Dim>& b) {
                             return a.at[side] < b.at[side] ||
                                    (a.at[side] == b.at[side] && a.id < b.id);
                         });
        halve(points, left);
        points += left;
        n -= left;
    }
}

template <class T, int Dim>
void fit_leaf(const PointLeaf<T, Dim>& leaf, PointNode<T, Dim>& node, std::uint32_t child,
              std::uint32_t* lowest_id) {
    std::uint32_t lowest = no_primitive;
    for (std::uint32_t i = 0; i < points_per_leaf; ++i) lowest = std::min(lowest, leaf.id[i]);
    for (int d = 0; d < Dim; ++d) {
        T lo = leaf.at[d][0], hi = lo;
        for (std::uint32_t i = 1; i < points_per_leaf; ++i) {  // NaN changes neither
            lo = leaf.at[d][i] < lo ? leaf.at[d][i] : lo;
            hi = leaf.at[d][i] > hi ? leaf.at[d][i] : hi;
        }
        node.lo[d][child] = lo;
        node.hi[d][child] = hi;
    }
    lowest_id[child] = lowest;
}

template <class T, int Dim>
void fit_node(const PointNode<T, Dim>& below, const std::uint32_t* ids, std::uint32_t count,
              PointNode<T, Dim>& node, std::uint32_t child, std::uint32_t* lowest_id) {
    for (int d = 0; d < Dim; ++d) {
        node.lo[d][child] = *std::min_element(below.lo[d], below.lo[d] + count);
        node.hi[d][child] = *std::max_element(below.hi[d], below.hi[d] + count);
    }
    lowest_id[child] = *std::min_element(ids, ids + count);
}

template <class T, int Dim>
void clear_children(PointNode<T, Dim>& node, std::uint32_t from, std::uint32_t* lowest_id) {
    for (std::uint32_t c = from; c < boxes_per_node; ++c) {
        for (int d = 0; d < Dim; ++d) node.lo[d][c] = node.hi[d][c] = 0;
        lowest_id[c] = no_primitive;
    }
}

}  // namespace

template <class T, int Dim>
PointBounds<T, Dim> bounds_of_points(const T* points, std::size_t n) {
    const std::size_t blocks = (n + points_per_block - 1) / points_per_block;
    std::vector<PointBounds<T, Dim>> parts(blocks, no_bounds<T, Dim>());
    for_each_block(n, points_per_block, [&](std::size_t b, std::size_t begin, std::size_t end) {
        PointBounds<T, Dim> part = no_bounds<T, Dim>();
        for (std::size_t i = begin; i < end; ++i) {
            const T* p = points + i * Dim;
            if (is_valid<T, Dim>(p)) {
                grow(part, p, p);
            } else if (part.left_out++ == 0) {
                part.first_left_out = i;
            }
        }
        parts[b] = part;
    });
    PointBounds<T, Dim> all = no_bounds<T, Dim>();
    for (const PointBounds<T, Dim>& part : parts) {
        grow(all, part.lo, part.hi);
        if (all.left_out == 0) all.first_left_out = part.first_left_out;
        all.left_out += part.left_out;
    }
    for (int d = 0; d < Dim; ++d) {  // -0 becomes +0
        all.lo[d] += T{0};
        all.hi[d] += T{0};
    }
    return all;
}

template <class T, int Dim>
void sort_into_leaves(const T* points, std::size_t n, const PointBounds<T, Dim>& bounds,
                      detail::PointArrays<T, Dim>& arrays) {
    constexpr int axis_bits = CurveGrid<T, Dim>::most_axis_bits;
    const CurveGrid<T, Dim> grid(bounds.lo, bounds.hi, axis_bits);
    const std::size_t valid = n - bounds.left_out;
    const std::size_t leaves = (valid + points_per_leaf - 1) / points_per_leaf;
    arrays.leaves.reset(leaves);
    PointLeaf<T, Dim>* out = arrays.leaves.data();
    const bool all_valid = valid == n;
    const auto load = [&](std::size_t begin, std::size_t end, std::uint64_t* codes) {
        for (std::size_t i = begin; i < end; ++i) {
            const T* p = points + i * Dim;
            *codes++ =
                all_valid || is_valid<T, Dim>(p) ? grid.code(p) : left_out_key<std::uint64_t>;
        }
    };
    const auto take = [&](std::size_t begin, std::span<const SortRecord<std::uint64_t>> sorted) {
        constexpr std::size_t ahead = 16;
        for (std::size_t k = 0; k < sorted.size() && begin + k < valid; ++k) {
            if (k + ahead < sorted.size())
                __builtin_prefetch(points + std::size_t{sorted[k + ahead].position} * Dim);
            PointLeaf<T, Dim>& leaf = out[(begin + k) / points_per_leaf];
            const std::size_t lane = (begin + k) % points_per_leaf;
            const T* p = points + std::size_t{sorted[k].position} * Dim;
            for (int d = 0; d < Dim; ++d) leaf.at[d][lane] = p[d] + T{0};  // -0 becomes +0
            leaf.id[lane] = sorted[k].position;
        }
    };
    const int key_bits = all_valid ? axis_bits * Dim : 64;
    sort_on_the_way<std::uint64_t>(n, key_bits, load, take, arrays.sort_scratch);
    for (std::size_t i = valid; i < leaves * points_per_leaf; ++i) {
        PointLeaf<T, Dim>& leaf = out[i / points_per_leaf];
        for (int d = 0; d < Dim; ++d)
            leaf.at[d][i % points_per_leaf] = std::numeric_limits<T>::quiet_NaN();
        leaf.id[i % points_per_leaf] = no_primitive;
    }
}

template <class T, int Dim>
void halve_runs(detail::PointArrays<T, Dim>& arrays) {
    constexpr std::size_t run_leaves = boxes_per_node, run = run_leaves * points_per_leaf;
    PointLeaf<T, Dim>* leaves = arrays.leaves.data();
    for_each_block(arrays.leaves.size(), run_leaves, [&](std::size_t, std::size_t begin,
                                                         std::size_t end) {
        std::array<MovingPoint<T, Dim>, run> moving;
        std::size_t n = 0;
        for (std::size_t b = begin; b < end; ++b)
            for (std::size_t i = 0; i < points_per_leaf; ++i) {
                if (leaves[b].id[i] == no_primitive) break;
                for (int d = 0; d < Dim; ++d) moving[n].at[d] = leaves[b].at[d][i];
                moving[n++].id = leaves[b].id[i];
            }
        halve(moving.data(), n);
        for (std::size_t i = 0; i < n; ++i) {
            PointLeaf<T, Dim>& leaf = leaves[begin + i / points_per_leaf];
            for (int d = 0; d < Dim; ++d) leaf.at[d][i % points_per_leaf] = moving[i].at[d];
            leaf.id[i % points_per_leaf] = moving[i].id;
        }
    });
}

template <class T, int Dim>
void fit_point_nodes(detail::PointArrays<T, Dim>& arrays) {
    PointTreeView<T, Dim>& tree = arrays.tree;
    std::uint32_t total = 0;
    for (auto below = static_cast<std::uint32_t>(arrays.leaves.size()); below != 0;) {
        tree.start[tree.levels] = total;
        tree.children[tree.levels++] = below;
        const std::uint32_t nodes = below / boxes_per_node + (below % boxes_per_node != 0);
        total += nodes;
        below = nodes > 1 ? nodes : 0;
    }
    arrays.nodes.reset(total);
    arrays.lowest_ids.reset(std::size_t{total} * boxes_per_node);
    PointNode<T, Dim>* nodes = arrays.nodes.data();
    std::uint32_t* ids = arrays.lowest_ids.data();
    const PointLeaf<T, Dim>* leaves = arrays.leaves.data();
    for (std::uint32_t level = 0; level < tree.levels; ++level) {
        const std::uint32_t children = tree.children[level];
        for_each_block(children, boxes_per_node,
                       [&](std::size_t k, std::size_t begin, std::size_t end) {
                           PointNode<T, Dim>& node = nodes[tree.start[level] + k];
                           std::uint32_t* lowest = ids + (tree.start[level] + k) * boxes_per_node;
                           for (std::size_t c = begin; c < end; ++c) {
                               const auto lane = static_cast<std::uint32_t>(c - begin);
                               if (level == 0) {
                                   fit_leaf(leaves[c], node, lane, lowest);
                                   continue;
                               }
                               const std::size_t below = tree.start[level - 1] + c;
                               const std::uint32_t mask =
                                   tree.child_mask(level - 1, static_cast<std::uint32_t>(c));
                               fit_node(nodes[below], ids + below * boxes_per_node,
                                        static_cast<std::uint32_t>(std::popcount(mask)), node,
                                        lane, lowest);
                           }
                           clear_children(node, static_cast<std::uint32_t>(end - begin), lowest);
                       });
    }
    tree.leaves = leaves;
    tree.nodes = nodes;
    tree.lowest_ids = ids;
}

#define RAYDIX_POINT_BUILD(T, Dim)                                                               \
    template PointBounds<T, Dim> bounds_of_points(const T*, std::size_t);                        \
    template void sort_into_leaves(const T*, std::size_t, const PointBounds<T, Dim>&,            \
                                   detail::PointArrays<T, Dim>&);                                \
    template void halve_runs(detail::PointArrays<T, Dim>&);                                      \
    template void fit_point_nodes(detail::PointArrays<T, Dim>&);
RAYDIX_POINT_BUILD(float, 2)
RAYDIX_POINT_BUILD(float, 3)
RAYDIX_POINT_BUILD(double, 2)
RAYDIX_POINT_BUILD(double, 3)
#undef RAYDIX_POINT_BUILD

}  // namespace raydix
