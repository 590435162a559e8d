#include "layout/wide_part.h"

#include <raydix/error.h>

#include <algorithm>
#include <string>

#include "exec/parallel.h"

namespace raydix {
namespace {

constexpr std::uint32_t lanes = BlockFiller::lanes;
/// Beyond, a leaf's word would be a NaN as a float: kernels take that for a missing child.
constexpr std::uint32_t max_places = (1u << 28) - (1u << 20);

/// Where a part's arrays begin in those of the whole tree.
struct Bases {
    std::uint32_t node, block;
};

template <class Node>
Node placed(Node node, const Bases& own, std::span<const Bases> parts) {
    for (std::uint32_t& word : node.child) {
        if (word == wide_no_child) continue;
        if ((word & wide_leaf_bit) != 0)
            word += own.block * lanes << 3;
        else if ((word & wide_part_bit) != 0)
            word = parts[1 + (word & ~wide_part_bit)].node;
        else
            word += own.node;
    }
    return node;
}

void set_figures(const WideSums& sums, WideBvh::Arrays& out) {
    WideBvhStats& stats = out.stats;
    stats.nodes = std::max(out.nodes.size(), out.compact_nodes.size());
    stats.leaves = sums.leaves;
    stats.references = sums.references;
    stats.max_depth = sums.levels;
    stats.children_per_node = static_cast<double>(sums.children) / static_cast<double>(stats.nodes);
    const bool quantised = !out.compact_nodes.empty() && sums.child_area > 0;
    stats.widening = quantised ? sums.decoded_area / sums.child_area : 1.0;
}

}  // namespace

void WideSums::add(const WideSums& other) {
    node_area += other.node_area;
    child_area += other.child_area;
    decoded_area += other.decoded_area;
    triangle_area += other.triangle_area;
    children += other.children;
    leaves += other.leaves;
    references += other.references;
    levels = std::max(levels, other.levels);
}

void WidePart::clear() {
    nodes.clear();
    blocks.clear();
    compact_nodes.clear();
    compact_blocks.clear();
    filler = {};
    sums = {};
}

WideSums join_parts(std::span<const WidePart> parts, bool compact, WideBvh::Arrays& out) {
    std::vector<Bases> bases;
    std::size_t nodes = 0, blocks = 0;
    WideSums sums;
    for (const WidePart& part : parts) {
        bases.push_back({static_cast<std::uint32_t>(nodes), static_cast<std::uint32_t>(blocks)});
        nodes += part.node_count();
        blocks += part.filler.blocks();
        sums.add(part.sums);
    }
    if (blocks > max_places / lanes)
        throw InputError("a wide tree holds " + std::to_string(max_places) +
                         " triangle references at most");
    out.nodes.reset(compact ? 0 : nodes);
    out.blocks.reset(compact ? 0 : blocks);
    out.compact_nodes.reset(compact ? nodes : 0);
    out.compact_blocks.reset(compact ? blocks : 0);
    for_each_index(
        parts.size(),
        [&](std::size_t p) {
            const WidePart& part = parts[p];
            const auto place = [&](const auto& node) { return placed(node, bases[p], bases); };
            std::ranges::transform(part.nodes, out.nodes.data() + bases[p].node, place);
            std::ranges::transform(part.compact_nodes, out.compact_nodes.data() + bases[p].node,
                                   place);
            std::ranges::copy(part.blocks, out.blocks.data() + bases[p].block);
            std::ranges::copy(part.compact_blocks, out.compact_blocks.data() + bases[p].block);
        },
        1);
    set_figures(sums, out);
    return sums;
}

}  // namespace raydix
