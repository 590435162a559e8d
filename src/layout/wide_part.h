// A part of a WideBvh that was written by itself, and what makes one tree of all parts.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "layout/block_filler.h"
#include "layout/wide_bvh.h"

namespace raydix {

/// What the figures of WideBvhStats are made of. Areas are half surfaces.
struct WideSums {
    double node_area = 0, child_area = 0, decoded_area = 0;
    double triangle_area = 0;  // of the leaves, times their triangles
    std::uint64_t children = 0, leaves = 0, references = 0;
    std::uint32_t levels = 0;

    void add(const WideSums& other);
};

/// In compact blocks, until vertices have their numbers: there is no triangle in this lane.
inline constexpr std::uint32_t no_vertex = ~std::uint32_t{0};

/// In the word of a child that is the first node of another part: which one, of parts[1 + ...].
/// Only the first part has such children.
inline constexpr std::uint32_t wide_part_bit = 0x40000000u;

/// Children that are nodes, and places of leaves, are numbered within the part.
struct WidePart {
    std::vector<WideNode> nodes;
    std::vector<TriangleBlock> blocks;
    std::vector<CompactNode> compact_nodes;
    std::vector<CompactBlock> compact_blocks;  // vertices by the view's numbers
    BlockFiller filler;
    WideSums sums;

    void clear();
    [[nodiscard]] std::size_t node_count() const { return nodes.size() + compact_nodes.size(); }
};

/// Puts the nodes and blocks of all parts behind each other; fills the arrays' figures but for
/// time, width and SAH. Throws InputError for too many triangles.
WideSums join_parts(std::span<const WidePart> parts, bool compact, WideBvh::Arrays& out);

}  // namespace raydix
