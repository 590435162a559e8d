// Ray against box. Conservative: a box is never missed if the triangle test could accept something
// in it.
#pragma once

#include <raydix/types.h>

#include <cmath>
#include <type_traits>

#include "base/hd.h"
#include "base/math.h"
#include "trace/ray_frame.h"

namespace raydix {

/// A tree's boxes, widened for one ray. A hit at t stands for a point of its triangle, and on every
/// axis the ray at t is within u (2 F + 6 Fz) of that point: u = 2^-24, F is the distance to the
/// far side of the root along the axis, Fz along the ray's longest one. The planes round 5 times.
/// So all boxes grow by 8 u (F + Fz) on every side (docs/algorithms/triangle-test.md has the
/// proof), and by a little that does not underflow. In double the boxes are still floats, relative
/// to a point of the scene (BvhD). There the point is within 45 roundings (test 4, weights 32, t 8,
/// the origin on its way to that point 1), and the pad is 64.
template <class Scalar>
struct BasicSlabFrame {
    BasicVec3<Scalar> origin, inverse;
    BasicVec3<Scalar> near_pad,
        far_pad;  // with sign: near planes move toward the ray's start, far planes away from it
    int near_x, near_y,
        near_z;  // offset of the near plane in the eight floats of a node: 0 lo, 4 hi
};
using SlabFrame = BasicSlabFrame<float>;
using SlabFrameD = BasicSlabFrame<double>;

template <class Scalar>
inline constexpr Scalar slab_pad_of = (sizeof(Scalar) == 4 ? 8 : 64) * rounding_of<Scalar>;
inline constexpr float slab_pad = slab_pad_of<float>;
/// Where all distances are tiny, roundings are not relative: each is below 2^-149.
inline constexpr float least_slab_pad = 0x1p-126f;
/// 1 + 2 gamma(3), rounded up.
template <class Scalar>
inline constexpr Scalar slab_exit_factor_of = 1 + 8 * rounding_of<Scalar>;
inline constexpr float slab_exit_factor = slab_exit_factor_of<float>;

template <class Scalar>
RAYDIX_HD inline BasicSlabFrame<Scalar> make_slab_frame(const BasicRayFrame<Scalar>& ray,
                                                        const Aabb& root) {
    const auto reach = [](float lo, float hi, Scalar o) {
        return max_of(std::fabs(lo - o), std::fabs(hi - o));
    };
    const BasicVec3<Scalar> far{reach(root.lo.x, root.hi.x, ray.origin.x),
                                reach(root.lo.y, root.hi.y, ray.origin.y),
                                reach(root.lo.z, root.hi.z, ray.origin.z)};
    const Scalar far_z = component(far, ray.kz);
    const auto pad_of = [&](Scalar far_a) {
        return slab_pad_of<Scalar> * (far_a + far_z) + least_slab_pad;
    };
    const BasicVec3<Scalar> pad{pad_of(far.x), pad_of(far.y), pad_of(far.z)};
    const bool nx = std::signbit(ray.inverse.x), ny = std::signbit(ray.inverse.y),
               nz = std::signbit(ray.inverse.z);
    const BasicVec3<Scalar> near_pad{nx ? pad.x : -pad.x, ny ? pad.y : -pad.y, nz ? pad.z : -pad.z};
    return {ray.origin, ray.inverse, near_pad,  Scalar(-1) * near_pad,
            nx ? 4 : 0, ny ? 4 : 0,  nz ? 4 : 0};
}

/// Entry and exit of the padded box that starts at `node` (lo.xyz, link, hi.xyz, count). 0 * Inf, a
/// plane that holds a ray parallel to it, is NaN, and comparisons drop it: such a ray is inside the
/// slab.
template <class Scalar>
struct BasicSlabInterval {
    Scalar entry, exit;
};
using SlabInterval = BasicSlabInterval<float>;

template <class Scalar>
RAYDIX_HD inline BasicSlabInterval<Scalar> intersect_slabs(const BasicSlabFrame<Scalar>& ray,
                                                           const float* node,
                                                           std::type_identity_t<Scalar> tmin,
                                                           std::type_identity_t<Scalar> tmax) {
    // The pad is added to the difference: added to the origin it would be lost where coordinates
    // are large.
    const auto plane = [](float at, Scalar origin, Scalar pad, Scalar inverse) {
        return ((at - origin) + pad) * inverse;
    };
    const Scalar ex = plane(node[ray.near_x], ray.origin.x, ray.near_pad.x, ray.inverse.x);
    const Scalar ey = plane(node[ray.near_y + 1], ray.origin.y, ray.near_pad.y, ray.inverse.y);
    const Scalar ez = plane(node[ray.near_z + 2], ray.origin.z, ray.near_pad.z, ray.inverse.z);
    const Scalar lx = plane(node[4 - ray.near_x], ray.origin.x, ray.far_pad.x, ray.inverse.x);
    const Scalar ly = plane(node[5 - ray.near_y], ray.origin.y, ray.far_pad.y, ray.inverse.y);
    const Scalar lz = plane(node[6 - ray.near_z], ray.origin.z, ray.far_pad.z, ray.inverse.z);
    const Scalar entry = max_of(ez, max_of(ey, max_of(ex, tmin)));
    const Scalar leave =
        min_of(lz, min_of(ly, min_of(lx, Scalar(infinity)))) * slab_exit_factor_of<Scalar>;
    return {entry, min_of(leave, tmax)};
}

}  // namespace raydix
