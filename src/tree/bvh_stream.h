// What tree_hash hashes of a BVH (contract.md 2), word by word: the head, then nodes in preorder.
// `Out` takes it: put(std::uint32_t) and put(Vec3).
#pragma once

#include <raydix/types.h>

#include <cstdint>

namespace raydix {

template <class Out>
void put_bvh_head(Out& out, int bits, int max_leaf) {
    constexpr std::uint32_t tree_kind_bvh = 0;
    out.put(tree_kind_bvh);
    out.put(static_cast<std::uint32_t>(bits));
    out.put(static_cast<std::uint32_t>(max_leaf));
}

template <class Out>
void put_inner_node(Out& out, Vec3 lo, Vec3 hi) {
    out.put(lo);
    out.put(hi);
}

/// ids: of the leaf's primitives, in their order.
template <class Out, class Ids>
void put_leaf_node(Out& out, Vec3 lo, Vec3 hi, const Ids& ids) {
    put_inner_node(out, lo, hi);
    out.put(static_cast<std::uint32_t>(ids.size()));
    for (const std::uint32_t id : ids) out.put(id);
}

}  // namespace raydix
