// The one door to the private arrays of a Bvh, for builders and the file reader.
#pragma once

#include <raydix/bvh.h>

namespace raydix {

struct BvhInternals {
    Bvh& bvh;

    [[nodiscard]] Buffer<BvhNode>& nodes() const { return bvh.nodes_; }
    [[nodiscard]] Buffer<std::uint32_t>& order() const { return bvh.order_; }
    [[nodiscard]] Buffer<LeafTriangle>& triangles() const { return bvh.triangles_; }
    [[nodiscard]] Buffer<Aabb>& boxes() const { return bvh.boxes_; }
    [[nodiscard]] Buffer<Vec3>& points() const { return bvh.points_; }
    [[nodiscard]] PrimitiveKind& kind() const { return bvh.kind_; }
    [[nodiscard]] BuildOptions& options() const { return bvh.options_; }
    [[nodiscard]] std::uint32_t& inner_count() const { return bvh.inner_count_; }
    [[nodiscard]] std::uint32_t& max_depth() const { return bvh.max_depth_; }
    [[nodiscard]] std::uint64_t& input_count() const { return bvh.input_count_; }
    [[nodiscard]] std::uint64_t& left_out() const { return bvh.left_out_; }
    [[nodiscard]] bool& refitted() const { return bvh.refitted_; }
    [[nodiscard]] BuildMs& build_ms() const { return bvh.build_ms_; }
    [[nodiscard]] std::uint64_t& peak_bytes() const { return bvh.peak_bytes_; }

    /// No nodes, no primitives; the memory stays.
    void make_empty() const {
        nodes().reset(0);
        order().reset(0);
        triangles().reset(0);
        boxes().reset(0);
        points().reset(0);
        inner_count() = 0;
        max_depth() = 0;
    }
};

}  // namespace raydix
