// A tree of the host, as the warp kernels see it.
#pragma once

#include "layout/warp_tree.h"
#include "trace/warp/lane.h"

namespace raydix {

inline WarpScene scene_of(const WarpTree& tree) {
    const WarpTree::Arrays& arrays = tree.arrays();
    const WarpTree::Arrays::Wide& wide = arrays.wide;
    return {arrays.pairs.data(),
            arrays.triangles.data(),
            arrays.ids.data(),
            {wide.nodes.data(), wide.triangles.data(), wide.ids.data(), wide.bounds, wide.padding}};
}

}  // namespace raydix
