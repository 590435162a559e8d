// A binary tree of triangles in the form of the warp kernels: pairs, Woop triangles, marked ids.
#pragma once

#include <raydix/buffer.h>
#include <raydix/simulate.h>

#include <cstdint>

#include "layout/pair64.h"
#include "layout/woop48.h"

namespace raydix {

struct WarpTree::Arrays {
    Buffer<NodePair> pairs;          // [max(inner, 1)]
    Buffer<WoopTriangle> triangles;  // [references]
    Buffer<std::uint32_t> ids;       // [references]
    std::uint32_t max_depth = 0;
};

}  // namespace raydix
