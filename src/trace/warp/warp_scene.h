// A tree of the host, as the warp kernels see it.
#pragma once

#include "layout/warp_tree.h"
#include "trace/warp/lane.h"

namespace raydix {

inline WarpScene scene_of(const WarpTree& tree) {
    const WarpTree::Arrays& arrays = tree.arrays();
    return {arrays.pairs.data(), arrays.triangles.data(),      arrays.ids.data(),
            arrays.wide.data(),  arrays.wide_triangles.data(), arrays.wide_ids.data(),
            arrays.wide_bounds};
}

}  // namespace raydix
