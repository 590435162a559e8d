// A tree that holds each triangle once, made from one that may hold it in several leaves.
#pragma once

#include <raydix/bvh.h>

namespace raydix {

/// Same triangles, same primitive ids; `bvh` must have split primitives.
[[nodiscard]] Bvh make_whole_tree(const Bvh& bvh);

}  // namespace raydix
