// The launches before and behind a traversal kernel.
#pragma once

#include <raydix/types.h>

#include <cstdint>

#include "base/hd.h"
#include "base/math.h"
#include "layout/woop48.h"
#include "trace/warp/prepare_rays.h"

namespace raydix {

/// No ray was handed out yet.
struct StartPool {
    std::uint32_t* next;
    RAYDIX_HD void operator()(std::uint32_t) const { *next = 0; }
};

/// A tree without triangles: every ray misses.
struct MissAll {
    TreeHit* hits;  // [n], out
    RAYDIX_HD void operator()(std::uint32_t i) const {
        hits[i] = TreeHit{infinity, no_primitive, 0, 0};
    }
};

}  // namespace raydix
