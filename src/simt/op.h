// What a warp can do in a traversal kernel, as far as it is charged for: every step and every turn
// of a loop names one of these.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace raydix {

enum class Op : std::uint8_t {
    main_loop,      // one turn of a kernel's outermost loop
    node_loop,      // one turn of the loop over inner nodes
    leaf_loop,      // one turn of the loop over triangles
    visit_node,     // both boxes of a node pair, and which child comes first
    push,           // the farther child onto the stack
    pop,            // the next node from the stack
    test_triangle,  // the plane: t, and whether it is in range
    test_edges,     // the two barycentrics of a triangle whose t is in range
    accept_hit,     // a hit that is closer than the best so far
    next_triangle,  // on in the list of a leaf, or out of it
    postpone_leaf,  // speculation: a leaf is put aside
    next_leaf,      // speculation: the leaf put aside is done, a second one may wait
    vote,           // whether any lane, or all
    ballot,         // which lanes, and how many
    rank,           // how many lanes below have their bit set
    shuffle,        // a value from another lane
    choose,         // of a few values that all lanes agree on
    take_rays,      // one atomic addition for the warp
    start_ray,      // a ray is read and prepared
    store_hit,      // its result is written
    exchange_ray,   // a lane's whole ray against one in shared memory
    count
};

inline constexpr std::size_t op_count = static_cast<std::size_t>(Op::count);

inline constexpr std::array<std::string_view, op_count> op_names{
    "main_loop",     "node_loop",  "leaf_loop",   "visit_node",    "push",          "pop",
    "test_triangle", "test_edges", "accept_hit",  "next_triangle", "postpone_leaf", "next_leaf",
    "vote",          "ballot",     "rank",        "shuffle",       "choose",        "take_rays",
    "start_ray",     "store_hit",  "exchange_ray"};

[[nodiscard]] constexpr std::string_view op_name(Op op) {
    return op_names[static_cast<std::size_t>(op)];
}

/// Native instructions of one issue of each operation.
using OpCosts = std::array<std::uint32_t, op_count>;

/// Clocks of one issue of each operation, of a warp that has a multiprocessor to itself.
using OpClocks = std::array<double, op_count>;

/// Whether an operation begins with a read from memory that the rest of it waits for. The id of a
/// triangle does not count: it can be read together with the triangle.
[[nodiscard]] constexpr bool waits_for_read(Op op) {
    return op == Op::visit_node || op == Op::test_triangle || op == Op::test_edges ||
           op == Op::start_ray || op == Op::take_rays;
}

}  // namespace raydix
