// The one door to the private arrays of an Octree, for its builder.
#pragma once

#include <raydix/octree.h>

namespace raydix {

struct OctreeInternals {
    Octree& octree;

    [[nodiscard]] Buffer<OctreeNode>& nodes() const { return octree.nodes_; }
    [[nodiscard]] Buffer<std::uint32_t>& order() const { return octree.order_; }
    [[nodiscard]] Buffer<Vec3>& points() const { return octree.points_; }
    [[nodiscard]] std::array<std::uint32_t, 23>& level_begin() const { return octree.level_begin_; }
    [[nodiscard]] PrimitiveKind& kind() const { return octree.kind_; }
    [[nodiscard]] OctreeOptions& options() const { return octree.options_; }
    [[nodiscard]] Aabb& bounds() const { return octree.bounds_; }
    [[nodiscard]] std::uint64_t& input_count() const { return octree.input_count_; }
    [[nodiscard]] std::uint64_t& left_out() const { return octree.left_out_; }
    [[nodiscard]] BuildMs& build_ms() const { return octree.build_ms_; }
    [[nodiscard]] std::uint64_t& peak_bytes() const { return octree.peak_bytes_; }
};

}  // namespace raydix
