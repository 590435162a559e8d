// A tree that holds each triangle once, made from one that may hold it in several leaves.
#pragma once

#include <raydix/bvh.h>
#include <raydix/double.h>

namespace raydix {

/// Same triangles, same primitive ids; `bvh` must have split primitives.
[[nodiscard]] Bvh make_whole_tree(const Bvh& bvh);
[[nodiscard]] BvhD make_whole_tree(const BvhD& bvh);

[[nodiscard]] inline bool has_parts(const Bvh& bvh) { return bvh.has_split_primitives(); }
[[nodiscard]] inline bool has_parts(const BvhD& bvh) { return bvh.tree().has_split_primitives(); }

}  // namespace raydix
