// A tree that holds each triangle once, made from one that may hold it in several leaves.
#pragma once

#include <raydix/bvh.h>
#include <raydix/double.h>

namespace raydix {

/// Same triangles, same primitive ids; `bvh` must have split primitives.
[[nodiscard]] Bvh make_unsplit_tree(const Bvh& bvh);
[[nodiscard]] BvhD make_unsplit_tree(const BvhD& bvh);

/// More than make_unsplit_tree() holds at any time. A build holds up to three times the tree; the
/// corners and their triangles lie beside it, in lists that double.
template <class AnyBvh>
[[nodiscard]] std::uint64_t unsplit_tree_bytes(const AnyBvh& bvh) {
    return 5 * bvh.bytes();
}

[[nodiscard]] inline bool has_parts(const Bvh& bvh) { return bvh.has_split_primitives(); }
[[nodiscard]] inline bool has_parts(const BvhD& bvh) { return bvh.tree().has_split_primitives(); }

}  // namespace raydix
