// Copies of primitives in leaf order and their boxes, for host and device: the bits of
// leaf_order.h, which is the host's own faster way. order [n] + primitives -> copies [n], as one
// launch for any backend.
#pragma once

#include <raydix/bvh.h>

#include <cstdint>

#include "base/hd.h"
#include "base/math.h"
#include "exec/warp.h"
#include "primitives/sources.h"

namespace raydix {

// Word w of the copy of primitive i: a coordinate without -0.
RAYDIX_HD inline float copied_word(const TriangleSource& source, std::uint32_t i, std::uint32_t w) {
    const std::size_t vertex = source.triangles[i][w / 3];
    return reinterpret_cast<const float*>(source.vertices)[3 * vertex + w % 3] + 0.0f;
}
RAYDIX_HD inline float copied_word(const BoxSource& source, std::uint32_t i, std::uint32_t w) {
    return reinterpret_cast<const float*>(source.boxes)[6 * std::size_t{i} + w] + 0.0f;
}
RAYDIX_HD inline float copied_word(const PointSource& source, std::uint32_t i, std::uint32_t w) {
    return reinterpret_cast<const float*>(source.points)[3 * std::size_t{i} + w] + 0.0f;
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

/// A warp copies 32 primitives, and each lane words that lie 32 apart: what lanes write together is
/// one piece of memory.
template <class Source, class Copy>
struct CopyToLeafOrder {
    static constexpr std::uint32_t words = sizeof(Copy) / sizeof(float);

    Source source;
    const std::uint32_t* order;  // [*count]
    const std::uint32_t* count;
    Copy* copies;  // [*count], out

    template <class Warp>
    RAYDIX_HD void operator()(const Warp& warp, std::uint32_t w) const {
        const std::uint32_t begin = w * warp_lanes, left = *count - begin;
        const std::uint32_t have = words * (left < warp_lanes ? left : warp_lanes);
        auto* out = reinterpret_cast<float*>(copies) + std::size_t{begin} * words;
        // All are read before the first is written: then the device waits for them once.
        typename Warp::template Var<float> values[words];
        for (std::uint32_t k = 0; k < words; ++k)
            warp.each([&](std::uint32_t lane) {
                const std::uint32_t at = k * warp_lanes + lane;
                if (at < have)
                    values[k][lane] = copied_word(source, order[begin + at / words], at % words);
            });
        for (std::uint32_t k = 0; k < words; ++k)
            warp.each([&](std::uint32_t lane) {
                const std::uint32_t at = k * warp_lanes + lane;
                if (at < have) out[at] = values[k][lane];
            });
    }
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
    launcher.launch_warps("layout.copies", count, limit,
                          CopyToLeafOrder<Source, Copy>{source, order, count, copies});
}

}  // namespace raydix
