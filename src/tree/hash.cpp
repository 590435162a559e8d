// tree_hash: nodes in preorder, as a stream of little-endian 32-bit words -> XXH3-128 as hex.
#include "tree/bvh_stream.h"
#include "tree/walk.h"
#include "tree/word_hash.h"

namespace raydix {

std::string tree_hash(const Bvh& bvh) {
    WordHash hash;
    put_bvh_head(hash, bvh.options().bits, bvh.options().max_leaf);
    walk_preorder(bvh.nodes(), bvh.max_depth(), [&](std::uint32_t node_index) {
        const BvhNode& node = bvh.nodes()[node_index];
        if (node.is_leaf())
            put_leaf_node(hash, node.lo, node.hi, bvh.order().subspan(node.first, node.count));
        else
            put_inner_node(hash, node.lo, node.hi);
    });
    return hash.hex();
}

}  // namespace raydix
