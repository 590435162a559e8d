// Copies primitives into leaf order, so that a leaf is one run of memory. order [n] + primitives ->
// copies [n].
#pragma once

#include <raydix/bvh.h>

#include <cstdint>

#include "exec/parallel.h"
#include "primitives/sources.h"

namespace raydix {

inline LeafTriangle copy_primitive(const TriangleSource& source, std::uint32_t i) {
    return {source.corner(i, 0), source.corner(i, 1), source.corner(i, 2)};
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
RAYDIX_HD inline Aabb copy_box(const LeafTriangle& t) { return box_of(t.v0, t.v1, t.v2); }
RAYDIX_HD inline Aabb copy_box(const Aabb& box) { return box; }
RAYDIX_HD inline Aabb copy_box(Vec3 p) { return {p, p}; }

template <class Source, class Copy>
void copy_to_leaf_order(const Source& source, std::span<const std::uint32_t> order,
                        Buffer<Copy>& copies) {
    copies.reset(order.size());
    for_each_index(order.size(),
                   [&](std::size_t k) { copies[k] = copy_primitive(source, order[k]); });
}

/// Box of the primitives [first, first + count) in leaf order.
template <class Copy>
struct LeafBoxOf {
    const Copy* copies;
    RAYDIX_HD Aabb operator()(std::uint32_t first, std::uint32_t count) const {
        Aabb box = copy_box(copies[first]);
        for (std::uint32_t k = first + 1; k < first + count; ++k)
            box = unite(box, copy_box(copies[k]));
        return box;
    }
};

}  // namespace raydix
