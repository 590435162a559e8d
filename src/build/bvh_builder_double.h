// Builds of BvhD with the same scratch from one to the next.
#pragma once

#include <raydix/double.h>

namespace raydix {

struct BvhBuilderD {
    bool keeps_scratch = true;  // if not, it goes before the corners are copied
    BvhBuilder nodes{};
    Buffer<Aabb> boxes{};  // around the center, [triangles]

    /// As build_bvh, into a tree that is empty; on an error it is worth nothing.
    void build(const MeshViewD& mesh, const BuildOptions& options, BvhD& tree);
};

/// For trees of many at once, where the peak says nothing of one.
void forget_peak(Bvh& tree);
void forget_peak(BvhD& tree);

}  // namespace raydix
