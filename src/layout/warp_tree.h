// A tree of triangles in the form of the warp kernels: pairs, Woop triangles, marked ids; and the
// same as a compressed wide tree.
#pragma once

#include <raydix/buffer.h>
#include <raydix/error.h>
#include <raydix/simulate.h>

#include <cstdint>
#include <string>

#include "layout/cwbvh.h"
#include "layout/pair64.h"
#include "layout/woop48.h"

namespace raydix {

/// Entries of 4 bytes that the stack of a lane needs. In a wide tree a level takes two.
[[nodiscard]] inline std::uint32_t warp_stack_entries(WarpKernel kernel, std::uint32_t max_depth,
                                                      std::uint32_t wide_max_depth) {
    return reads_wide_nodes(kernel) ? 2 * (wide_max_depth + 1) : max_depth + 1;
}

/// Levels that the kernels with a short stack have bits for, from the root to the deepest leaf.
inline constexpr std::uint32_t trail_levels = 64;

inline void check_trail_levels(WarpKernel kernel, std::uint32_t max_depth) {
    if (has_short_stack(kernel) && max_depth >= trail_levels)
        throw InputError("the tree is " + std::to_string(max_depth) + " deep; the kernel " +
                         std::string(warp_kernel_name(kernel)) + " has a trail for depths up to " +
                         std::to_string(trail_levels - 1));
}

struct WarpTree::Arrays {
    Buffer<NodePair> pairs;          // [max(inner, 1)]
    Buffer<WoopTriangle> triangles;  // [references]
    Buffer<std::uint32_t> ids;       // [references]
    std::uint32_t max_depth = 0;
    struct Wide {
        Buffer<CwbvhNode> nodes;
        Buffer<WoopTriangle> triangles;  // [references]
        Buffer<std::uint32_t> ids;       // [references]
        Aabb bounds = {};
        float padding = 0.0f;
        std::uint32_t max_depth = 0;
    };
    Wide wide;  // empty unless it was asked for

    [[nodiscard]] std::uint32_t stack_entries(WarpKernel kernel) const {
        return warp_stack_entries(kernel, max_depth, wide.max_depth);
    }
};

}  // namespace raydix
