// Top-down build by binned SAH. The top is built over runs of neighbours in Morton order, which are
// taken apart again as soon as a subtree is small enough for a cache; the rest over primitives.
#pragma once

#include <raydix/buffer.h>

#include <cstdint>
#include <span>

#include "tree/box_lanes.h"
#include "tree/cluster.h"
#include "tree/small_splits.h"
#include "tree/split_bins.h"

namespace raydix {

/// Memory kept from one build to the next.
struct BinnedScratch {
    Buffer<SplitBox> runs, spare;
    Buffer<SplitBox> lists;  // two for each worker
    Buffer<std::uint32_t> run_counts;
    Buffer<std::uint8_t> run_lengths;

    [[nodiscard]] std::size_t capacity_bytes() const {
        return runs.capacity_bytes() + spare.capacity_bytes() + lists.capacity_bytes() +
               run_counts.capacity_bytes() + run_lengths.capacity_bytes();
    }
};

/// Sorted keys [n], n >= 1, the ids [n] and boxes [n] of their primitives -> nodes [n - 1]. Returns
/// the root, which is a primitive if n = 1. `width`:
/// how many floats at a time, 4, 8 or 16 where the processor has them; the tree does not depend on
/// it.
template <class Key>
ClusterRef build_binned(std::span<const Key> keys, std::span<const std::uint32_t> ids,
                        const BoxLanes& boxes, std::uint32_t max_leaf, Buffer<ClusterNode>& nodes,
                        BinnedScratch& scratch, int width = split_width());

extern template ClusterRef build_binned(std::span<const std::uint32_t>,
                                        std::span<const std::uint32_t>, const BoxLanes&,
                                        std::uint32_t, Buffer<ClusterNode>&, BinnedScratch&, int);
extern template ClusterRef build_binned(std::span<const std::uint64_t>,
                                        std::span<const std::uint32_t>, const BoxLanes&,
                                        std::uint32_t, Buffer<ClusterNode>&, BinnedScratch&, int);

}  // namespace raydix
