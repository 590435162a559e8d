// build_bvh in double: boxes -> center -> float boxes around it -> a float tree over them or over
// parts -> corners in leaf order.
#include <raydix/double.h>
#include <raydix/error.h>

#include <algorithm>

#include "api/bvh_builder_access.h"
#include "api/bvh_builder_d.h"
#include "api/double_builds.h"
#include "api/refit_checks.h"
#include "exec/parallel.h"
#include "exec/progress.h"
#include "measure/stopwatch.h"
#include "primitives/double_sources.h"
#include "tree/bvh_access.h"
#include "tree/bvh_d_access.h"
#include "tree/median_center.h"

namespace raydix {

namespace {

void require_triangles_that_fit(const MeshViewD& mesh, const BoundsD& bounds, bool strict) {
    if (bounds.first_unreadable != no_primitive) {
        const Triangle& t = mesh.triangles[bounds.first_unreadable];
        throw InputError("triangle " + std::to_string(bounds.first_unreadable) + ": index " +
                         std::to_string(std::max({t[0], t[1], t[2]})) + " is past the last of " +
                         std::to_string(mesh.vertices.size()) + " vertices");
    }
    if (strict && bounds.left_out != 0)
        throw InputError("triangle " + std::to_string(bounds.first_left_out) +
                         ": not finite or out of range, as are " +
                         std::to_string(bounds.left_out - 1) + " others");
}

void copy_corners(const BvhDAccess& tree, const TriangleSourceD& source) {
    const std::span<const std::uint32_t> order = tree.bvh.order();
    tree.triangles().reset(order.size());
    for_each_index(order.size(),
                   [&](std::size_t k) { tree.triangles()[k] = source.corners(order[k]); });
}

void build(const MeshViewD& mesh, const BuildOptions& options, BvhBuilderD& builder,
           const BvhDAccess& tree) {
    Stopwatch total, stage;
    const std::size_t n = mesh.triangles.size();
    const TriangleSourceD source{mesh.vertices.data(), mesh.triangles.data(), mesh.vertices.size()};
    const BoundsD bounds = bounds_of(source, n);
    require_triangles_that_fit(mesh, bounds, options.strict);
    tree.place(bounds.box, center_of(source, n, bounds.box));
    BuildOptions over_boxes = options;
    over_boxes.strict = false;
    const std::span<const Aabb> boxes = local_boxes(source, n, tree, builder.boxes);
    const double before = stage.lap();
    {
        const ProgressStage nodes(0.1, 0.9);
        progress_at(0);
        BvhBuilderAccess::build_around(builder.nodes, boxes, {mesh, tree.center(), tree.scale()},
                                       over_boxes, tree.tree());
    }
    if (!builder.keeps_scratch) builder = {};
    stage.lap();
    copy_corners(tree, source);
    BuildMs ms = tree.tree().build_ms();
    ms.bounds += before;
    ms.layout += stage.lap();
    ms.total = total.lap();
    tree.build_ms() = ms;
}

}  // namespace

std::uint64_t BvhD::bytes() const {
    return tree_.nodes().size_bytes() + order().size_bytes() + triangles().size_bytes();
}

void BvhBuilderD::build(const MeshViewD& mesh, const BuildOptions& options, BvhD& tree) {
    require_size(mesh.triangles.size());
    with_threads(options.threads, [&] { raydix::build(mesh, options, *this, {tree}); });
}

void forget_peak(BvhD& tree) { BvhAccess{BvhDAccess{tree}.tree()}.peak_bytes() = 0; }

BvhD build_bvh(const MeshViewD& mesh, const BuildOptions& options) {
    BvhD bvh;
    BvhBuilderD{.keeps_scratch = false}.build(mesh, options, bvh);
    return bvh;
}

BvhD build_bvh(const MeshD& mesh, const BuildOptions& options) {
    return build_bvh(MeshViewD(mesh), options);
}

RefitQuality refit(BvhD& bvh, const MeshViewD& mesh, int threads) {
    require_whole(bvh.tree());
    const std::size_t n = mesh.triangles.size();
    require_same_count(bvh, n, "triangles");
    const TriangleSourceD source{mesh.vertices.data(), mesh.triangles.data(), mesh.vertices.size()};
    RefitQuality quality;
    with_threads(threads, [&] {
        const BoundsD bounds = bounds_of(source, n);
        require_triangles_that_fit(mesh, bounds, false);
        quality = refit_around_center<BvhDAccess>(bvh, source, bounds, "triangle", threads);
        copy_corners({bvh}, source);
    });
    return quality;
}

}  // namespace raydix
