// Copies of primitives in leaf order and their boxes, for host and device: the bits of
// leaf_order.h, which is the host's own faster way. order [n] + primitives -> copies [n], as one
// launch for any backend.
#pragma once

#include <raydix/bvh.h>

#include <cstdint>

#include "base/hd.h"
#include "base/math.h"
#include "primitives/sources.h"

namespace raydix {

RAYDIX_HD inline LeafTriangle leaf_copy(const TriangleSource& source, std::uint32_t i) {
    return {source.corner(i, 0), source.corner(i, 1), source.corner(i, 2)};
}
RAYDIX_HD inline Aabb leaf_copy(const BoxSource& source, std::uint32_t i) {
    Aabb box;
    source.box(i, box);
    return box;
}
RAYDIX_HD inline Vec3 leaf_copy(const PointSource& source, std::uint32_t i) {
    return without_negative_zero(source.points[i]);
}

RAYDIX_HD inline Aabb box_of_copy(const LeafTriangle& t) { return box_of(t.v0, t.v1, t.v2); }
RAYDIX_HD inline Aabb box_of_copy(const Aabb& box) { return box; }
RAYDIX_HD inline Aabb box_of_copy(Vec3 p) { return {p, p}; }

/// Box of the primitives [first, first + count) in leaf order; count > 0.
template <class Copy>
struct BoxOfLeaf {
    const Copy* copies;
    RAYDIX_HD Aabb operator()(std::uint32_t first, std::uint32_t count) const {
        Aabb box = box_of_copy(copies[first]);
        for (std::uint32_t k = first + 1; k < first + count; ++k)
            box = unite(box, box_of_copy(copies[k]));
        return box;
    }
};

template <class Source, class Copy>
struct CopyToLeafOrder {
    Source source;
    const std::uint32_t* order;
    Copy* copies;
    RAYDIX_HD void operator()(std::uint32_t k) const { copies[k] = leaf_copy(source, order[k]); }
};

/// Boxes of primitives in an order.
template <class Source>
struct BoxInOrder {
    Source source;
    const std::uint32_t* order;
    Aabb* boxes;
    RAYDIX_HD void operator()(std::uint32_t k) const { source.box(order[k], boxes[k]); }
};

/// Centres of their boxes in an order.
template <class Source>
struct CenterInOrder {
    Source source;
    const std::uint32_t* order;
    Vec3* centers;
    RAYDIX_HD void operator()(std::uint32_t k) const {
        Aabb box;
        source.box(order[k], box);
        centers[k] = center_of(box);
    }
};

/// The first *count of `limit` places; what is left out stands behind them.
template <class Launcher, class Source, class Copy>
void launch_copies(Launcher& launcher, const Source& source, const std::uint32_t* count,
                   std::uint32_t limit, const std::uint32_t* order, Copy* copies) {
    launcher.launch_counted("layout.copies", count, limit,
                            CopyToLeafOrder<Source, Copy>{source, order, copies});
}

}  // namespace raydix
