// What boxes and triangles need of one ray: a Ray -> SingleFrame, a few vector operations for
// usual rays. Included once per instruction set.
#if defined(RAYDIX_SIMD_SINGLE_FRAME_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYDIX_SIMD_SINGLE_FRAME_H
#undef RAYDIX_SIMD_SINGLE_FRAME_H
#else
#define RAYDIX_SIMD_SINGLE_FRAME_H
#endif

#include <hwy/highway.h>

#include <bit>
#include <limits>

#include "base/plain_scale.h"
#include "trace/simd/lanes.h"
#include "trace/simd/ray_classes.h"
#include "trace/simd/stream_rays.h"
#include "trace/simd/wide_ray.h"

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

/// By axis; what a fourth float holds has no meaning. Fours of floats first, which single_frames.h
/// writes as such.
struct SingleFrame {
    alignas(16) float origin[4];
    alignas(16) float direction[4];     // scaled
    alignas(16) float inverse[4];       // limited
    alignas(16) float near_pad[4];      // with the sign that moves near planes toward the start
    alignas(16) float near[4], far[4];  // starts of planes about the tree's middle
    alignas(16) float shear[2];         // of x and y
    float tmin, tmax;
    RayClass kind;
    float t_scale;
    bool careful;  // planes of plain nodes may overflow

    /// For the triangle test of one triangle.
    [[nodiscard]] TriangleRay triangle_ray() const {
        return triangle_ray_of(kind, {origin[0], origin[1], origin[2]},
                               {direction[0], direction[1], direction[2]}, shear[0], shear[1],
                               tmin);
    }
};

using V4 = hn::Vec<F4>;

/// Where planes start; the rest of the frame is there.
HWY_INLINE void set_starts(const WideView& tree, V4 origin, V4 inverse, V4 near_pad,
                           SingleFrame& out) {
    const V4 from = hn::Sub(hn::Load(f4, tree.middle), origin);
    const V4 near = hn::Mul(hn::Add(from, near_pad), inverse),
             far = hn::Mul(hn::Sub(from, near_pad), inverse);
    hn::Store(near, f4, out.near);
    hn::Store(far, f4, out.far);
    const V4 most = hn::Set(f4, std::numeric_limits<float>::max());
    out.careful = tree.local_pads ||
                  (bits_of(f4, hn::Le(hn::Add(hn::Abs(near), hn::Abs(far)), most)) & 7) != 7;
}

/// Where planes of one node start that widen by what the node's triangles are away from the ray's
/// start and from the tree's middle, not by all of the tree (docs/algorithms/wide.md).
inline HWY_NOINLINE void set_local_starts(const WideView& tree, const WideNode& node,
                                          const SingleFrame& ray, float* near, float* far) {
    constexpr float rate = wide_pad_factor * slab_pad;
    float from[3], share[3];  // of the pads; rays may start so far off that sums overflow
    for (std::size_t axis = 0; axis < 3; ++axis) {
        auto lo = hn::Load(f8, node.lo[axis]), hi = hn::Load(f8, node.hi[axis]);
        for (std::size_t l = lanes8; l < 8; l += lanes8) {
            lo = hn::Min(lo, hn::Load(f8, node.lo[axis] + l));
            hi = hn::Max(hi, hn::Load(f8, node.hi[axis] + l));
        }
        from[axis] = tree.middle[axis] - ray.origin[axis];
        const float first = hn::GetLane(hn::MinOfLanes(f8, lo)) + from[axis],
                    last = hn::GetLane(hn::MaxOfLanes(f8, hi)) + from[axis];
        share[axis] =
            rate * max_of(std::fabs(first), std::fabs(last)) + rate * std::fabs(from[axis]);
    }
    const float along = share[ray.kind.kz] + least_slab_pad;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const float pad = std::copysign(share[axis] + along, ray.near_pad[axis]);
        near[axis] = (from[axis] + pad) * ray.inverse[axis];
        far[axis] = (from[axis] - pad) * ray.inverse[axis];
    }
}

/// How far boxes widen for one ray (slab.h), with sign. `way` has the signs of the direction.
HWY_INLINE V4 pad_of(const WideView& tree, V4 origin, V4 way, std::uint32_t kz) {
    const V4 reach = hn::Max(hn::Abs(hn::Sub(hn::Load(f4, tree.lo), origin)),
                             hn::Abs(hn::Sub(hn::Load(f4, tree.hi), origin)));
    alignas(16) float far[4];
    hn::Store(reach, f4, far);
    const V4 pad = hn::Add(
        hn::Mul(hn::Set(f4, wide_pad_factor * slab_pad), hn::Add(reach, hn::Set(f4, far[kz]))),
        hn::Set(f4, least_slab_pad));
    return hn::CopySignToAbs(pad, hn::Neg(way));
}

HWY_INLINE V4 limited(V4 inverse) {
    const V4 limit = hn::Set(f4, wide_longest_inverse);
    return hn::Max(hn::Min(inverse, limit), hn::Neg(limit));
}

/// Any valid ray.
inline HWY_NOINLINE void fill_odd_frame(const WideView& tree, const Ray& ray, SingleFrame& out) {
    const RayFrame frame = make_frame(ray);
    const Vec3 o = frame.origin, d = frame.direction, i = frame.inverse;
    const auto quad = [](float x, float y, float z, float* to) {
        to[0] = x, to[1] = y, to[2] = z, to[3] = 0.0f;
    };
    quad(o.x, o.y, o.z, out.origin);
    quad(d.x, d.y, d.z, out.direction);
    quad(i.x, i.y, i.z, out.inverse);
    out.shear[0] = frame.shear_x, out.shear[1] = frame.shear_y;
    const V4 origin = hn::Load(f4, out.origin), whole = hn::Load(f4, out.inverse);
    const auto negatives = static_cast<std::uint32_t>(std::signbit(i.x)) |
                           static_cast<std::uint32_t>(std::signbit(i.y)) << 1 |
                           static_cast<std::uint32_t>(std::signbit(i.z)) << 2;
    out.kind = ray_classes[negatives + 8 * static_cast<std::uint32_t>(frame.kz)];
    const V4 inverse = limited(whole), pad = pad_of(tree, origin, whole, out.kind.kz);
    hn::Store(inverse, f4, out.inverse);
    hn::Store(pad, f4, out.near_pad);
    set_starts(tree, origin, inverse, pad, out);
    out.tmin = frame.tmin, out.tmax = frame.tmax, out.t_scale = frame.t_scale;
}

/// Three floats that the caller may have written a moment ago, one by one: loaded as a vector they
/// would have to wait until all of them are in the cache.
HWY_INLINE V4 load_axes(const float* from) {
#if HWY_ARCH_X86
    return V4{_mm_movelh_ps(_mm_unpacklo_ps(_mm_load_ss(from), _mm_load_ss(from + 1)),
                            _mm_load_ss(from + 2))};
#else
    return hn::LoadU(f4, from);
#endif
}

/// A valid ray whose direction is near unit length; `components`: the direction once more, and the
/// longest of them, without sign.
HWY_INLINE void fill_usual_frame(const WideView& tree, V4 place, V4 way, const float* components,
                                 float longest, float tmin, float tmax, SingleFrame& out) {
    const hn::RebindToSigned<F4> i4;
    const std::uint32_t negatives = bits_of(i4, hn::Lt(hn::BitCast(i4, way), hn::Zero(i4))) & 7;
    // The last of the longest axes, without a jump: rays that go anywhere could not be foreseen.
    const V4 sizes = hn::Abs(way);
    const std::uint32_t kz = static_cast<std::uint32_t>(std::bit_width(
                                 bits_of(f4, hn::Eq(sizes, hn::Set(f4, longest))) & 7)) -
                             1;
    out.kind = ray_classes[negatives + 8 * kz];
    const V4 origin = hn::Add(place, hn::Zero(f4));  // -0 becomes +0
    const V4 inverse = limited(hn::Div(hn::Set(f4, 1.0f), way)),
             pad = pad_of(tree, origin, way, kz);
    hn::Store(origin, f4, out.origin);
    hn::Store(way, f4, out.direction);
    hn::Store(inverse, f4, out.inverse);
    hn::Store(pad, f4, out.near_pad);
    set_starts(tree, origin, inverse, pad, out);
    out.shear[0] = components[out.kind.kx] / components[kz];
    out.shear[1] = components[out.kind.ky] / components[kz];
    out.tmin = max_of(tmin, 0.0f);
    out.tmax = min_of(tmax, std::numeric_limits<float>::max());
    out.t_scale = 1.0f;
}

/// A valid ray with a direction of any length that is plainly scaled. `longest` of its components.
inline HWY_NOINLINE void fill_scaled_frame(const WideView& tree, const Ray& ray, V4 place, V4 way,
                                           float longest, SingleFrame& out) {
    const float scale = plain_scale(longest);
    alignas(16) float components[4];
    const V4 scaled = hn::Mul(way, hn::Set(f4, scale));
    hn::Store(scaled, f4, components);
    fill_usual_frame(tree, place, scaled, components, longest * scale,
                     start_in_units(ray.tmin, scale),
                     min_of(ray.tmax, std::numeric_limits<float>::max()) / scale, out);
    out.t_scale = scale;
}

/// False if the ray is invalid. The same numbers as make_frame's for all valid rays.
HWY_INLINE bool fill_frame(const WideView& tree, const Ray& ray, SingleFrame& out) {
    const V4 place = load_axes(&ray.origin.x), way = load_axes(&ray.direction.x);
    const float ax = std::fabs(ray.direction.x), ay = std::fabs(ray.direction.y),
                az = std::fabs(ray.direction.z);
    const float longest = max_of(max_of(ax, ay), az);
    const V4 most = hn::Set(f4, std::numeric_limits<float>::max());
    const std::uint32_t finite = bits_of(f4, hn::Le(hn::Abs(place), most)) &
                                 bits_of(f4, hn::Le(hn::Abs(way), hn::Set(f4, longest))) & 7;
    const bool usual = finite == 7 && longest > 0x1p-3f && longest < 0x1p3f &&
                       ray.tmin <= ray.tmax && ray.tmax >= 0.0f;
    if (!usual) {
        if (!is_valid(ray)) return false;
        if (is_plainly_scaled(longest))
            fill_scaled_frame(tree, ray, place, way, longest, out);
        else
            fill_odd_frame(tree, ray, out);
        return true;
    }
    fill_usual_frame(tree, place, way, &ray.direction.x, longest, ray.tmin, ray.tmax, out);
    return true;
}

/// A ray of a stream.
HWY_INLINE void fill_frame(const WideView& tree, const StreamFrame& frame, const StreamRay& ray,
                           SingleFrame& out) {
    const V4 origin = hn::Load(f4, ray.origin), inverse = hn::Load(f4, ray.inverse),
             pad = hn::LoadU(f4, frame.near_pad);
    hn::Store(origin, f4, out.origin);
    hn::Store(hn::LoadU(f4, ray.direction), f4, out.direction);
    hn::Store(inverse, f4, out.inverse);
    hn::Store(pad, f4, out.near_pad);
    set_starts(tree, origin, inverse, pad, out);
    out.shear[0] = ray.shear[0], out.shear[1] = ray.shear[1];
    out.kind = frame.kind;
    out.tmin = ray.tmin, out.tmax = ray.t;
    out.t_scale = 1.0f;
}

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
