// tree_hash: nodes in preorder, as a stream of little-endian 32-bit words -> XXH3-128 as hex.
#include "tree/walk.h"
#include "tree/word_hash.h"

namespace raydix {
namespace {

constexpr std::uint32_t tree_kind_bvh = 0;

}  // namespace

std::string tree_hash(const Bvh& bvh) {
    WordHash hash;
    hash.put(tree_kind_bvh);
    hash.put(static_cast<std::uint32_t>(bvh.options().bits));
    hash.put(static_cast<std::uint32_t>(bvh.options().max_leaf));
    walk_preorder(bvh.nodes(), bvh.max_depth(), [&](std::uint32_t node_index) {
        const BvhNode& node = bvh.nodes()[node_index];
        hash.put(node.lo);
        hash.put(node.hi);
        if (!node.is_leaf()) return;
        hash.put(node.count);
        for (const std::uint32_t primitive_id : bvh.order().subspan(node.first, node.count))
            hash.put(primitive_id);
    });
    return hash.hex();
}

}  // namespace raydix
