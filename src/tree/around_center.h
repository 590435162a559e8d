// Boxes in double -> boxes in float around a center, rounded outward: what a float tree is built
// over.
#pragma once

#include <raydix/types.h>

#include <cmath>

#include "base/math.h"

namespace raydix {

/// value + lost = x - y exactly (Knuth's two-sum: no branch, any magnitudes).
struct TwoDifference {
    double value, lost;
};
inline TwoDifference two_difference(double x, double y) {
    const double difference = x - y, back = difference - x;
    return {difference, (x - (difference - back)) + (-y - back)};
}

/// The largest double that is not above x - y.
inline double below_difference(double x, double y) {
    const auto [difference, lost] = two_difference(x, y);
    return lost < 0.0 ? std::nextafter(difference, -double(infinity)) : difference;
}

/// The largest float that is not above scale * (x - center); scale a power of two.
inline float below_difference(double x, double center, double scale) {
    const auto [difference, lost] = two_difference(x, center);
    const double scaled = scale * difference;
    const auto nearest = static_cast<float>(scaled);
    const bool above = double(nearest) > scaled || (double(nearest) == scaled && lost < 0.0);
    return (above ? std::nextafterf(nearest, -infinity) : nearest) + 0.0f;
}

inline Aabb box_around_center(const AabbD& box, Vec3d center, double scale) {
    const auto below = [&](double x, double c) { return below_difference(x, c, scale); };
    const auto above = [&](double x, double c) { return 0.0f - below_difference(-x, -c, scale); };
    Aabb out{{below(box.lo.x, center.x), below(box.lo.y, center.y), below(box.lo.z, center.z)},
             {above(box.hi.x, center.x), above(box.hi.y, center.y), above(box.hi.z, center.z)}};
    // Rounding may have made a box of a point, and a smaller one than float builders take.
    if (!diagonal_in_range(out)) {
        const float room = 2.0f * min_diagonal;
        out.lo = out.lo - Vec3{room, room, room};
        out.hi = out.hi + Vec3{room, room, room};
    }
    return out;
}

}  // namespace raydix
