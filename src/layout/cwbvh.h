// The compressed node of Ylitie, Karras and Laine 2017 (section 3.2): eight children in 80 bytes.
// Wide tree + triangles in leaf order -> nodes [wide nodes], triangles [references].
#pragma once

#include <raydix/buffer.h>
#include <raydix/cwbvh.h>
#include <raydix/types.h>

#include <cstdint>

#include "base/hd.h"
#include "layout/quantise.h"
#include "layout/wide_collapse.h"

namespace raydix {

inline constexpr int cwbvh_width = 8;
inline constexpr std::uint32_t cwbvh_max_leaf = 3;
/// Positions of a node's triangles are bits 0 to 23 of a mask of what a ray met, children that are
/// nodes bits 24 to 31.
inline constexpr std::uint32_t cwbvh_first_child_bit = 24;

/// A child in slot s has the box origin + lo[.][s] * step to origin + hi[.][s] * step, where the
/// step of an axis is 2^(exponent - 127). Bit a of s is set for children that lie toward the upper
/// end of axis a, as far as the places go: a ray meets the slots from near to far in ascending
/// order of s ^ (its octant).
struct alignas(16) CwbvhNode {
    float origin[3];
    std::uint8_t exponent[3];
    std::uint8_t inner_mask;      // bit s: the child in slot s is a node
    std::uint32_t child_base;     // nodes of the children follow each other, in order of slots
    std::uint32_t triangle_base;  // and so do their triangles
    /// 0: no child. Node: 001 in the upper three bits, 24 + s in the lower five. Leaf: as many ones
    /// in the upper three bits as it has triangles; the lower five are the first one's position
    /// behind triangle_base.
    std::uint8_t meta[cwbvh_width];
    std::uint8_t lo[3][cwbvh_width];
    std::uint8_t hi[3][cwbvh_width];
};
static_assert(sizeof(CwbvhNode) == 80);

/// A triangle in three 16-byte words, its id in the first.
struct alignas(16) CwbvhTriangle {
    Vec3 v0;
    std::uint32_t prim;
    Vec3 v1;
    std::uint32_t unused0;  // 0
    Vec3 v2;
    std::uint32_t unused1;  // 0
};
static_assert(sizeof(CwbvhTriangle) == 48);

struct Cwbvh::Arrays {
    Buffer<CwbvhNode> nodes;
    Buffer<CwbvhTriangle> triangles;
    Aabb bounds{};  // the root's exact box: rays widen boxes by its size
    CwbvhStats stats;
};

/// Fills nodes, triangles and bounds. `wide` has 8 children a node, at most 3 primitives a leaf.
void compress_wide_tree(const WideTree& wide, const Bvh& bvh, Cwbvh::Arrays& out);

}  // namespace raydix
