// The stages of a build over points, for each scalar and dimension.
#include "points/build_tree.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
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
int widest_side(const PointBounds<T, Dim>& box) {
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
        PointBounds<T, Dim> box = no_bounds<T, Dim>();
        for (std::size_t i = 0; i < n; ++i) grow(box, points[i].at, points[i].at);
        const int side = widest_side(box);
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
void fit_leaf(const PointLeaf<T, Dim>& leaf, std::uint32_t count, PointNode<T, Dim>& node,
              std::uint32_t child) {
    node.lowest_id[child] = *std::min_element(leaf.id, leaf.id + count);
    node.points[child] = count;
    for (int d = 0; d < Dim; ++d) {
        T lo = leaf.at[d][0], hi = lo;
        for (std::uint32_t i = 1; i < points_per_leaf; ++i) {  // NaN changes neither
            lo = leaf.at[d][i] < lo ? leaf.at[d][i] : lo;
            hi = leaf.at[d][i] > hi ? leaf.at[d][i] : hi;
        }
        node.lo[d][child] = lo;
        node.hi[d][child] = hi;
    }
}

template <class T, int Dim>
void fit_node(const PointNode<T, Dim>& below, PointNode<T, Dim>& node, std::uint32_t child) {
    const std::uint32_t count = below.children;
    for (int d = 0; d < Dim; ++d) {
        node.lo[d][child] = *std::min_element(below.lo[d], below.lo[d] + count);
        node.hi[d][child] = *std::max_element(below.hi[d], below.hi[d] + count);
    }
    node.lowest_id[child] = *std::min_element(below.lowest_id, below.lowest_id + count);
    node.points[child] = std::accumulate(below.points, below.points + count, 0u);
}

template <class T, int Dim>
void clear_rest(PointNode<T, Dim>& node) {
    for (std::uint32_t c = node.children; c < boxes_per_node; ++c) {
        for (int d = 0; d < Dim; ++d) node.lo[d][c] = node.hi[d][c] = 0;
        node.lowest_id[c] = no_primitive;
        node.points[c] = 0;
    }
}

using Record = SortRecord<std::uint64_t>;
constexpr std::uint32_t points_per_bottom = points_per_leaf * boxes_per_node;

struct Range {
    std::uint32_t begin, end;
    [[nodiscard]] std::uint32_t size() const { return end - begin; }
};

/// The parts of one node's range, in order.
struct Parts {
    std::array<Range, boxes_per_node> ranges;
    std::uint32_t count = 0;

    void split(std::uint32_t at, std::uint32_t middle) {
        for (std::uint32_t i = count++; i > at; --i) ranges[i] = ranges[i - 1];
        ranges[at + 1] = {middle, ranges[at].end};
        ranges[at].end = middle;
    }
};

/// Where a range is halved. Where all codes are equal the points are put in order along the widest
/// side of their box first, unless they are all at the same place.
template <class T, int Dim>
std::uint32_t middle_of(const T* points, Record* records, Range range) {
    const std::uint64_t differs = records[range.begin].key ^ records[range.end - 1].key;
    if (differs != 0) {
        const std::uint64_t bit = std::bit_floor(differs);
        return static_cast<std::uint32_t>(
            std::partition_point(records + range.begin, records + range.end,
                                 [bit](const Record& r) { return (r.key & bit) == 0; }) -
            records);
    }
    const std::uint32_t middle = range.begin + range.size() / 2;
    PointBounds<T, Dim> box = no_bounds<T, Dim>();
    for (std::uint32_t i = range.begin; i < range.end; ++i) {
        const T* p = points + std::size_t{records[i].position} * Dim;
        grow(box, p, p);
    }
    const int side = widest_side(box);
    if (box.lo[side] == box.hi[side]) return middle;
    std::nth_element(records + range.begin, records + middle, records + range.end,
                     [=](const Record& a, const Record& b) {
                         const T x = points[std::size_t{a.position} * Dim + side],
                                 y = points[std::size_t{b.position} * Dim + side];
                         return x < y || (x == y && a.position < b.position);
                     });
    return middle;
}

/// Halves the largest part until there are 16, or none is left that must be divided.
template <class T, int Dim>
Parts halved_parts(const T* points, Record* records, Range range) {
    Parts parts;
    parts.ranges[parts.count++] = range;
    while (parts.count < boxes_per_node) {
        std::uint32_t largest = 0;
        for (std::uint32_t i = 1; i < parts.count; ++i)
            if (parts.ranges[i].size() > parts.ranges[largest].size()) largest = i;
        const Range part = parts.ranges[largest];
        if (part.size() <= points_per_bottom) break;
        parts.split(largest, middle_of<T, Dim>(points, records, part));
    }
    return parts;
}

/// Parts of 256, 4096, 65536, ... points.
Parts equal_parts(Range range) {
    std::uint64_t each = points_per_bottom;
    while (each * boxes_per_node < range.size()) each *= boxes_per_node;
    Parts parts;
    for (std::uint64_t begin = range.begin; begin < range.end; begin += each)
        parts.ranges[parts.count++] = {
            static_cast<std::uint32_t>(begin),
            static_cast<std::uint32_t>(std::min<std::uint64_t>(begin + each, range.end))};
    return parts;
}

std::uint32_t leaves_for(std::uint32_t points) {
    return points / points_per_leaf + (points % points_per_leaf != 0 ? 1 : 0);
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
void sort_along_curve(const T* points, std::size_t n, const PointBounds<T, Dim>& bounds,
                      detail::PointArrays<T, Dim>& arrays) {
    constexpr int axis_bits = CurveGrid<T, Dim>::most_axis_bits;
    const CurveGrid<T, Dim> grid(bounds.lo, bounds.hi, axis_bits);
    const bool all_valid = bounds.left_out == 0;
    const auto load = [&](std::size_t begin, std::size_t end, std::uint64_t* codes) {
        for (std::size_t i = begin; i < end; ++i) {
            const T* p = points + i * Dim;
            *codes++ =
                all_valid || is_valid<T, Dim>(p) ? grid.code(p) : left_out_key<std::uint64_t>;
        }
    };
    sort_on_the_way<std::uint64_t>(
        n, all_valid ? axis_bits * Dim : 64, load, [](std::size_t, std::span<const Record>) {},
        arrays.sort_scratch);
}

template <class T, int Dim>
std::vector<BottomRange> divide_into_nodes(const T* points, std::uint32_t valid, bool kdtree,
                                           detail::PointArrays<T, Dim>& arrays) {
    Record* records = arrays.sort_scratch.records.data();
    struct Node {
        Range range;
        std::uint32_t below, children;
    };
    std::vector<Node> nodes{{{0, valid}, 0, 0}};
    std::vector<BottomRange> bottoms;
    std::vector<Parts> parts;
    arrays.level_starts.assign(1, 0);
    for (std::size_t begin = 0; begin < nodes.size();) {  // a level at a time
        const std::size_t end = nodes.size();
        parts.assign(end - begin, {});
        for_each_range(end - begin, 16, [&](std::size_t first, std::size_t last) {
            for (std::size_t i = first; i < last; ++i) {
                const Range range = nodes[begin + i].range;
                if (range.size() <= points_per_bottom) continue;
                parts[i] =
                    kdtree ? halved_parts<T, Dim>(points, records, range) : equal_parts(range);
            }
        });
        for (std::size_t i = begin; i < end; ++i) {
            const Parts& of_node = parts[i - begin];
            nodes[i].below = static_cast<std::uint32_t>(nodes.size());
            nodes[i].children = of_node.count;
            if (of_node.count == 0)
                bottoms.push_back(
                    {nodes[i].range.begin, nodes[i].range.end, static_cast<std::uint32_t>(i)});
            for (std::uint32_t c = 0; c < of_node.count; ++c)
                nodes.push_back({of_node.ranges[c], 0, 0});
        }
        arrays.level_starts.push_back(end);
        begin = end;
    }
    std::sort(bottoms.begin(), bottoms.end(),
              [](const BottomRange& a, const BottomRange& b) { return a.begin < b.begin; });
    arrays.nodes.reset(nodes.size());
    for (std::size_t i = 0; i < nodes.size(); ++i) {
        PointNode<T, Dim>& node = arrays.nodes[i];
        node.below = nodes[i].below;
        node.children = nodes[i].children;
        node.is_bottom = nodes[i].children == 0;
    }
    std::uint32_t leaves = 0;
    for (const BottomRange& bottom : bottoms) {
        PointNode<T, Dim>& node = arrays.nodes[bottom.node];
        node.below = leaves;
        node.children = leaves_for(bottom.end - bottom.begin);
        leaves += node.children;
    }
    arrays.leaves.reset(leaves);
    return bottoms;
}

template <class T, int Dim>
void fill_leaves(const T* points, const std::vector<BottomRange>& bottoms, bool kdtree,
                 detail::PointArrays<T, Dim>& arrays) {
    const Record* records = arrays.sort_scratch.records.data();
    for_each_range(bottoms.size(), 8, [&](std::size_t first, std::size_t last) {
        std::array<MovingPoint<T, Dim>, points_per_bottom> moving;
        for (std::size_t b = first; b < last; ++b) {
            const BottomRange bottom = bottoms[b];
            const std::uint32_t n = bottom.end - bottom.begin;
            for (std::uint32_t i = 0; i < n; ++i) {
                const std::uint32_t id = records[bottom.begin + i].position;
                const T* p = points + std::size_t{id} * Dim;
                for (int d = 0; d < Dim; ++d) moving[i].at[d] = p[d] + T{0};  // -0 becomes +0
                moving[i].id = id;
            }
            if (kdtree) halve(moving.data(), n);
            PointNode<T, Dim>& node = arrays.nodes[bottom.node];
            PointLeaf<T, Dim>* leaves = arrays.leaves.data() + node.below;
            for (std::uint32_t i = 0; i < node.children * points_per_leaf; ++i) {
                PointLeaf<T, Dim>& leaf = leaves[i / points_per_leaf];
                const std::uint32_t lane = i % points_per_leaf;
                for (int d = 0; d < Dim; ++d)
                    leaf.at[d][lane] =
                        i < n ? moving[i].at[d] : std::numeric_limits<T>::quiet_NaN();
                leaf.id[lane] = i < n ? moving[i].id : no_primitive;
            }
            for (std::uint32_t c = 0; c < node.children; ++c)
                fit_leaf(leaves[c], std::min(n - c * points_per_leaf, points_per_leaf), node, c);
            clear_rest(node);
        }
    });
}

template <class T, int Dim>
void fit_point_nodes(detail::PointArrays<T, Dim>& arrays) {
    PointNode<T, Dim>* nodes = arrays.nodes.data();
    for (std::size_t level = arrays.level_starts.size() - 1; level-- > 0;) {
        const std::size_t begin = arrays.level_starts[level], end = arrays.level_starts[level + 1];
        for_each_index(
            end - begin,
            [&](std::size_t i) {
                PointNode<T, Dim>& node = nodes[begin + i];
                if (node.is_bottom != 0) return;
                for (std::uint32_t c = 0; c < node.children; ++c)
                    fit_node(nodes[node.below + c], node, c);
                clear_rest(node);
            },
            16);
    }
}

#define RAYDIX_POINT_BUILD(T, Dim)                                                     \
    template PointBounds<T, Dim> bounds_of_points(const T*, std::size_t);              \
    template void sort_along_curve(const T*, std::size_t, const PointBounds<T, Dim>&,  \
                                   detail::PointArrays<T, Dim>&);                      \
    template std::vector<BottomRange> divide_into_nodes(const T*, std::uint32_t, bool, \
                                                        detail::PointArrays<T, Dim>&); \
    template void fill_leaves(const T*, const std::vector<BottomRange>&, bool,         \
                              detail::PointArrays<T, Dim>&);                           \
    template void fit_point_nodes(detail::PointArrays<T, Dim>&);
RAYDIX_POINT_BUILD(float, 2)
RAYDIX_POINT_BUILD(float, 3)
RAYDIX_POINT_BUILD(double, 2)
RAYDIX_POINT_BUILD(double, 3)
#undef RAYDIX_POINT_BUILD

}  // namespace raydix
