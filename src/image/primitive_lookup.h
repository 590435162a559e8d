// Primitive id -> corners. Trees keep triangles in leaf order; hits name them by the caller's ids.
#pragma once

#include <raydix/bvh.h>

#include <atomic>
#include <cstdint>
#include <vector>

#include "exec/parallel.h"

namespace raydix {

/// The inverse of Bvh::order(), 4 bytes for each primitive the caller gave. Build it once for many
/// batches; the tree must outlive it.
class PrimitiveLookup {
public:
    explicit PrimitiveLookup(const Bvh& bvh)
        : triangles_(bvh.triangles()), positions_(bvh.input_count(), not_in_tree) {
        const auto order = bvh.order();
        for_each_index(order.size(), [&](std::size_t position) {
            // Relaxed, since in trees with splits several leaves hold one primitive: any of them
            // will do.
            std::atomic_ref(positions_[order[position]])
                .store(static_cast<std::uint32_t>(position), std::memory_order_relaxed);
        });
    }

    [[nodiscard]] bool contains(std::uint32_t primitive_id) const {
        return primitive_id < positions_.size() && positions_[primitive_id] != not_in_tree;
    }
    [[nodiscard]] const LeafTriangle& triangle(std::uint32_t primitive_id) const {
        return triangles_[positions_[primitive_id]];
    }

private:
    static constexpr std::uint32_t not_in_tree = 0xFFFFFFFFu;
    std::span<const LeafTriangle> triangles_;
    std::vector<std::uint32_t> positions_;
};

}  // namespace raydix
