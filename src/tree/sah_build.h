// Top-down build by surface area over references in three sorted orders: cut, divide the orders
// stably, go on below. Nothing is sorted twice. MacDonald and Booth 1990, "Heuristics for ray
// tracing using space subdivision".
#pragma once

#include <raydix/buffer.h>
#include <raydix/bvh.h>

#include <array>
#include <cstdint>

#include "tree/sah_reference.h"
#include "tree/sah_top.h"

namespace raydix {

/// Memory kept from one build to the next.
struct SahScratch {
    Buffer<SahReference> references;
    std::array<Buffer<std::uint32_t>, 3> orders, spare_orders;
    Buffer<std::uint8_t> sides;
    Buffer<std::uint32_t> local;  // place of a reference in its task
    SubtreeStore subtrees;

    [[nodiscard]] std::size_t capacity_bytes() const;
};

struct SahInput {
    std::uint32_t references;  // n >= 1
    std::uint32_t max_leaf;
};

/// scratch.references [n] and scratch.orders [n]: their places, ascending by centroid. Fills nodes
/// [2 * inner + 2] and order, ids within a leaf ascending and each at most once. Returns the number
/// of inner nodes.
std::uint32_t build_sah(const SahInput& input, SahScratch& scratch, Buffer<BvhNode>& nodes,
                        Buffer<std::uint32_t>& order, std::uint32_t& max_depth);

}  // namespace raydix
