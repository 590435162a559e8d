// Ray against box. Conservative: a box is never missed if the triangle test could accept something
// in it.
#pragma once

#include <raydix/types.h>

#include <cmath>

#include "base/hd.h"
#include "base/math.h"
#include "trace/ray_frame.h"

namespace raydix {

/// The box of a tree's root, widened for one ray. The triangle test accepts a triangle if the ray
/// passes within rounding of it: at most 4 eps (|distance along x| + |distance along z|) in its
/// sheared plane (two roundings for the vertex, three for the shear). All boxes of the tree grow by
/// twice that bound on every side, taken at the root, as Woop, Benthin and Wald (2013, section 4)
/// suggest; the quotients' own error is covered by Ize's factor (2013).
struct SlabFrame {
    Vec3 origin, inverse;
    Vec3 near_pad,
        far_pad;  // with sign: near planes move toward the ray's start, far planes away from it
    int near_x, near_y,
        near_z;  // offset of the near plane in the eight floats of a node: 0 lo, 4 hi
};

inline constexpr float slab_pad = 8.0f * 0x1p-24f;
/// 1 + 2 gamma(3), rounded up.
inline constexpr float slab_exit_factor = 1.0f + 0x1p-21f;

RAYDIX_HD inline SlabFrame make_slab_frame(const RayFrame& ray, const Aabb& root) {
    const auto reach = [](float lo, float hi, float o) {
        return max_of(std::fabs(lo - o), std::fabs(hi - o));
    };
    const Vec3 far{reach(root.lo.x, root.hi.x, ray.origin.x),
                   reach(root.lo.y, root.hi.y, ray.origin.y),
                   reach(root.lo.z, root.hi.z, ray.origin.z)};
    const float far_z = component(far, ray.kz);
    const Vec3 pad{slab_pad * (far.x + far_z), slab_pad * (far.y + far_z),
                   slab_pad * (far.z + far_z)};
    const bool nx = std::signbit(ray.inverse.x), ny = std::signbit(ray.inverse.y),
               nz = std::signbit(ray.inverse.z);
    const Vec3 near_pad{nx ? pad.x : -pad.x, ny ? pad.y : -pad.y, nz ? pad.z : -pad.z};
    return {ray.origin, ray.inverse, near_pad,  -1.0f * near_pad,
            nx ? 4 : 0, ny ? 4 : 0,  nz ? 4 : 0};
}

/// Entry and exit of the padded box that starts at `node` (lo.xyz, link, hi.xyz, count). 0 * Inf, a
/// plane that holds a ray parallel to it, is NaN, and comparisons drop it: such a ray is inside the
/// slab.
struct SlabInterval {
    float entry, exit;
};

RAYDIX_HD inline SlabInterval intersect_slabs(const SlabFrame& ray, const float* node, float tmin,
                                              float tmax) {
    // The pad is added to the difference: added to the origin it would be lost where coordinates
    // are large.
    const auto plane = [](float at, float origin, float pad, float inverse) {
        return ((at - origin) + pad) * inverse;
    };
    const float ex = plane(node[ray.near_x], ray.origin.x, ray.near_pad.x, ray.inverse.x);
    const float ey = plane(node[ray.near_y + 1], ray.origin.y, ray.near_pad.y, ray.inverse.y);
    const float ez = plane(node[ray.near_z + 2], ray.origin.z, ray.near_pad.z, ray.inverse.z);
    const float lx = plane(node[4 - ray.near_x], ray.origin.x, ray.far_pad.x, ray.inverse.x);
    const float ly = plane(node[5 - ray.near_y], ray.origin.y, ray.far_pad.y, ray.inverse.y);
    const float lz = plane(node[6 - ray.near_z], ray.origin.z, ray.far_pad.z, ray.inverse.z);
    const float entry = max_of(ez, max_of(ey, max_of(ex, tmin)));
    const float leave = min_of(lz, min_of(ly, min_of(lx, infinity))) * slab_exit_factor;
    return {entry, min_of(leave, tmax)};
}

}  // namespace raydix
