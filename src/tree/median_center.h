// Where to put the 0 of a float tree over boxes in double, and how far to scale them down.
#pragma once

#include <raydix/types.h>

#include <algorithm>
#include <cstddef>
#include <vector>

#include "base/math.h"
#include "base/median.h"

namespace raydix {

/// Where most boxes are, so that floats are finest there: the median of the middles of some, which
/// one that strayed does not move. `box_at(i, box) -> bool` writes the i-th of n boxes, or says
/// that it is to be left out. In `bounds`, of all that are not; 0 if those are empty.
template <class BoxAt>
[[nodiscard]] Vec3d median_center(std::size_t n, const BoxAt& box_at, const AabbD& bounds) {
    constexpr std::size_t wanted = 1024;
    std::vector<double> x, y, z;
    for (std::size_t k = 0; k < std::min(n, wanted); ++k) {
        AabbD box;
        if (!box_at(k * n / std::min(n, wanted), box)) continue;
        const Vec3d middle = 0.5 * box.lo + 0.5 * box.hi;
        x.push_back(middle.x);
        y.push_back(middle.y);
        z.push_back(middle.z);
    }
    if (!x.empty()) return {median(x), median(y), median(z)};
    return bounds.lo.x <= bounds.hi.x ? 0.5 * bounds.lo + 0.5 * bounds.hi : Vec3d{0.0, 0.0, 0.0};
}

/// 1, 1/2 or 1/4: float coordinates end at 1e12; differences of doubles may be twice that.
[[nodiscard]] inline double scale_around(Vec3d center, const AabbD& bounds) {
    const Vec3d far = max_of(bounds.hi - center, center - bounds.lo);
    double scale = 1.0;
    while (max_of(max_of(far.x, far.y), far.z) * scale > 0x1p39) scale *= 0.5;
    return scale;
}

}  // namespace raydix
