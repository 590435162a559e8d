// A box for each lane of a warp, in numbers that lanes can shuffle.
#pragma once

#include <raydix/types.h>

#include <cstdint>

#include "base/hd.h"

namespace raydix {

template <class Warp>
struct WarpBoxes {
    typename Warp::template Var<float> lo_x, lo_y, lo_z, hi_x, hi_y, hi_z;

    [[nodiscard]] RAYDIX_HD Aabb get(std::uint32_t lane) const {
        return {{lo_x[lane], lo_y[lane], lo_z[lane]}, {hi_x[lane], hi_y[lane], hi_z[lane]}};
    }
    RAYDIX_HD void set(std::uint32_t lane, const Aabb& box) {
        lo_x[lane] = box.lo.x;
        lo_y[lane] = box.lo.y;
        lo_z[lane] = box.lo.z;
        hi_x[lane] = box.hi.x;
        hi_y[lane] = box.hi.y;
        hi_z[lane] = box.hi.z;
    }
    /// Lane k gets the box of lane source(k).
    template <class Source>
    [[nodiscard]] RAYDIX_HD WarpBoxes taken_from(const Warp& warp, const Source& source) const {
        WarpBoxes to;
        to.lo_x = warp.shuffle(lo_x, source);
        to.lo_y = warp.shuffle(lo_y, source);
        to.lo_z = warp.shuffle(lo_z, source);
        to.hi_x = warp.shuffle(hi_x, source);
        to.hi_y = warp.shuffle(hi_y, source);
        to.hi_z = warp.shuffle(hi_z, source);
        return to;
    }
};

}  // namespace raydix
