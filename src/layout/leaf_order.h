// Copies primitives into leaf order, so that a leaf is one run of memory. order [n] + primitives ->
// copies [n].
#pragma once

#include <raydix/bvh.h>

#include <cstdint>

#include "base/prefetch.h"
#include "exec/parallel.h"
#include "primitives/host_box.h"

namespace raydix {

inline LeafTriangle copy_primitive(const TriangleSource& source, std::uint32_t i) {
    LeafTriangle copy;
    load_corner(source, i, 0).store(copy.v0);
    load_corner(source, i, 1).store(copy.v1);
    load_corner(source, i, 2).store(copy.v2);
    return copy;
}
inline Aabb copy_primitive(const BoxSource& source, std::uint32_t i) {
    Aabb box;
    source.box(i, box);
    return box;
}
inline Vec3 copy_primitive(const PointSource& source, std::uint32_t i) {
    return without_negative_zero(source.points[i]);
}

/// The box of a copy.
inline Box3 copy_box(const LeafTriangle& t) {
    const Float3 a = Float3::load(t.v0), b = Float3::load(t.v1), c = Float3::load(t.v2);
    return {min_of(min_of(a, b), c), max_of(max_of(a, b), c)};
}
inline Box3 copy_box(const Aabb& box) { return Box3::load(box); }
inline Box3 copy_box(Vec3 p) { return Box3::load(p, p); }

/// Asks for what copying triangle i will read, in two steps: the indices, then the vertices.
RAYDIX_PREFETCHING void prefetch_indices(const TriangleSource& source, std::uint32_t i) {
    __builtin_prefetch(&source.triangles[i]);
}
RAYDIX_PREFETCHING void prefetch_corners(const TriangleSource& source, std::uint32_t i) {
    for (const std::uint32_t vertex : source.triangles[i])
        __builtin_prefetch(&source.vertices[vertex]);
}
template <class Source>
void prefetch_indices(const Source&, std::uint32_t) {}
template <class Source>
void prefetch_corners(const Source&, std::uint32_t) {}

/// Position in leaf order -> its copy, and the copy's box. Positions are asked for in ascending
/// order: what the next ones read is fetched ahead.
template <class Source, class Copy>
struct CopyWithBox {
    static constexpr std::size_t indices_ahead = 32, corners_ahead = 16;
    const Source& source;
    std::span<const std::uint32_t> order;
    Copy* copies;  // [order]

    Box3 operator()(std::size_t k) const {
        if (k + indices_ahead < order.size()) {
            prefetch_indices(source, order[k + indices_ahead]);
            prefetch_corners(source, order[k + corners_ahead]);
        }
        copies[k] = copy_primitive(source, order[k]);
        return copy_box(copies[k]);
    }
};

template <class Source, class Copy>
void copy_to_leaf_order(const Source& source, std::span<const std::uint32_t> order,
                        Buffer<Copy>& copies) {
    copies.reset(order.size());
    const CopyWithBox<Source, Copy> copy{source, order, copies.data()};
    for_each_range(order.size(), 4096, [&](std::size_t begin, std::size_t end) {
        for (std::size_t k = begin; k < end; ++k) copy(k);
    });
}

/// Box of the primitives [first, first + count) in leaf order.
template <class Copy>
struct LeafBoxOf {
    const Copy* copies;
    Aabb operator()(std::uint32_t first, std::uint32_t count) const {
        Box3 box = copy_box(copies[first]);
        for (std::uint32_t k = first + 1; k < first + count; ++k)
            box = unite(box, copy_box(copies[k]));
        return box.box();
    }
};

}  // namespace raydix
