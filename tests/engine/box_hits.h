// Tests of the caller's own for boxes, in float and in double.
#pragma once

#include <algorithm>
#include <limits>

namespace raydix::test {

/// The first of two places along the ray that its limits let through.
template <class AnyRay, class AnyHit>
bool first_within(const AnyRay& ray, double near, double far, AnyHit& hit) {
    using Number = decltype(hit.t);
    hit.t = static_cast<Number>(near);
    if (!(hit.t >= ray.tmin)) hit.t = static_cast<Number>(far);
    return hit.t >= ray.tmin && hit.t <= ray.tmax;
}

/// Where a ray enters or leaves a box. u: the axis of the side that is entered.
template <class Box, class AnyRay, class AnyHit>
bool hits_box(const Box& box, const AnyRay& ray, AnyHit& hit) {
    double enter = -std::numeric_limits<double>::infinity(), leave = -enter;
    int side = 0;
    const auto cut = [&](int axis, double lo, double hi, double o, double d) {
        if (d == 0.0) {
            if (o < lo || o > hi) leave = -std::numeric_limits<double>::infinity();
            return;
        }
        const double one = (lo - o) / d, other = (hi - o) / d;
        if (std::min(one, other) > enter) enter = std::min(one, other), side = axis;
        leave = std::min(leave, std::max(one, other));
    };
    cut(0, box.lo.x, box.hi.x, ray.origin.x, ray.direction.x);
    cut(1, box.lo.y, box.hi.y, ray.origin.y, ray.direction.y);
    cut(2, box.lo.z, box.hi.z, ray.origin.z, ray.direction.z);
    if (!(enter <= leave) || !first_within(ray, enter, leave, hit)) return false;
    using Number = decltype(hit.t);
    hit.u = static_cast<Number>(side);
    hit.v = 0;
    return true;
}

}  // namespace raydix::test
