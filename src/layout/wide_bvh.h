// What a wide tree of the CPU consists of (raydix/wide.h). A finished binary tree, or the clusters
// that it would be made of -> nodes [wide nodes], blocks [references / 4, a little more]. In a
// compact tree boxes are quantised and triangles share vertices.
#pragma once

#include <raydix/buffer.h>
#include <raydix/types.h>
#include <raydix/wide.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "exec/path_rates.h"
#include "layout/block_filler.h"
#include "layout/quantise.h"
#include "layout/wide_collapse.h"

namespace raydix {

class ClusterView;
struct SortedTriangles;  // sorted_part.h

/// A word of a node's `child`: the node's index, or with the highest bit set, a leaf's place among
/// the triangles times 8 plus its count less one. Place p is lane p % 4 of block p / 4; no leaf
/// goes over the end of a block.
inline constexpr std::uint32_t wide_leaf_bit = 0x80000000u;
inline constexpr std::uint32_t wide_no_child = 0xFFFFFFFFu;
inline constexpr std::uint32_t wide_max_leaf = 4;
/// What the collapse takes for the cost of testing up to `wide_block` triangles against that of a
/// node.
inline constexpr std::uint32_t wide_block = 1;
inline constexpr double wide_primitive_cost = 0.4;

/// Children's boxes as they are, but about the middle of the tree's bounds
/// (WideBvh::Arrays::middle), rounded outward: then a plane meets a ray after plane * inverse + (a
/// constant of the ray), with an error that depends on the size of the scene and not on where it
/// lies. A missing child has lo = infinity and hi = -infinity. Children are in ascending
/// order of their search_rank at the time of the build (search_odds.h): any hit is looked for in
/// the last one first. A refit leaves them where they are.
struct alignas(32) WideNode {
    float lo[3][8], hi[3][8];
    std::uint32_t child[8];
};
static_assert(sizeof(WideNode) == 224);

/// The node of compact trees. Frame and boxes fill the first 64 bytes. A child in slot s has the
/// box origin + lo[.][s] * step to origin + hi[.][s] * step, where the step of an axis is
/// 2^(exponent - 127); slots as above.
struct alignas(32) CompactNode {
    float origin[3];
    std::uint8_t exponent[3];
    std::uint8_t used;  // bit s: there is a child in slot s
    std::uint8_t lo[3][quantised_width];
    std::uint8_t hi[3][quantised_width];
    std::uint32_t child[quantised_width];
};
static_assert(sizeof(CompactNode) == 96);

/// Four triangles, one a lane: corner[3 * vertex + axis][lane]. A leaf touches three cache lines.
struct alignas(32) TriangleBlock {
    float corner[9][block_lanes];
    std::uint32_t prim[block_lanes];

    void set(std::uint32_t lane, const LeafTriangle& t, std::uint32_t id) {
        const Vec3 corners[3] = {t.v0, t.v1, t.v2};
        for (int v = 0; v < 3; ++v) {
            corner[3 * v][lane] = corners[v].x;
            corner[3 * v + 1][lane] = corners[v].y;
            corner[3 * v + 2][lane] = corners[v].z;
        }
        prim[lane] = id;
    }
};
static_assert(sizeof(TriangleBlock) == 160);

/// Four triangles by their corners' places in a list of vertices: vertex[corner][lane].
struct alignas(64) CompactBlock {
    std::uint32_t vertex[3][block_lanes];
    std::uint32_t prim[block_lanes];
};
static_assert(sizeof(CompactBlock) == 64);

/// Nodes and blocks of one kind.
struct WideBvh::Arrays {
    Buffer<WideNode> nodes;
    Buffer<TriangleBlock> blocks;
    Buffer<CompactNode> compact_nodes;
    Buffer<CompactBlock> compact_blocks;
    Buffer<Vec3> vertices;  // of compact ones, in the order in which blocks need them first
    Vec3 middle{};          // of the bounds
    Aabb bounds{};          // the root's exact box: rays widen boxes by its size
    // Once more, a vector each, the last float 0: a single ray loads them where they are, since
    // floats that were just copied one by one cannot be loaded as a vector at once.
    struct Frame {
        alignas(16) float lo[4]{}, hi[4]{}, middle[4]{};
    } frame;
    // Rays widen the boxes of a node by its own size (local_pads.h), not by the root's.
    bool local_pads = false;
    WideBvhStats stats;
    mutable PathRates rates;  // of batches so far

    void set_bounds(const Aabb& box) { set_bounds(box, center_of(box)); }
    /// `about`: in place of the middle, where planes of nodes are about another point.
    void set_bounds(const Aabb& box, Vec3 about) {
        bounds = box;
        middle = about;
        const auto copy = [](const Vec3& from, float* to) {
            to[0] = from.x, to[1] = from.y, to[2] = from.z;
        };
        copy(box.lo, frame.lo);
        copy(box.hi, frame.hi);
        copy(middle, frame.middle);
    }

    /// Nothing to hit; the memory stays.
    void clear(const WideOptions& options) {
        nodes.reset(0);
        blocks.reset(0);
        compact_nodes.reset(0);
        compact_blocks.reset(0);
        vertices.reset(0);
        bounds = {};
        frame = {};
        local_pads = false;
        stats = {};
        stats.width = options.width;
        stats.compact = options.compact;
        stats.widening = 1.0;
        rates = {};
    }
};

struct WideBvhInternals {
    static WideBvh tree_of(std::unique_ptr<WideBvh::Arrays> arrays) {
        WideBvh tree;
        tree.arrays_ = std::move(arrays);
        return tree;
    }
    static WideBvh::Arrays& arrays_of(WideBvh& tree) { return *tree.arrays_; }
};

/// Memory that making a layout takes, kept from one to the next.
struct WideScratch {
    WideScratch();
    ~WideScratch();
    struct Memory;
    std::unique_ptr<Memory> memory;
};

/// Fills the arrays and their figures but for time and width; the tree holds triangles and is not
/// empty. Triangles without area are left out, and leaves that hold nothing else.
/// The same from a Bvh of the builders ploc, hploc and binned and from the clusters that it was
/// made of.
void make_wide_layout(const Bvh& bvh, const WideOptions& options, WideBvh::Arrays& out,
                      WideScratch& scratch);
void make_wide_layout(ClusterView& clusters, const WideOptions& options, WideBvh::Arrays& out,
                      WideScratch& scratch);
/// From triangles with area in the order of their codes, at least one; not compact. Leaves are the
/// highest subtrees of up to options.max_leaf of them. The top is chosen by the cells of the grid.
void make_wide_layout(const SortedTriangles& triangles, const WideOptions& options,
                      WideBvh::Arrays& out, WideScratch& scratch);
/// Memory that may be used until then: at least `bytes`, which become blocks.
[[nodiscard]] std::span<std::byte> memory_for_sorting(std::size_t triangles, std::size_t bytes,
                                                      WideBvh::Arrays& out);

}  // namespace raydix
