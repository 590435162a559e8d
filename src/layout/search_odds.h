// What a search for any hit finds in a subtree and what it costs, and so in which order the
// children of a node are best searched (Ize and Hansen 2011, "RTSAH traversal order for occlusion
// rays").
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>

namespace raydix {

/// Areas of boxes stand for how many rays enter them, as in the surface area heuristic.
struct SearchOdds {
    float hits;  // of the rays that enter the subtree's box, those that hit something there
    float cost;  // of all rays that enter, each searching the whole subtree: that of the collapse
};

/// Of a leaf's box of this area: every other ray. Triangles of a leaf are not looked at: orders by
/// how much of its box they cover visit as many nodes (docs/performance/single-calls.md).
constexpr float hits_of_leaf(float area) { return 0.5f * area; }

/// Of the box of this area around two subtrees, as if what one stops had nothing to do with what
/// the other does.
constexpr float joined_hits(float a, float b, float area) {
    return area > 0.0f ? a + b - a * (b / area) : 0.0f;
}

/// Of a node whose box has this area: visits, before its children are added.
constexpr SearchOdds odds_of_node(float area) { return {0.0f, area}; }
constexpr void add_child(const SearchOdds& child, float area, SearchOdds& node) {
    node.hits = joined_hits(node.hits, child.hits, area);
    node.cost += child.cost;
}

/// Where rays search children of higher rank first, they are done soonest: the chance of a hit over
/// the cost.
constexpr float search_rank(const SearchOdds& odds) {
    return odds.hits / std::max(odds.cost, std::numeric_limits<float>::min());
}

/// Puts the few children into ascending order of search_rank(odds_of(child)); those of equal rank
/// keep theirs.
template <class Odds>
void order_for_search(std::span<std::uint32_t> children, const Odds& odds_of) {
    for (std::size_t k = 1; k < children.size(); ++k) {
        const std::uint32_t child = children[k];
        const float rank = search_rank(odds_of(child));
        std::size_t at = k;
        for (; at > 0 && search_rank(odds_of(children[at - 1])) > rank; --at)
            children[at] = children[at - 1];
        children[at] = child;
    }
}

}  // namespace raydix
