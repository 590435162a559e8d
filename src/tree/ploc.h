// Parallel locally-ordered clustering: primitives in Morton order are clusters; in each round every
// cluster looks for its nearest neighbour a few places left and right, and those that chose each
// other merge (Meister and Bittner 2018; the search that computes each pair once follows Benthin et
// al. 2022, "PLOC++").
#pragma once

#include <raydix/buffer.h>

#include <array>
#include <cstdint>
#include <span>

#include "tree/cluster.h"

namespace raydix {

/// Boxes as six arrays, lo x y z hi x y z, with boxes of infinite area on both sides, so that
/// searches need not know where the list ends.
class BoxLanes {
public:
    static constexpr std::uint32_t margin = 128;

    void reset(std::uint32_t capacity);
    /// Puts the box of infinite area on all places of the margin behind `count`.
    void close(std::uint32_t count);

    [[nodiscard]] const float* lane(std::size_t k) const { return lanes_[k]; }
    void set(std::uint32_t i, const Aabb& box) {
        lanes_[0][i] = box.lo.x;
        lanes_[1][i] = box.lo.y;
        lanes_[2][i] = box.lo.z;
        lanes_[3][i] = box.hi.x;
        lanes_[4][i] = box.hi.y;
        lanes_[5][i] = box.hi.z;
    }
    [[nodiscard]] Aabb get(std::uint32_t i) const {
        return {{lanes_[0][i], lanes_[1][i], lanes_[2][i]},
                {lanes_[3][i], lanes_[4][i], lanes_[5][i]}};
    }
    [[nodiscard]] std::size_t capacity_bytes() const { return memory_.capacity_bytes(); }

private:
    Buffer<float> memory_;
    std::array<float*, 6> lanes_{};
};

struct PlocOptions {
    /// Places to search on each side, up to max_radius. More costs time in proportion and hardly
    /// changes SAH (docs/algorithms/ploc.md).
    std::uint32_t radius = 8;
};

/// A list of clusters in Morton order.
struct ClusterList {
    BoxLanes boxes;
    Buffer<ClusterRef> refs;
};

/// Memory kept from one build to the next.
struct PlocScratch {
    BoxLanes primitives;               // [n], the caller fills them in Morton order
    std::array<ClusterList, 2> lists;  // of one round and the next
    Buffer<ClusterNode> nodes;         // [n - 1] after a build
    Buffer<std::int8_t> partners;
    Buffer<std::uint32_t> block_sums;

    [[nodiscard]] std::size_t capacity_bytes() const;
};

/// scratch.primitives [n], n >= 1, and their ids [n] in Morton order -> scratch.nodes [n - 1],
/// children before parents. Returns the root, which is a primitive if n = 1.
ClusterRef build_ploc(std::span<const std::uint32_t> ids, std::uint32_t max_leaf,
                      PlocScratch& scratch, const PlocOptions& options = {});

}  // namespace raydix
