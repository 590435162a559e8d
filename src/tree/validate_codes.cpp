// A radix tree is unique for its codes: they are computed again, must ascend along the order, and
// each inner node must split where the common prefix of neighbours is shortest (Karras 2012,
// section 3).
#include <fmt/format.h>

#include <algorithm>

#include "base/bits.h"
#include "exec/search.h"
#include "keys/morton.h"
#include "tree/lbvh_family.h"
#include "tree/validate.h"
#include "tree/walk.h"

namespace raydix {
namespace {

/// The code of each place of the order, 30 bits or 63.
std::vector<std::uint64_t> codes_in_order(const Bvh& bvh) {
    const Grid grid = make_grid(bvh.bounds(), bvh.options().bits / 3);
    std::vector<std::uint64_t> codes(bvh.order().size());
    for_each_index(codes.size(), [&](std::size_t i) {
        codes[i] = interleave<std::uint64_t>(grid.cell(center_of(primitive_box(bvh, i))));
    });
    return codes;
}

/// Grows with the common prefix of the keys at i - 1 and i; equal codes share more than any others.
int shared_with_previous(const std::vector<std::uint64_t>& codes, std::size_t i) {
    const std::uint64_t differs = codes[i - 1] ^ codes[i];
    if (differs != 0) return leading_zeros(differs);
    return 64 + leading_zeros(static_cast<std::uint32_t>((i - 1) ^ i));
}

/// The shortest prefix shared by neighbours below a child of an inner node: at the child's own
/// split, and everywhere in a leaf.
int shortest_inside(const Bvh& bvh, const std::vector<std::uint64_t>& codes,
                    const std::vector<std::uint32_t>& begin, std::size_t slot) {
    const BvhNode& node = bvh.nodes()[slot];
    if (!node.is_leaf()) return shared_with_previous(codes, begin[node.first + 1]);
    int shortest = 64 + 32;
    for (std::size_t i = node.first + 1; i < std::size_t{node.first} + node.count; ++i)
        shortest = std::min(shortest, shared_with_previous(codes, i));
    return shortest;
}

}  // namespace

Fault validate_codes(const Bvh& bvh) {
    if (bvh.empty() || !follows_codes(bvh.options()) || bvh.refitted()) return {};
    const std::vector<std::uint64_t> codes = codes_in_order(bvh);
    const std::span<const std::uint32_t> order = bvh.order();
    const std::size_t pairs = codes.size() - 1;
    const std::size_t falls = first_index_where(pairs, [&](std::size_t i) {
        return codes[i] != codes[i + 1] ? codes[i] > codes[i + 1] : order[i] >= order[i + 1];
    });
    if (falls != pairs)
        return fmt::format(
            "order: positions {} and {} with the codes {:#x} and {:#x} and the primitives {} "
            "and {} do not ascend",
            falls, falls + 1, codes[falls], codes[falls + 1], order[falls], order[falls + 1]);

    const std::span<const BvhNode> nodes = bvh.nodes();
    const std::vector<std::uint32_t> begin = first_positions(bvh);
    const std::size_t bad = first_index_where(nodes.size(), [&](std::size_t slot) {
        const BvhNode& node = nodes[slot];
        if (slot == 1 || node.is_leaf()) return false;
        const int here = shared_with_previous(codes, begin[node.first + 1]);
        return shortest_inside(bvh, codes, begin, node.first) <= here ||
               shortest_inside(bvh, codes, begin, node.first + 1) <= here;
    });
    if (bad == nodes.size()) return {};
    return fmt::format(
        "nodes: inner node {} splits at position {}, which is not where its codes first differ",
        bad, begin[nodes[bad].first + 1]);
}

}  // namespace raydix
