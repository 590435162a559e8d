// Vectors of the 16 points of a group, or the 16 boxes of a node, for the instruction set being
// compiled. Included once per instruction set.
#if defined(RAYDIX_POINTS_LANES_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYDIX_POINTS_LANES_H
#undef RAYDIX_POINTS_LANES_H
#else
#define RAYDIX_POINTS_LANES_H
#endif

#include <hwy/highway.h>

#include <cstdint>
#include <cstring>

#include "base/compress_lanes.h"
#include "points/point_tree.h"

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

template <class T>
using Lanes = hn::CappedTag<T, 16>;
template <class T>
inline constexpr std::uint32_t lanes_of = static_cast<std::uint32_t>(hn::MaxLanes(Lanes<T>()));
/// Vectors that 16 values fill.
template <class T>
inline constexpr std::uint32_t parts_of = 16 / lanes_of<T>;

/// Bit l: lane l of the mask.
template <class D, class Mask>
HWY_INLINE std::uint32_t bits_of(D d, Mask mask) {
    std::uint8_t bytes[8] = {};
    hn::StoreMaskBits(d, mask, bytes);
    std::uint32_t bits;
    std::memcpy(&bits, bytes, sizeof(bits));
    return bits & ((1u << hn::MaxLanes(d)) - 1);
}

template <class D>
HWY_INLINE hn::Mask<D> mask_of(D d, std::uint32_t bits) {
    std::uint8_t bytes[8] = {};
    std::memcpy(bytes, &bits, sizeof(bits));
    return hn::LoadMaskBits(d, bytes);
}

/// body(part) for each vector of 16 values; unrolled by the compiler.
template <class T, class Body>
HWY_INLINE std::uint32_t each_part(const Body& body) {
    std::uint32_t bits = 0;
    for (std::uint32_t part = 0; part < parts_of<T>; ++part)
        bits |= body(part * lanes_of<T>) << part * lanes_of<T>;
    return bits;
}

/// A query in registers.
template <class T, int Dim>
struct QueryLanes {
    hn::Vec<Lanes<T>> at[Dim];

    explicit HWY_INLINE QueryLanes(const T* query) {
        for (int d = 0; d < Dim; ++d) at[d] = hn::Set(Lanes<T>(), query[d]);
    }
};

/// (x*x + y*y) + z*z, or x*x + y*y
template <int Dim, class V>
HWY_INLINE V sum_of_squares(const V* v) {
    const V xy = hn::Add(hn::Mul(v[0], v[0]), hn::Mul(v[1], v[1]));
    if constexpr (Dim == 3) return hn::Add(xy, hn::Mul(v[2], v[2]));
    return xy;
}

/// d2 of points [from, from + lanes) of a group.
template <class T, int Dim>
HWY_INLINE auto squared_distances(const PointLeaf<T, Dim>& leaf, const QueryLanes<T, Dim>& query,
                                  std::uint32_t from) {
    hn::Vec<Lanes<T>> off[Dim];
    for (int d = 0; d < Dim; ++d)
        off[d] = hn::Sub(hn::Load(Lanes<T>(), leaf.at[d] + from), query.at[d]);
    return sum_of_squares<Dim>(off);
}

/// A lower bound of d2 for all points in boxes [from, from + lanes): each coordinate's distance is
/// no more than a point's after rounding, and squares and sums are monotone.
template <class T, int Dim>
HWY_INLINE auto least_squared_distances(const PointNode<T, Dim>& node,
                                        const QueryLanes<T, Dim>& query, std::uint32_t from) {
    constexpr Lanes<T> d_t;
    hn::Vec<Lanes<T>> off[Dim];
    for (int d = 0; d < Dim; ++d) {
        const auto below = hn::Sub(hn::Load(d_t, node.lo[d] + from), query.at[d]);
        const auto above = hn::Sub(query.at[d], hn::Load(d_t, node.hi[d] + from));
        off[d] = hn::Max(hn::Max(below, above), hn::Zero(d_t));
    }
    return sum_of_squares<Dim>(off);
}

/// An upper bound of the same.
template <class T, int Dim>
HWY_INLINE auto greatest_squared_distances(const PointNode<T, Dim>& node,
                                           const QueryLanes<T, Dim>& query, std::uint32_t from) {
    constexpr Lanes<T> d_t;
    hn::Vec<Lanes<T>> off[Dim];
    for (int d = 0; d < Dim; ++d)
        off[d] = hn::Max(hn::Sub(query.at[d], hn::Load(d_t, node.lo[d] + from)),
                         hn::Sub(hn::Load(d_t, node.hi[d] + from), query.at[d]));
    return sum_of_squares<Dim>(off);
}

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
