// Which children a node has, and in which order rays take them. Included once per instruction set.
#if defined(RAYDIX_SIMD_CHILDREN_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYDIX_SIMD_CHILDREN_H
#undef RAYDIX_SIMD_CHILDREN_H
#else
#define RAYDIX_SIMD_CHILDREN_H
#endif

#include <hwy/cache_control.h>

#include <bit>

#include "base/prefetch.h"
#include "trace/simd/lanes.h"
#include "trace/simd/wide_ray.h"

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

/// Of any object: a prefetch for each of its cache lines.
template <class Object>
RAYDIX_PREFETCHING void ask_for_all(const Object& object) {
    constexpr std::size_t line = 64;
    const auto* const bytes = reinterpret_cast<const char*>(&object);
    for (std::size_t k = 0; k < sizeof(Object); k += line) hwy::Prefetch(bytes + k);
}

/// Bit s: there is a child in slot s.
HWY_INLINE std::uint32_t used_slots(const CompactNode& node) { return node.used; }
HWY_INLINE std::uint32_t used_slots(const WideNode& node) {
    std::uint32_t used = 0;
    for (std::size_t l = 0; l < 8; l += lanes8) {
        const auto words = hn::Load(U8(), node.child + l);
        const auto missing = hn::Eq(words, hn::Set(U8(), wide_no_child));
        used |= bits_of(f8, hn::RebindMask(f8, hn::Not(missing))) << l;
    }
    return used;
}

/// Asks for the cache lines of a child, node or leaf, that will be visited soon.
template <bool compact>
HWY_INLINE void ask_for(const WideView& tree, std::uint32_t word) {
    const bool leaf = (word & wide_leaf_bit) != 0;
    const std::size_t block = ((word & ~wide_leaf_bit) >> 3) / block_lanes;
    if constexpr (compact) {
        leaf ? ask_for_all(tree.compact_blocks[block]) : ask_for_all(tree.compact_nodes[word]);
    } else {
        leaf ? ask_for_all(tree.blocks[block]) : ask_for_all(tree.nodes[word]);
    }
}

/// `slots` into `order`, the smallest box first; how many.
HWY_INLINE std::uint32_t order_by_area(std::uint32_t slots, std::uint32_t* order) {
    std::uint32_t count = 0;
    for (; slots != 0; slots &= slots - 1)
        order[count++] = static_cast<std::uint32_t>(std::countr_zero(slots));
    return count;
}

/// `slots` into `order`, the largest of `entries` [8] first; how many.
HWY_INLINE std::uint32_t order_by_entry(std::uint32_t slots, const float* entries,
                                        std::uint32_t* order) {
    std::uint32_t count = 0;
    for (; slots != 0; slots &= slots - 1) {
        const auto s = static_cast<std::uint32_t>(std::countr_zero(slots));
        std::uint32_t k = count++;
        for (; k > 0 && entries[order[k - 1]] < entries[s]; --k) order[k] = order[k - 1];
        order[k] = s;
    }
    return count;
}

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
