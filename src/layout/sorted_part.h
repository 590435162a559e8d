// Subtrees of sorted triangles -> wide nodes and blocks of triangles, each in one go: the binary
// tree between is never more than a part, in a core's own cache. The loops are compiled once per
// instruction set (part_kernels.cpp); the bits are the same.
#pragma once

#include <raydix/buffer.h>
#include <raydix/types.h>

#include <cstdint>
#include <span>
#include <string_view>

#include "exec/progress.h"
#include "layout/collapse_plan.h"
#include "layout/search_odds.h"
#include "layout/sorted_top.h"
#include "layout/wide_bvh.h"
#include "layout/wide_part.h"
#include "primitives/sources.h"

namespace raydix {

/// A node of a part's binary tree. Both children of an inner one come before it, the right one
/// right before.
template <int width>
struct alignas(64) PartEntry {
    Vec3 lo;
    std::uint32_t link;  // of a leaf its word, as in WideNode::child; else the left child
    Vec3 hi;
    float hits;  // as SearchOdds has it
    CollapsePlan<width> plan;
};

/// What a part has become, as a child of the top.
struct PartRoot {
    Aabb box;
    SearchOdds odds{};
    std::uint32_t word = 0;  // a node or a leaf, numbered within its group
};

/// Neighbouring parts that one thread writes behind each other.
struct PartGroup {
    std::span<const SortedPart> parts;
    std::span<PartRoot> roots;  // [parts], out
    TriangleBlock* blocks;      // where the group's blocks begin, out
};

/// What all parts are made from.
struct PartInput {
    const SortedTriangles& triangles;
    const std::uint64_t* kept;  // bit s: keys s and s + 1 are in different leaves; a word more
    Vec3 middle;                // what planes are about
    const ProgressCounter& progress;  // of keys
};

/// Memory of a thread.
template <int width>
using PartEntries = Buffer<PartEntry<width>>;

struct PartKernel {
    std::string_view isa;
    void (*write4)(const PartInput& in, const PartGroup& group, PartEntries<4>& entries,
                   WidePart& out);
    void (*write8)(const PartInput& in, const PartGroup& group, PartEntries<8>& entries,
                   WidePart& out);
};

/// Those that this processor has, the best first.
[[nodiscard]] std::span<const PartKernel> part_kernels();

}  // namespace raydix
