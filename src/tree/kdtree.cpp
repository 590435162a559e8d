// What a finished k-d tree can say of itself.
#include <raydix/kdtree.h>

#include "tree/lbvh_family.h"

namespace raydix {

std::uint64_t KdTree::bytes() const {
    return nodes().size_bytes() + order().size_bytes() + triangles().size_bytes() +
           points().size_bytes();
}

TreeStats kd_stats(const KdTree& tree) {
    TreeStats stats;
    stats.nodes = std::uint64_t{tree.inner_count()} + tree.leaf_count();
    stats.leaves = tree.leaf_count();
    stats.references = tree.order().size();
    stats.layout_nodes = tree.nodes().size();
    stats.max_depth = tree.max_depth();
    if (!tree.empty()) stats.depth_bound = lbvh_depth_bound(tree.options().bits, stats.references);
    stats.bytes = tree.bytes();
    stats.tree_hash = kd_hash(tree);
    return stats;
}

}  // namespace raydix
