// What refits ask of a tree, in float and in double.
#pragma once

#include <raydix/bvh.h>
#include <raydix/error.h>

#include <string>

namespace raydix {

inline void require_whole(const Bvh& bvh) {
    if (bvh.has_split_primitives())
        throw InputError("refit: this tree of builder " +
                         std::string(builder_name(bvh.options().builder)) +
                         " holds parts of triangles, which are not kept; build it again, or with "
                         "another builder");
}

}  // namespace raydix
