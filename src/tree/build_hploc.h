// H-PLOC on the CPU: the kernel of hploc.h, warp by warp.
#pragma once

#include <raydix/buffer.h>

#include <cstdint>
#include <span>

#include "tree/box_lanes.h"
#include "tree/cluster.h"

namespace raydix {

/// Memory kept from one build to the next.
struct HplocScratch {
    Buffer<ClusterRef> lists;
    Buffer<std::uint32_t> meeting;

    [[nodiscard]] std::size_t capacity_bytes() const {
        return lists.capacity_bytes() + meeting.capacity_bytes();
    }
};

/// Sorted keys [n], n >= 1, the ids [n] and boxes [n] of their primitives -> nodes [n - 1],
/// numbered as the threads come by. Returns the root, which is a primitive if n = 1.
template <class Key>
ClusterRef build_hploc(std::span<const Key> keys, std::span<const std::uint32_t> ids,
                       const BoxLanes& boxes, std::uint32_t max_leaf, Buffer<ClusterNode>& nodes,
                       HplocScratch& scratch);

extern template ClusterRef build_hploc(std::span<const std::uint32_t>,
                                       std::span<const std::uint32_t>, const BoxLanes&,
                                       std::uint32_t, Buffer<ClusterNode>&, HplocScratch&);
extern template ClusterRef build_hploc(std::span<const std::uint64_t>,
                                       std::span<const std::uint32_t>, const BoxLanes&,
                                       std::uint32_t, Buffer<ClusterNode>&, HplocScratch&);

}  // namespace raydix
