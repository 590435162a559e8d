// The one door to the private arrays of a KdTree, for its builder and for tests that break trees.
#pragma once

#include <raydix/kdtree.h>

namespace raydix {

struct KdTreeInternals {
    KdTree& tree;

    [[nodiscard]] Buffer<KdNode>& nodes() const { return tree.nodes_; }
    [[nodiscard]] Buffer<std::uint32_t>& order() const { return tree.order_; }
    [[nodiscard]] Buffer<LeafTriangle>& triangles() const { return tree.triangles_; }
    [[nodiscard]] Buffer<Vec3>& points() const { return tree.points_; }
    [[nodiscard]] PrimitiveKind& kind() const { return tree.kind_; }
    [[nodiscard]] KdTreeOptions& options() const { return tree.options_; }
    [[nodiscard]] Aabb& bounds() const { return tree.bounds_; }
    [[nodiscard]] std::uint32_t& inner_count() const { return tree.inner_count_; }
    [[nodiscard]] std::uint32_t& max_depth() const { return tree.max_depth_; }
    [[nodiscard]] std::uint64_t& input_count() const { return tree.input_count_; }
    [[nodiscard]] std::uint64_t& left_out() const { return tree.left_out_; }
    [[nodiscard]] BuildMs& build_ms() const { return tree.build_ms_; }
    [[nodiscard]] std::uint64_t& peak_bytes() const { return tree.peak_bytes_; }
};

}  // namespace raydix
