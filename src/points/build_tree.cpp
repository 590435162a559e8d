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
#include "keys/morton.h"
#include "points/curve.h"
#include "points/median_split.h"

namespace raydix {
namespace {

constexpr std::size_t points_per_block = 1u << 15;

template <class T, int Dim>
bool is_valid(const T* p) {
    bool valid = true;
    for (int d = 0; d < Dim; ++d) valid &= std::abs(p[d]) <= static_cast<T>(1e12);  // false for NaN
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

template <class T, int Dim>
void fit_leaf(const PointLeaf<T, Dim>& leaf, std::uint32_t count, PointNode<T, Dim>& node,
              std::uint32_t child) {
    std::uint32_t lowest = no_primitive;
    for (const std::uint32_t id : leaf.id) lowest = std::min(lowest, id);
    node.lowest_id[child] = lowest;
    node.points[child] = count;
    for (int d = 0; d < Dim; ++d) {
        const Interval<T> side = interval_of(leaf.at[d], points_per_leaf);
        node.lo[d][child] = side.lo;
        node.hi[d][child] = side.hi;
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

using Record = SortRecord<PointCode>;

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

/// Codes of a range in a grid of its own box: where all of them were equal, others may not be.
template <class T, int Dim>
void encode_again(const T* points, Record* records, Range range) {
    PointBounds<T, Dim> box = no_bounds<T, Dim>();
    std::vector<T> of_range(std::size_t{range.size()} * Dim);
    std::vector<std::uint32_t> order(range.size()), positions(range.size());
    for (std::uint32_t i = 0; i < range.size(); ++i) {
        positions[i] = records[range.begin + i].position;
        const T* p = points + std::size_t{positions[i]} * Dim;
        std::copy_n(p, Dim, &of_range[std::size_t{i} * Dim]);
        grow(box, p, p);
    }
    if (std::equal(box.lo, box.lo + Dim, box.hi)) return;
    const CurveGrid<T, Dim> grid(box.lo, box.hi);
    std::vector<PointCode> codes(range.size());
    grid.codes(of_range.data(), range.size(), codes.data());
    SortScratch<PointCode> scratch;
    sort_keys<PointCode>(codes, order, grid.bits, scratch);
    for (std::uint32_t i = 0; i < range.size(); ++i)
        records[range.begin + i] = {codes[i], positions[order[i]]};
}

/// Where a range is halved: at the highest bit in which its codes differ; in the middle if the
/// points are all at one place, or too close for any grid.
template <class T, int Dim>
std::uint32_t middle_of(const T* points, Record* records, Range range) {
    const auto differing = [&] { return records[range.begin].key ^ records[range.end - 1].key; };
    if (differing() == 0) encode_again<T, Dim>(points, records, range);
    if (differing() == 0) return range.begin + range.size() / 2;
    const PointCode bit = std::bit_floor(differing());
    return static_cast<std::uint32_t>(
        std::partition_point(records + range.begin, records + range.end,
                             [bit](const Record& r) { return (r.key & bit) == 0; }) -
        records);
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
    const CurveGrid<T, Dim> grid(bounds.lo, bounds.hi);
    const bool all_valid = bounds.left_out == 0;
    const auto load = [&](std::size_t begin, std::size_t end, PointCode* codes) {
        grid.codes(points + begin * Dim, end - begin, codes);
        if (all_valid) return;
        for (std::size_t i = begin; i < end; ++i)
            if (!is_valid<T, Dim>(points + i * Dim)) codes[i - begin] = left_out_key<PointCode>;
    };
    sort_on_the_way<PointCode>(
        n, all_valid ? grid.bits : 32, load, [](std::size_t, std::span<const Record>) {},
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
    // Points that no halving of space parts in so many levels are parted by their order.
    constexpr std::uint32_t last_divided = max_point_depth - 8;
    std::uint32_t level = 0;
    for (std::size_t begin = 0; begin < nodes.size(); ++level) {
        const std::size_t end = nodes.size();
        parts.assign(end - begin, {});
        for_each_range(end - begin, 16, [&](std::size_t first, std::size_t last) {
            for (std::size_t i = first; i < last; ++i) {
                const Range range = nodes[begin + i].range;
                if (range.size() <= points_per_bottom) continue;
                parts[i] = kdtree && level < last_divided
                               ? halved_parts<T, Dim>(points, records, range)
                               : equal_parts(range);
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
        PointRun<T, Dim> run;
        MedianSplitter<T, Dim> halver;
        for (std::size_t b = first; b < last; ++b) {
            const BottomRange bottom = bottoms[b];
            const std::uint32_t n = bottom.end - bottom.begin;
            const BottomRange next = bottoms[std::min(b + 1, last - 1)];
            for (std::uint32_t i = next.begin; i < next.end; ++i)
                __builtin_prefetch(points + std::size_t{records[i].position} * Dim);
            for (std::uint32_t i = 0; i < n; ++i) {
                const std::uint32_t id = records[bottom.begin + i].position;
                const T* p = points + std::size_t{id} * Dim;
                for (int d = 0; d < Dim; ++d) run.at[d][i] = p[d] + T{0};  // -0 becomes +0
                run.id[i] = id;
            }
            PointNode<T, Dim>& node = arrays.nodes[bottom.node];
            PointLeaf<T, Dim>* leaves = arrays.leaves.data() + node.below;
            if (kdtree) {
                halver.run(run, n, leaves);
            } else {
                for (std::uint32_t c = 0; c < node.children; ++c)
                    halver.write_leaf(run, c * points_per_leaf,
                                      std::min(n - c * points_per_leaf, points_per_leaf),
                                      leaves[c]);
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
