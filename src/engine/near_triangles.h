// The points of four triangles that are closest to a query: closest_on_triangle for each lane of a
// block, bit for bit. Triangles of instances, moved to the world. Included once per instruction
// set.
#if defined(RAYDIX_ENGINE_NEAR_TRIANGLES_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYDIX_ENGINE_NEAR_TRIANGLES_H
#undef RAYDIX_ENGINE_NEAR_TRIANGLES_H
#else
#define RAYDIX_ENGINE_NEAR_TRIANGLES_H
#endif

#include <hwy/highway.h>

#include <bit>

#include "engine/near_job.h"
#include "proximity/closest_on_triangle.h"
#include "trace/simd/lanes.h"

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

/// The triangles of a block, in double: all four, or two at a time.
using TriangleDoubles = hn::CappedTag<double, block_lanes>;
using TriangleFloats = hn::Rebind<float, TriangleDoubles>;
constexpr TriangleDoubles doubles;
constexpr TriangleFloats floats;
constexpr std::size_t double_lanes = hn::MaxLanes(doubles);
using V4 = hn::Vec<F4>;
using VD = hn::Vec<TriangleDoubles>;
using VF = hn::Vec<TriangleFloats>;
using MD = hn::Mask<TriangleDoubles>;

/// One point a lane. Sums and products are those of double3.h.
struct Doubles3 {
    VD x, y, z;
};
HWY_INLINE Doubles3 operator+(const Doubles3& a, const Doubles3& b) {
    return {hn::Add(a.x, b.x), hn::Add(a.y, b.y), hn::Add(a.z, b.z)};
}
HWY_INLINE Doubles3 operator-(const Doubles3& a, const Doubles3& b) {
    return {hn::Sub(a.x, b.x), hn::Sub(a.y, b.y), hn::Sub(a.z, b.z)};
}
HWY_INLINE Doubles3 operator*(const Doubles3& a, VD s) {
    return {hn::Mul(a.x, s), hn::Mul(a.y, s), hn::Mul(a.z, s)};
}
HWY_INLINE VD dot(const Doubles3& a, const Doubles3& b) {
    return hn::Add(hn::Add(hn::Mul(a.x, b.x), hn::Mul(a.y, b.y)), hn::Mul(a.z, b.z));
}
HWY_INLINE Doubles3 cross(const Doubles3& a, const Doubles3& b) {
    return {hn::Sub(hn::Mul(a.y, b.z), hn::Mul(a.z, b.y)),
            hn::Sub(hn::Mul(a.z, b.x), hn::Mul(a.x, b.z)),
            hn::Sub(hn::Mul(a.x, b.y), hn::Mul(a.y, b.x))};
}
HWY_INLINE Doubles3 choose(MD mask, const Doubles3& yes, const Doubles3& no) {
    return {hn::IfThenElse(mask, yes.x, no.x), hn::IfThenElse(mask, yes.y, no.y),
            hn::IfThenElse(mask, yes.z, no.z)};
}

HWY_INLINE Doubles3 corner_of(const TriangleBlock& block, int corner, std::size_t lane) {
    const auto axis = [&](int k) {
        return hn::PromoteTo(doubles, hn::Load(floats, block.corner[3 * corner + k] + lane));
    };
    return {axis(0), axis(1), axis(2)};
}

/// As closest_on_segment.
HWY_INLINE Doubles3 closest_on_segments(const Doubles3& a, const Doubles3& b, const Doubles3& query,
                                        VD& s) {
    const MD swapped =
        hn::Or(hn::Lt(b.x, a.x),
               hn::And(hn::Eq(b.x, a.x),
                       hn::Or(hn::Lt(b.y, a.y), hn::And(hn::Eq(b.y, a.y), hn::Lt(b.z, a.z)))));
    const Doubles3 from = choose(swapped, b, a), to = choose(swapped, a, b);
    const Doubles3 along = to - from;
    const VD length2 = dot(along, along), reach = dot(query - from, along);
    const VD zero = hn::Zero(doubles), one = hn::Set(doubles, 1.0);
    const VD inner = hn::IfThenElse(hn::Lt(reach, length2), hn::Div(reach, length2), one);
    const VD t = hn::IfThenElse(hn::Gt(reach, zero), inner, zero);
    s = hn::IfThenElse(swapped, hn::Sub(one, t), t);
    // At t = 0 the sum is `from` as it is: corners have no -0.
    return choose(hn::Eq(t, one), to, from + along * t);
}

struct Candidates {
    Doubles3 position;
    VD u, v, d2;
};
/// As offer.
HWY_INLINE void offer_each(Candidates& best, const Doubles3& position, VD u, VD v,
                           const Doubles3& query) {
    const Doubles3 off = position - query;
    const VD d2 = dot(off, off);
    const MD closer = hn::Lt(d2, best.d2);
    best = {choose(closer, position, best.position), hn::IfThenElse(closer, u, best.u),
            hn::IfThenElse(closer, v, best.v), hn::IfThenElse(closer, d2, best.d2)};
}
/// As closest_on_outline.
HWY_INLINE Candidates closest_on_outlines(const Doubles3& a, const Doubles3& b, const Doubles3& c,
                                          const Doubles3& query) {
    const VD zero = hn::Zero(doubles), one = hn::Set(doubles, 1.0);
    VD s;
    const Doubles3 on_ab = closest_on_segments(a, b, query, s);
    const Doubles3 off = on_ab - query;
    Candidates best{on_ab, s, zero, dot(off, off)};
    const Doubles3 on_bc = closest_on_segments(b, c, query, s);
    offer_each(best, on_bc, hn::Sub(one, s), s, query);
    const Doubles3 on_ca = closest_on_segments(c, a, query, s);
    offer_each(best, on_ca, zero, hn::Sub(one, s), query);
    return best;
}

/// As closest_candidate, in the lanes of `wanted`.
HWY_INLINE Candidates closest_candidates(const TriangleBlock& block, std::size_t lane,
                                         std::uint32_t wanted, const Doubles3& query) {
    const Doubles3 a = corner_of(block, 0, lane), b = corner_of(block, 1, lane),
                   c = corner_of(block, 2, lane);
    const Doubles3 ab = b - a, ac = c - a;
    const Doubles3 normal = cross(ab, ac);
    const VD zero = hn::Zero(doubles);
    const MD wide =
        hn::Gt(dot(normal, normal),
               hn::Mul(hn::Mul(hn::Set(doubles, outline_only), dot(ab, ab)), dot(ac, ac)));
    const Doubles3 bc = c - b;
    const VD u = dot(cross(query - a, ac), normal), v = dot(cross(ab, query - a), normal),
             w = dot(cross(bc, query - b), normal);
    const VD sum = hn::Add(hn::Add(u, v), w);
    const MD inside = hn::And(hn::And(wide, hn::Gt(sum, zero)),
                              hn::And(hn::Ge(u, zero), hn::And(hn::Ge(v, zero), hn::Ge(w, zero))));
    const std::uint32_t feet = bits_of(doubles, inside) & wanted;
    if (feet == 0) return closest_on_outlines(a, b, c, query);
    const VD weight_b = hn::Div(u, sum), weight_c = hn::Div(v, sum);
    const Candidates foot{(a + ab * weight_b) + ac * weight_c, weight_b, weight_c, zero};
    if (feet == wanted) return foot;
    const Candidates outline = closest_on_outlines(a, b, c, query);
    return {choose(inside, foot.position, outline.position),
            hn::IfThenElse(inside, foot.u, outline.u), hn::IfThenElse(inside, foot.v, outline.v),
            zero};
}

/// TrianglePoint, one a lane of a block.
struct NearPoints {
    alignas(16) float x[block_lanes], y[block_lanes], z[block_lanes];
    alignas(16) float u[block_lanes], v[block_lanes], d2[block_lanes];
};

/// Square of a distance by components, as squared_distance has it.
template <class D>
HWY_INLINE hn::Vec<D> square_of(D, hn::Vec<D> x, hn::Vec<D> y, hn::Vec<D> z) {
    return hn::Add(hn::Add(hn::Mul(x, x), hn::Mul(y, y)), hn::Mul(z, z));
}

/// What is on the far side of a plane cannot be closer than what is known: no x with
/// normal . (query - x) above limit + 2^-20 |query - x|_1 matters. At first all does.
struct Tangent {
    Vec3 normal{};
    float limit = infinity;

    Tangent() = default;
    /// Of the sphere around the query through the closest point so far. Its normal is of unit
    /// length up to 2^-21; points are rounded by less than 2^-23 of their coordinates, those of the
    /// query and of the way to it. Squares that may have lost digits at the ends of their range
    /// give none.
    Tangent(Vec3 query, Vec3 closest, float d2) {
        if (!(d2 > 0x1p-100f && d2 < 0x1p100f)) return;
        const float distance = std::sqrt(d2);
        normal = (1.0f / distance) * (query - closest);
        const float most =
            max_of(max_of(std::fabs(query.x), std::fabs(query.y)), std::fabs(query.z));
        limit = distance * (1.0f + 0x1p-19f) + most * 0x1p-21f;
    }
};

/// Those of `lanes` that may be within reach: squared_distance_to_box <= reach for their own boxes,
/// and a corner on the near side of the plane.
HWY_INLINE std::uint32_t may_be_within(const TriangleBlock& block, std::uint32_t lanes, Vec3 query,
                                       float reach, const Tangent& tangent) {
    V4 off[3], depth[3], far = hn::Zero(f4);
    const float q[3] = {query.x, query.y, query.z},
                n[3] = {tangent.normal.x, tangent.normal.y, tangent.normal.z};
    for (V4& d : depth) d = hn::Zero(f4);
    for (int axis = 0; axis < 3; ++axis) {
        const V4 at = hn::Set(f4, q[axis]), normal = hn::Set(f4, n[axis]);
        const V4 a = hn::Sub(at, hn::Load(f4, block.corner[axis])),
                 b = hn::Sub(at, hn::Load(f4, block.corner[3 + axis])),
                 c = hn::Sub(at, hn::Load(f4, block.corner[6 + axis]));
        // Rounding is monotone and has no sides: the ends of these are those of the box.
        const V4 above = hn::Min(hn::Min(a, b), c), below = hn::Neg(hn::Max(hn::Max(a, b), c));
        off[axis] = hn::Max(hn::Max(below, above), hn::Zero(f4));
        far = hn::Add(far, hn::Max(hn::Abs(below), hn::Abs(above)));
        depth[0] = hn::MulAdd(a, normal, depth[0]);
        depth[1] = hn::MulAdd(b, normal, depth[1]);
        depth[2] = hn::MulAdd(c, normal, depth[2]);
    }
    const V4 square = square_of(f4, off[0], off[1], off[2]);
    const V4 least = hn::Min(hn::Min(depth[0], depth[1]), depth[2]);
    const V4 limit = hn::MulAdd(far, hn::Set(f4, 0x1p-20f), hn::Set(f4, tangent.limit));
    return lanes & bits_of(f4, hn::And(hn::Le(square, hn::Set(f4, reach)), hn::Le(least, limit)));
}

/// Fills the lanes of `lanes` that are within reach: returns those.
HWY_INLINE std::uint32_t points_within(const TriangleBlock& block, std::uint32_t lanes, Vec3 query,
                                       float reach, const Tangent& tangent, NearPoints& out) {
    lanes = may_be_within(block, lanes, query, reach, tangent);
    std::uint32_t within = 0;
    const Doubles3 at{hn::Set(doubles, double{query.x}), hn::Set(doubles, double{query.y}),
                      hn::Set(doubles, double{query.z})};
    for (std::size_t l = 0; l < block_lanes; l += double_lanes) {
        const std::uint32_t wanted = lanes >> l & ((1u << double_lanes) - 1);
        if (wanted == 0) continue;
        const Candidates best = closest_candidates(block, l, wanted, at);
        const VF zero = hn::Zero(floats);
        const auto round = [&](VD exact, int axis) {
            const VF a = hn::Load(floats, block.corner[axis] + l),
                     b = hn::Load(floats, block.corner[3 + axis] + l),
                     c = hn::Load(floats, block.corner[6 + axis] + l);
            const VF p = hn::Max(hn::DemoteTo(floats, exact), hn::Min(hn::Min(a, b), c));
            return hn::Add(hn::Min(p, hn::Max(hn::Max(a, b), c)), zero);
        };
        const VF x = round(best.position.x, 0), y = round(best.position.y, 1),
                 z = round(best.position.z, 2);
        const VF d2 =
            square_of(floats, hn::Sub(x, hn::Set(floats, query.x)),
                      hn::Sub(y, hn::Set(floats, query.y)), hn::Sub(z, hn::Set(floats, query.z)));
        hn::Store(x, floats, out.x + l);
        hn::Store(y, floats, out.y + l);
        hn::Store(z, floats, out.z + l);
        hn::Store(hn::DemoteTo(floats, best.u), floats, out.u + l);
        hn::Store(hn::DemoteTo(floats, best.v), floats, out.v + l);
        hn::Store(d2, floats, out.d2 + l);
        within |= (wanted & bits_of(floats, hn::Le(d2, hn::Set(floats, reach)))) << l;
    }
    return within;
}

/// The triangles of a block as they are in the world: moved by each map in turn, in double, and
/// rounded once. Where the maps mirror, two corners change places, as in a flattened mesh. Returns
/// those of `lanes` that it would hold.
HWY_NOINLINE std::uint32_t move_triangles(const TriangleBlock& block, std::uint32_t lanes,
                                          const NearSpace& space, TriangleBlock& out) {
    for (std::size_t l = 0; l < block_lanes; l += double_lanes)
        for (int corner = 0; corner < 3; ++corner) {
            const int place = corner == 0 || !space.way->mirrors ? corner : 3 - corner;
            Doubles3 p = corner_of(block, corner, l);
            for (const NearSpace* at = &space; at != nullptr; at = at->outer)
                for (std::uint32_t k = 0; k < at->count; ++k) {
                    const Affine& map = at->maps[k];
                    const auto row = [&](const Double3& r, double move) {
                        const Doubles3 by{hn::Set(doubles, r.x), hn::Set(doubles, r.y),
                                          hn::Set(doubles, r.z)};
                        return hn::Add(dot(by, p), hn::Set(doubles, move));
                    };
                    p = {row(map.x, map.move.x), row(map.y, map.move.y), row(map.z, map.move.z)};
                }
            const auto store = [&](VD x, int axis) {
                const VF rounded = hn::Add(hn::DemoteTo(floats, x), hn::Zero(floats));
                hn::Store(rounded, floats, out.corner[3 * place + axis] + l);
            };
            store(p.x, 0), store(p.y, 1), store(p.z, 2);
        }
    std::copy_n(block.prim, block_lanes, out.prim);
    V4 largest = hn::Zero(f4), longest = hn::Zero(f4);
    for (int axis = 0; axis < 3; ++axis) {
        const V4 a = hn::Load(f4, out.corner[axis]), b = hn::Load(f4, out.corner[3 + axis]),
                 c = hn::Load(f4, out.corner[6 + axis]);
        const V4 lo = hn::Min(hn::Min(a, b), c), hi = hn::Max(hn::Max(a, b), c);
        largest = hn::Max(largest, hn::Max(hn::Abs(lo), hn::Abs(hi)));
        longest = hn::Max(longest, hn::Sub(hi, lo));
    }
    lanes &= bits_of(f4, hn::Le(largest, hn::Set(f4, max_coordinate)));
    const auto tiny =
        hn::And(hn::Gt(longest, hn::Zero(f4)), hn::Lt(longest, hn::Set(f4, min_diagonal)));
    for (std::uint32_t left = lanes & bits_of(f4, tiny); left != 0; left &= left - 1) {
        const auto lane = static_cast<std::uint32_t>(std::countr_zero(left));
        const LeafTriangle t = triangle_of(out, lane);
        if (!diagonal_in_range(box_of(t.v0, t.v1, t.v2))) lanes &= ~(1u << lane);
    }
    return lanes;
}

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
