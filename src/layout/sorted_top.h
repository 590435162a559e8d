// The top of a wide tree over sorted triangles, and the subtrees that hang from it: what a thread
// makes by itself is known before boxes are. prefixes [n - 1], some triangles -> nodes [top], parts
// [n / some thousand, a few times over].
#pragma once

#include <raydix/buffer.h>
#include <raydix/types.h>

#include <cstdint>
#include <span>
#include <vector>

#include "primitives/sources.h"
#include "tree/neighbour_prefixes.h"

namespace raydix {

/// Triangles in the order of their codes.
struct SortedTriangles {
    const NeighbourPrefixes& prefixes;
    std::span<const std::uint32_t> order;  // [keys]
    const TriangleSource& source;
    Aabb bounds;  // around all
};

/// A slot of the top before its children are in order.
struct TopSlot {
    static constexpr std::uint32_t no_node = ~std::uint32_t{0};
    std::uint32_t node, child;
};

/// A subtree of the radix tree: keys [begin, end).
struct SortedPart {
    std::uint32_t begin, end;
    TopSlot parent;       // node: no_node if this is the whole tree
    std::uint32_t depth;  // edges from the root of the wide tree
};

struct SortedTop {
    /// Has `children` children: nodes that come after it, and parts.
    struct Node {
        TopSlot parent;
        std::uint32_t depth, children;
    };
    std::vector<Node> nodes;        // none if the whole tree is one part
    std::vector<SortedPart> parts;  // ascending
};

/// A part has at most so many keys. The more, the less of the tree is chosen by samples.
inline constexpr std::uint32_t most_in_part = 32768;

/// Memory to work with.
struct TopBuffers {
    Buffer<std::uint8_t> least_prefixes;
    Buffer<Aabb> samples, chunks;
};

/// Of one triangle at least. Up to max_leaf of them are a leaf, which is a child of some node. A
/// node takes its largest child apart until it is full; how large they are is told by the boxes of
/// some of their triangles.
[[nodiscard]] SortedTop make_sorted_top(const SortedTriangles& triangles, std::uint32_t width,
                                        std::uint32_t max_leaf, TopBuffers& memory);

}  // namespace raydix
