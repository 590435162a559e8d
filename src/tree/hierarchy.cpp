#include "tree/hierarchy.h"

#include <raydix/error.h>

#include <string>

#include "tree/karras.h"

namespace raydix {

template <class Key>
std::uint32_t build_hierarchy(Builder builder, std::span<const Key> keys, int max_leaf,
                              Buffer<BvhNode>& nodes, HierarchyScratch& scratch) {
    switch (builder) {
        case Builder::karras:
            return build_karras(keys, max_leaf, nodes, scratch);
        default:
            break;
    }
    throw InputError("builder " + std::string(builder_name(builder)) + " does not run here");
}

template std::uint32_t build_hierarchy(Builder, std::span<const std::uint32_t>, int,
                                       Buffer<BvhNode>&, HierarchyScratch&);
template std::uint32_t build_hierarchy(Builder, std::span<const std::uint64_t>, int,
                                       Buffer<BvhNode>&, HierarchyScratch&);

}  // namespace raydix
