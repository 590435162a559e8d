// A wide tree over triangles in double: the nodes of trees in float (layout/wide_bvh.h) around a
// center, where most triangles are, and blocks of corners in double.
#pragma once

#include <raydix/buffer.h>
#include <raydix/double.h>
#include <raydix/scene.h>

#include <cstdint>
#include <memory>

#include "layout/wide_bvh.h"
#include "trace/double_tree.h"
#include "trace/simd/wide_ray.h"

namespace raydix {

/// Four triangles, one a lane: corner[3 * vertex + axis][lane].
struct alignas(64) TriangleBlockD {
    double corner[9][block_lanes];
    std::uint32_t prim[block_lanes];

    void set(std::uint32_t lane, const LeafTriangleD& t, std::uint32_t id) {
        const Vec3d corners[3] = {t.v0, t.v1, t.v2};
        for (int v = 0; v < 3; ++v) {
            corner[3 * v][lane] = corners[v].x;
            corner[3 * v + 1][lane] = corners[v].y;
            corner[3 * v + 2][lane] = corners[v].z;
        }
        prim[lane] = id;
    }
    [[nodiscard]] LeafTriangleD triangle(std::uint32_t lane) const {
        const auto at = [&](int v) {
            return Vec3d{corner[3 * v][lane], corner[3 * v + 1][lane], corner[3 * v + 2][lane]};
        };
        return {at(0), at(1), at(2)};
    }
};
static_assert(sizeof(TriangleBlockD) == 320);

/// Float boxes around a center in double, as rays in double need them. Planes are about the center
/// (WideView::middle is 0), and farther out by what rays lose there (grown_plane).
struct NodesD {
    WideBvh::Arrays arrays;  // nodes, bounds and figures alone
    WideView view{};
    TreeSpace space{{0.0, 0.0, 0.0}, 1.0};
    // By axis, the last is 0: the center, and the bounds around it.
    alignas(32) double center[4]{}, lo[4]{}, hi[4]{};
    double size = 0;  // of the bounds, along their longest axis

    NodesD() = default;
    NodesD(const NodesD&) = delete;  // `view` names its own bounds
    NodesD& operator=(const NodesD&) = delete;

    [[nodiscard]] bool empty() const { return arrays.nodes.empty(); }
    /// When the arrays and the space are there.
    void set_view();
};

/// A plane at p from the center stands at p and |p| 5 u to its outside, u = 2^-24: what float rays
/// round in proportion to it (docs/algorithms/double.md).
[[nodiscard]] float grown_plane(float p, bool upper);
[[nodiscard]] Aabb grown_planes(const Aabb& box);

struct WideTreeD : NodesD {
    Buffer<TriangleBlockD> blocks;
    AabbD bounds{};  // of all triangles that are not left out, without area too; exactly
    std::uint64_t input_count = 0;
    bool has_parts = false;     // of triangles
    bool suits_packets = true;  // few triangles lie far from the others

    [[nodiscard]] std::uint64_t bytes() const {
        return arrays.nodes.size() * sizeof(WideNode) + blocks.size() * sizeof(TriangleBlockD);
    }
};

/// Triangles without area are left out.
[[nodiscard]] std::shared_ptr<const WideTreeD> build_wide_tree(const MeshViewD& mesh,
                                                               const BuildOptions& options);

/// The nodes of `tree` around the same triangles where they are now, around the center that they
/// have now. Null where a new tree would hold other triangles, or where it has parts of triangles.
[[nodiscard]] std::shared_ptr<const WideTreeD> refit_wide_tree(const WideTreeD& tree,
                                                               const MeshViewD& mesh);

}  // namespace raydix
