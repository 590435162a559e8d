// A ray in double -> the float ray that meets the boxes of its tree, widened by all that may be
// lost on the way: no box is missed that holds something the ray hits (docs/algorithms/double.md).
// Included once per instruction set.
#if defined(RAYDIX_ENGINE_BOX_FRAME_DOUBLE_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYDIX_ENGINE_BOX_FRAME_DOUBLE_H
#undef RAYDIX_ENGINE_BOX_FRAME_DOUBLE_H
#else
#define RAYDIX_ENGINE_BOX_FRAME_DOUBLE_H
#endif

#include <hwy/highway.h>

#include <cmath>

#include "engine/triangle_lines_double.h"
#include "engine/wide_tree_double.h"
#include "trace/simd/lanes_double.h"
#include "trace/simd/single_frame.h"

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

/// Where a ray in double is among the boxes of a tree.
struct BoxPlace {
    alignas(32) double origin[4];     // about the center, moved on to near the boxes
    alignas(32) double direction[4];  // of the boxes' space
    alignas(32) double far[4];        // from the ray's own origin to the far side of the bounds
    double farthest, longest;
    BoxDistances distances;
};

/// Rays from farther away than this, in sizes of the bounds, are not told from their roundings.
constexpr double farthest_place = 0x1p40;

/// `ray` and its frame. False: all boxes count as met. The fourth component of vectors has no
/// meaning.
HWY_INLINE bool find_place(const NodesD& tree, const RayD& ray, const RayFrameD& frame,
                           BoxPlace& out) {
    const auto scale = hn::Set(d4, tree.space.scale),
               along = hn::Set(d4, tree.space.scale * frame.t_scale);
    for (std::size_t l = 0; l < 4; l += lanes_d4) {
        const auto origin = hn::Mul(
            scale, hn::Sub(hn::LoadU(d4, &ray.origin.x + l), hn::Load(d4, tree.center + l)));
        hn::Store(origin, d4, out.origin + l);
        hn::Store(hn::Mul(along, hn::LoadU(d4, &ray.direction.x + l)), d4, out.direction + l);
        hn::Store(hn::Max(hn::Abs(hn::Sub(hn::Load(d4, tree.lo + l), origin)),
                          hn::Abs(hn::Sub(hn::Load(d4, tree.hi + l), origin))),
                  d4, out.far + l);
    }
    out.farthest = max_of(max_of(out.far[0], out.far[1]), out.far[2]);
    // NaN too.
    if (!(out.far[0] + out.far[1] + out.far[2] <= farthest_place * tree.size)) return false;
    out.distances = {};
    const int kz = frame.kz;
    double way = out.direction[kz];
    out.longest = std::fabs(way);
    if (!(out.longest > 0x1p-6 && out.longest < 0x1p3)) {
        // Subnormal once, or nearly.
        int exponent;
        std::frexp(out.longest, &exponent);
        for (double& d : out.direction) d = std::ldexp(d, -exponent);
        out.distances.rate = std::ldexp(1.0, exponent);
        way = out.direction[kz];
        out.longest = std::fabs(way);
    }
    const double ahead = way > 0 ? tree.lo[kz] - out.origin[kz] : out.origin[kz] - tree.hi[kz];
    if (ahead > 2 * tree.size) {
        out.distances.start = (ahead - tree.size) / out.longest;
        for (int a = 0; a < 3; ++a) out.origin[a] += out.distances.start * out.direction[a];
    }
    return true;
}

/// All boxes are met.
inline HWY_NOINLINE void fill_blind_frame(SingleFrame& out) {
    out = {};
    out.kind = ray_classes[0];
    constexpr float most = std::numeric_limits<float>::max();
    for (float& far : out.far) far = most;
    out.tmin = 0, out.tmax = most;
    out.t_scale = 1;
    out.careful = true;
}

/// The frame for boxes. `error`: what they hold may be missed by so much of the greatest distance
/// to the far side of the bounds. False if the ray ends before it comes to them.
HWY_INLINE bool fill_box_frame(const NodesD& tree, const RayD& ray, const RayFrameD& frame,
                               double error, SingleFrame& out, BoxDistances& distances) {
    BoxPlace place;
    if (!find_place(tree, ray, frame, place)) {
        distances = {0, -BoxDistances::most};
        fill_blind_frame(out);
        return true;
    }
    distances = place.distances;
    out.tmin = distances.below(frame.tmin);
    out.tmax = distances.above(frame.tmax);
    if (!(out.tmin <= out.tmax)) return false;
    const V4 origin = rounded(place.origin), way = rounded(place.direction);
    // What the test and the ways to the boxes lose, and what instances do.
    const double common = 0x1p-45 * place.far[frame.kz] + (1.0 + 0x1p-19) * error * place.farthest;
    alignas(32) double lost[4];
    for (std::size_t l = 0; l < 4; l += lanes_d4)
        hn::Store(hn::Add(hn::Mul(hn::Load(d4, place.far + l), hn::Set(d4, 0x1p-45)),
                          hn::Set(d4, common)),
                  d4, lost + l);
    const hn::RebindToSigned<F4> i4;
    const std::uint32_t negatives = bits_of(i4, hn::Lt(hn::BitCast(i4, way), hn::Zero(i4))) & 7;
    out.kind = ray_classes[negatives + 8 * static_cast<std::uint32_t>(frame.kz)];
    const V4 start = hn::Add(origin, hn::Zero(f4));  // -0 becomes +0
    const V4 inverse = limited(hn::Div(hn::Set(f4, 1.0f), way));
    const V4 pad = hn::Add(hn::Add(hn::Mul(hn::Abs(start), hn::Set(f4, 0x1p-21f)), rounded(lost)),
                           hn::Set(f4, 2 * least_slab_pad));
    const V4 near_pad = hn::CopySignToAbs(pad, hn::Neg(way));
    hn::Store(start, f4, out.origin);
    hn::Store(way, f4, out.direction);
    hn::Store(inverse, f4, out.inverse);
    hn::Store(near_pad, f4, out.near_pad);
    set_starts(tree.view, start, inverse, near_pad, out);
    out.t_scale = 1.0f;
    return true;
}

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
