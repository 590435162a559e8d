// Boxes of clipped triangles: computed in double, rounded outward to float.
#pragma once

#include <raydix/types.h>

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "base/math.h"
#include "tree/clip.h"

namespace raydix {

/// The largest float that is surely not above the true value. `x` may be off by rounding in double
/// unless it is a float itself: corners and planes are exact.
inline float round_down(double x) {
    const auto nearest = static_cast<float>(x);
    if (double(nearest) == x) return nearest + 0.0f;
    const double safe = x - std::fabs(x) * 0x1p-50;
    const auto rounded = static_cast<float>(safe);
    return (double(rounded) <= safe ? rounded : std::nextafterf(rounded, -infinity)) + 0.0f;
}
inline float round_up(double x) { return 0.0f - round_down(-x); }

/// Around the polygon with `room` on all sides, but not beyond `within`, which holds it up to
/// rounding. Not empty, even if the polygon is: then it is `within`.
inline Aabb outward_box(const Polygon& polygon, const Aabb& within, double room = 0.0) {
    if (polygon.count == 0) return within;
    Polygon::Point lo = polygon.corners[0], hi = lo;
    for (std::size_t i = 1; i < polygon.count; ++i)
        for (std::size_t k = 0; k < 3; ++k) {
            lo[k] = std::min(lo[k], polygon.corners[i][k]);
            hi[k] = std::max(hi[k], polygon.corners[i][k]);
        }
    const Vec3 down{round_down(lo[0] - room), round_down(lo[1] - room), round_down(lo[2] - room)};
    const Vec3 up{round_up(hi[0] + room), round_up(hi[1] + room), round_up(hi[2] + room)};
    return {min_of(max_of(down, within.lo), within.hi), max_of(min_of(up, within.hi), within.lo)};
}

}  // namespace raydix
