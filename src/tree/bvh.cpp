// What a finished tree says about itself without being walked.
#include <raydix/bvh.h>

#include "base/math.h"

namespace raydix {

Aabb Bvh::bounds() const {
    if (nodes_.empty()) return empty_box();
    return {nodes_[0].lo, nodes_[0].hi};
}

std::uint64_t Bvh::bytes() const {
    return nodes().size_bytes() + order().size_bytes() + triangles().size_bytes() +
           boxes().size_bytes() + points().size_bytes();
}

}  // namespace raydix
