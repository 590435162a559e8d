// kd_hash: nodes in preorder, as a stream of little-endian 32-bit words -> XXH3-128 as hex.
#include <raydix/kdtree.h>

#include "tree/kdtree_walk.h"
#include "tree/word_hash.h"

namespace raydix {
namespace {

constexpr std::uint32_t tree_kind_kdtree = 2;

}  // namespace

std::string kd_hash(const KdTree& tree) {
    WordHash hash;
    hash.put(tree_kind_kdtree);
    hash.put(static_cast<std::uint32_t>(tree.options().bits));
    hash.put(static_cast<std::uint32_t>(tree.options().max_leaf));
    if (!tree.empty()) {
        hash.put(tree.bounds().lo);
        hash.put(tree.bounds().hi);
    }
    walk_kd_preorder(tree.nodes(), tree.max_depth(), [&](std::uint32_t slot) {
        const KdNode& node = tree.nodes()[slot];
        hash.put(std::bit_cast<std::uint32_t>(node.lo));
        hash.put(std::bit_cast<std::uint32_t>(node.hi));
        hash.put(node.axis());
        if (!node.is_leaf()) return hash.put(std::bit_cast<std::uint32_t>(node.plane));
        hash.put(node.count());
        for (const std::uint32_t id : tree.order().subspan(node.first, node.count())) hash.put(id);
    });
    return hash.hex();
}

}  // namespace raydix
