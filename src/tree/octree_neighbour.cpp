// Neighbours of octree nodes: the cell one step away, and the way down to it from the root.
#include <raydix/error.h>

#include "exec/parallel.h"
#include "exec/search.h"
#include "tree/octree_walk.h"

namespace raydix {
namespace {

/// The cell's code, or nothing if the step leaves the root.
bool step(const OctreeNode& node, Direction d, std::uint64_t& code) {
    const Cell cell = cell_of_code(node.code);
    const std::uint32_t cells = 1u << node.level;
    // A step below 0 wraps around to a number past the last cell.
    const Cell there{cell.x + static_cast<std::uint32_t>(d.dx),
                     cell.y + static_cast<std::uint32_t>(d.dy),
                     cell.z + static_cast<std::uint32_t>(d.dz)};
    if (there.x >= cells || there.y >= cells || there.z >= cells) return false;
    code = interleave<std::uint64_t>(there);
    return true;
}

std::uint32_t neighbour_of(const Octree& octree, const OctreeNode& node, Direction direction) {
    std::uint64_t code = 0;
    if (!step(node, direction, code)) return no_node;
    const std::uint32_t found = descend(octree, code, node.level);
    const OctreeNode& there = octree.nodes()[found];
    // An inner node above the level has no points in the octant that the way leads to.
    return there.level == node.level || there.is_leaf() ? found : no_node;
}

void check_direction(Direction direction) {
    const auto is_step = [](int d) { return d >= -1 && d <= 1; };
    const auto [dx, dy, dz] = direction;
    if (!is_step(dx) || !is_step(dy) || !is_step(dz) || (dx == 0 && dy == 0 && dz == 0))
        throw InputError("direction (" + std::to_string(dx) + ", " + std::to_string(dy) + ", " +
                         std::to_string(dz) + ") is not one of the 26");
}

}  // namespace

std::array<Direction, 26> all_directions() {
    std::array<Direction, 26> all;
    std::size_t used = 0;
    for (int dx = -1; dx <= 1; ++dx)
        for (int dy = -1; dy <= 1; ++dy)
            for (int dz = -1; dz <= 1; ++dz)
                if (dx != 0 || dy != 0 || dz != 0) all[used++] = {dx, dy, dz};
    return all;
}

std::uint32_t neighbour(const Octree& octree, std::uint32_t node_index, Direction direction) {
    check_direction(direction);
    return neighbour_of(octree, node_at(octree, node_index), direction);
}

std::vector<std::uint32_t> neighbour(const Octree& octree, std::span<const std::uint32_t> nodes,
                                     Direction direction, int threads) {
    check_direction(direction);
    std::vector<std::uint32_t> found(nodes.size());
    with_threads(threads, [&] {
        const auto is_stranger = [&](std::size_t i) { return nodes[i] >= octree.nodes().size(); };
        const std::size_t stranger = first_index_where(nodes.size(), is_stranger);
        if (stranger != nodes.size()) (void)node_at(octree, nodes[stranger]);  // throws
        for_each_index(
            nodes.size(),
            [&](std::size_t i) {
                found[i] = neighbour_of(octree, octree.nodes()[nodes[i]], direction);
            },
            256);
    });
    return found;
}

std::array<std::uint32_t, 26> neighbours(const Octree& octree, std::uint32_t node_index) {
    const OctreeNode& node = node_at(octree, node_index);
    const std::array<Direction, 26> directions = all_directions();
    std::array<std::uint32_t, 26> found;
    for (std::size_t k = 0; k < directions.size(); ++k)
        found[k] = neighbour_of(octree, node, directions[k]);
    return found;
}

}  // namespace raydix
