// What one ray keeps between steps of a traversal kernel, and what all rays of a launch share.
#pragma once

#include <raydix/types.h>

#include <cstdint>

#include "base/hd.h"
#include "layout/cwbvh.h"
#include "layout/pair64.h"
#include "layout/woop48.h"

namespace raydix {

/// A compressed wide tree with Woop's triangles; null where there is none.
struct WarpWideTree {
    const CwbvhNode* nodes = nullptr;
    const WoopTriangle* triangles = nullptr;  // [references], as its leaves name them
    const std::uint32_t* ids = nullptr;       // [references]
    Aabb bounds = {};                         // of the root
    float padding = 0.0f;                     // pair_padding of the same tree
};

/// What the kernels read of a tree. It must not be empty.
struct WarpScene {
    const NodePair* pairs;
    const WoopTriangle* triangles;  // [references]
    const std::uint32_t* ids;       // [references], last_in_leaf set on the last of each leaf
    WarpWideTree wide = {};         // of kernels that read_wide_nodes
};

/// Values of Lane::node beside inner nodes (>= 0, the index of a pair) and leaves (< 0, the
/// complement of the position of the triangle to test next).
inline constexpr std::int32_t finished_node = 0x7FFFFFFF;  // the ray is done
inline constexpr std::int32_t popped_node = 0x7FFFFFFE;    // the next node comes from the stack
inline constexpr std::uint32_t no_ray = 0xFFFFFFFFu;

/// Scalars only, so that a compiler keeps it in registers; the stack lies elsewhere.
struct Lane {
    Vec3 origin, direction;
    Vec3 inverse, scaled;  // 1 / direction, origin / direction
    float tmin;
    float t;  // the closest hit so far, or tmax
    float u, v;
    std::uint32_t prim;
    std::uint32_t ray = no_ray;         // position in the launch
    std::int32_t node = finished_node;  // to visit next
    std::int32_t aside;                 // the farther child, to push; finished_node: none
    std::int32_t leaf;                  // speculation: the leaf put aside; 0: none
    float test_t, test_u, test_v;       // of the triangle at hand
    std::uint32_t meets;                // packets: 1 first child, 2 second, 4 rather the second
    std::uint32_t top;                  // entries on the stack
    std::int32_t* stack;                // [max_depth + 1]
};

// Static: this is compiled for several instruction sets, and no version may stand in for another.
RAYDIX_HD static inline bool is_finished(const Lane& l) { return l.node == finished_node; }
RAYDIX_HD static inline bool is_unfinished(const Lane& l) { return l.node != finished_node; }
RAYDIX_HD static inline bool at_inner_node(const Lane& l) {
    return static_cast<std::uint32_t>(l.node) < static_cast<std::uint32_t>(popped_node);
}
RAYDIX_HD static inline bool at_leaf(const Lane& l) { return l.node < 0; }
RAYDIX_HD static inline bool must_pop(const Lane& l) { return l.node == popped_node; }
RAYDIX_HD static inline bool must_push(const Lane& l) { return l.aside != finished_node; }
RAYDIX_HD static inline bool has_leaf_aside(const Lane& l) { return l.leaf != 0; }
RAYDIX_HD static inline bool has_ray(const Lane& l) { return l.ray != no_ray; }

/// Lanes of a kernel or body: Lane, unless it names a LaneType of its own.
template <class Kernel>
struct LaneOf {
    using Type = Lane;
};
template <class Kernel>
requires requires { typename Kernel::LaneType; }
struct LaneOf<Kernel> {
    using Type = typename Kernel::LaneType;
};

/// Whether what a lane keeps of its stack is in registers: its LaneType says so.
template <class Kernel>
inline constexpr bool stack_in_registers = requires {
    requires LaneOf<Kernel>::Type::stack_in_registers;
};

/// The rays of one launch and where their hits go. On a device both are aligned to 16 bytes.
struct RayLaunch {
    const Ray* rays;  // [count]
    TreeHit* hits;    // [count], out
    std::uint32_t count;
    std::uint32_t* next;  // the pool's counter, of kernels that fetch; starts at 0
};

}  // namespace raydix
