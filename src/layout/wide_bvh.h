// What a wide tree of the CPU consists of (raydix/wide.h). Wide tree + triangles in leaf order ->
// nodes [wide nodes], blocks [references / 8, a little more].
#pragma once

#include <raydix/buffer.h>
#include <raydix/types.h>
#include <raydix/wide.h>

#include <cstdint>

#include "layout/quantise.h"
#include "layout/wide_collapse.h"

namespace raydix {

/// A word of WideNode::child: the node's index, or with the highest bit set, a leaf's place among
/// the triangles times 8 plus its count less one. Place p is lane p % 8 of block p / 8; no leaf
/// goes over the end of a block.
inline constexpr std::uint32_t wide_leaf_bit = 0x80000000u;
inline constexpr std::uint32_t wide_no_child = 0xFFFFFFFFu;
inline constexpr std::uint32_t wide_max_leaf = 4;
/// What the collapse takes for the cost of testing up to `wide_block` triangles against that of a
/// node.
inline constexpr std::uint32_t wide_block = 1;
inline constexpr double wide_primitive_cost = 0.4;

/// Frame and boxes fill the first 64 bytes. A child in slot s has the box origin + lo[.][s] * step
/// to origin + hi[.][s] * step, where the step of an axis is 2^(exponent - 127); slots are those of
/// assign_octant_slots.
struct alignas(32) WideNode {
    float origin[3];
    std::uint8_t exponent[3];
    std::uint8_t used;  // bit s: there is a child in slot s
    std::uint8_t lo[3][quantised_width];
    std::uint8_t hi[3][quantised_width];
    std::uint32_t child[quantised_width];
};
static_assert(sizeof(WideNode) == 96);

/// Eight triangles, one a lane: corner[3 * vertex + axis][lane].
struct alignas(32) TriangleBlock {
    float corner[9][8];
    std::uint32_t prim[8];
};
static_assert(sizeof(TriangleBlock) == 320);

struct WideBvh::Arrays {
    Buffer<WideNode> nodes;
    Buffer<TriangleBlock> blocks;
    Aabb bounds{};  // the root's exact box: rays widen boxes by its size
    WideBvhStats stats;
};

/// Fills nodes, blocks and bounds. At most wide_max_leaf primitives a leaf in `wide`; triangles
/// without area are left out, and leaves that hold nothing else. Returns the sum of the half areas
/// of all child boxes before they are quantised.
double make_wide_layout(const WideTree& wide, const Bvh& bvh, WideBvh::Arrays& out);

}  // namespace raydix
