// The octree's own figures, its hash and its statistics.
#include <raydix/octree.h>

#include <algorithm>

#include "exec/parallel.h"
#include "tree/octree_walk.h"
#include "tree/word_hash.h"

namespace raydix {
namespace {

constexpr std::uint32_t tree_kind_octree = 1;

}  // namespace

std::uint32_t Octree::level_count() const {
    return empty() ? 0 : nodes_[nodes_.size() - 1].level + 1;
}

NodeRange Octree::level_nodes(std::uint32_t level) const {
    if (level >= level_count()) return {};
    return {level_begin_[level], level_begin_[level + 1]};
}

std::uint64_t Octree::bytes() const {
    return nodes_.view().size_bytes() + order_.view().size_bytes() + points_.view().size_bytes();
}

OctreeStats octree_stats(const Octree& octree) {
    OctreeStats stats;
    const std::span<const OctreeNode> nodes = octree.nodes();
    stats.nodes = nodes.size();
    stats.references = octree.order().size();
    stats.max_level = static_cast<std::uint32_t>(octree.options().max_level);
    stats.max_depth = octree.empty() ? 0 : octree.level_count() - 1;
    for (std::uint32_t level = 0; level < octree.level_count(); ++level)
        stats.nodes_per_level.push_back(octree.level_nodes(level).size());
    for (const OctreeNode& node : nodes) {
        if (!node.is_leaf()) continue;
        ++stats.leaves;
        stats.largest_leaf = std::max<std::uint64_t>(stats.largest_leaf, node.point_count);
    }
    stats.bytes = octree.bytes();
    stats.tree_hash = tree_hash(octree);
    return stats;
}

std::string tree_hash(const Octree& octree) {
    WordHash hash;
    hash.put(tree_kind_octree);
    hash.put(static_cast<std::uint32_t>(octree.options().bits));
    hash.put(static_cast<std::uint32_t>(octree.options().max_leaf));
    hash.put(static_cast<std::uint32_t>(octree.options().max_level));
    if (octree.empty()) return hash.hex();
    hash.put(octree.bounds().lo);
    hash.put(octree.bounds().hi);
    walk_octree(octree, [&](std::uint32_t node_index) {
        const OctreeNode& node = octree.nodes()[node_index];
        hash.put(node.level);
        hash.put(static_cast<std::uint32_t>(node.code));
        hash.put(static_cast<std::uint32_t>(node.code >> 32));
        if (!node.is_leaf()) return true;
        hash.put(node.point_count);
        for (const std::uint32_t id : octree.order().subspan(node.first_point, node.point_count))
            hash.put(id);
        return false;
    });
    return hash.hex();
}

}  // namespace raydix
