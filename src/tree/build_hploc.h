// H-PLOC on the CPU: the kernel of hploc.h, warp by warp.
#pragma once

#include <raydix/buffer.h>

#include <cstdint>
#include <span>

#include "tree/box_lanes.h"
#include "tree/cluster.h"

namespace raydix {

/// Sorted keys [n], n >= 1, the ids [n] and boxes [n] of their primitives -> nodes [id_limit],
/// which is more than any id. Returns the root, which is a primitive if n = 1. `memory` is kept
/// from one build to the next.
template <class Key>
ClusterRef build_hploc(std::span<const Key> keys, std::span<const std::uint32_t> ids,
                       std::uint32_t id_limit, const BoxLanes& boxes, std::uint32_t max_leaf,
                       Buffer<ClusterNode>& nodes, Buffer<std::byte>& memory);

extern template ClusterRef build_hploc(std::span<const std::uint32_t>,
                                       std::span<const std::uint32_t>, std::uint32_t,
                                       const BoxLanes&, std::uint32_t, Buffer<ClusterNode>&,
                                       Buffer<std::byte>&);
extern template ClusterRef build_hploc(std::span<const std::uint64_t>,
                                       std::span<const std::uint32_t>, std::uint32_t,
                                       const BoxLanes&, std::uint32_t, Buffer<ClusterNode>&,
                                       Buffer<std::byte>&);

}  // namespace raydix
