// build_bvh in double: boxes -> center -> float boxes around it -> a float tree over them or over
// parts -> corners in leaf order.
#include <raydix/buffer.h>
#include <raydix/double.h>
#include <raydix/error.h>

#include <algorithm>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "base/options.h"
#include "build/bvh_builder_double.h"
#include "build/bvh_builder_internals.h"
#include "build/refit_checks.h"
#include "exec/parallel.h"
#include "exec/progress.h"
#include "exec/search.h"
#include "measure/stopwatch.h"
#include "primitives/double_sources.h"
#include "tree/bvh_double_internals.h"
#include "tree/bvh_internals.h"
#include "tree/median_center.h"

namespace raydix {

namespace {

struct BoundsD {
    AabbD box{{infinity, infinity, infinity}, {-infinity, -infinity, -infinity}};
    std::uint64_t left_out = 0;
    std::uint32_t first_left_out = no_primitive;
    std::uint32_t first_unreadable = no_primitive;

    void add(const BoundsD& other) {
        box = {min_of(box.lo, other.box.lo), max_of(box.hi, other.box.hi)};
        left_out += other.left_out;
        first_left_out = std::min(first_left_out, other.first_left_out);
        first_unreadable = std::min(first_unreadable, other.first_unreadable);
    }
};

BoundsD bounds_of_range(const TriangleSourceD& source, std::size_t begin, std::size_t end) {
    BoundsD sum;
    for (std::size_t at = begin; at < end; ++at) {
        const auto i = static_cast<std::uint32_t>(at);
        AabbD box;
        if (!source.readable(i)) {
            sum.first_unreadable = std::min(sum.first_unreadable, i);
        } else if (source.box(i, box)) {
            sum.box = {min_of(sum.box.lo, box.lo), max_of(sum.box.hi, box.hi)};
        } else {
            ++sum.left_out;
            sum.first_left_out = std::min(sum.first_left_out, i);
        }
    }
    return sum;
}

BoundsD bounds_of(const TriangleSourceD& source, std::size_t n) {
    constexpr std::size_t block_size = 4096;
    std::vector<BoundsD> parts((n + block_size - 1) / block_size);
    for_each_block(n, block_size, [&](std::size_t block, std::size_t begin, std::size_t end) {
        parts[block] = bounds_of_range(source, begin, end);
    });
    BoundsD sum;
    for (const BoundsD& part : parts) sum.add(part);
    return sum;
}

Vec3d center_of(const TriangleSourceD& source, std::size_t n, const AabbD& bounds) {
    return median_center(
        n,
        [&](std::size_t i, AabbD& box) { return source.box(static_cast<std::uint32_t>(i), box); },
        bounds);
}

/// Into `boxes`. Triangles that are left out get a box that float builders leave out.
std::span<const Aabb> local_boxes(const TriangleSourceD& source, std::size_t n,
                                  const BvhDInternals& tree, Buffer<Aabb>& boxes) {
    boxes.reset(n);
    for_each_index(n, [&](std::size_t i) {
        AabbD box;
        const bool valid = source.box(static_cast<std::uint32_t>(i), box);
        boxes[i] = valid ? tree.local(box) : empty_box();
    });
    return boxes.view();
}

void require_size(std::size_t n) {
    if (n >= std::size_t{1} << 31)
        throw InputError(std::to_string(n) + " primitives; a tree takes fewer than 2147483648");
}

void require_triangles_that_fit(const MeshViewD& mesh, const BoundsD& bounds, bool strict) {
    if (bounds.first_unreadable != no_primitive) {
        const Triangle& t = mesh.triangles[bounds.first_unreadable];
        throw InputError("triangle " + std::to_string(bounds.first_unreadable) + ": index " +
                         std::to_string(std::max({t[0], t[1], t[2]})) + " is past the last of " +
                         std::to_string(mesh.vertices.size()) + " vertices");
    }
    if (strict && bounds.left_out != 0)
        throw InputError("triangle " + std::to_string(bounds.first_left_out) +
                         ": not finite or out of range" + others_too(bounds.left_out));
}

void copy_corners(const BvhDInternals& tree, const TriangleSourceD& source) {
    const std::span<const std::uint32_t> order = tree.bvh.order();
    tree.triangles().reset(order.size());
    for_each_index_to_the_end(
        order.size(), [&](std::size_t k) { tree.triangles()[k] = source.corners(order[k]); });
}

void build(const MeshViewD& mesh, const BuildOptions& options, BvhBuilderD& builder,
           const BvhDInternals& tree) {
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
        BvhBuilderInternals::build_around(builder.nodes, boxes, {mesh, tree.center(), tree.scale()},
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

/// Each triangle of the tree is still valid, and no other one is: what the float tree over boxes
/// would find too, but could not name.
void require_same_valid(const BvhD& bvh, const TriangleSourceD& source, std::uint64_t left_out) {
    if (left_out == 0 && bvh.left_out() == 0) return;
    const auto valid = [&](std::uint32_t i) {
        AabbD box;
        return source.box(i, box);
    };
    const std::size_t n = bvh.order().size();
    const std::size_t bad =
        first_index_where(n, [&](std::size_t k) { return !valid(bvh.order()[k]); });
    if (bad != n) {
        std::uint32_t first = bvh.order()[bad];
        for (const std::uint32_t i : bvh.order())
            if (i < first && !valid(i)) first = i;
        throw InputError("refit: triangle " + std::to_string(first) +
                         " is not finite or out of range now");
    }
    if (left_out != bvh.left_out())
        throw InputError("refit: " + std::to_string(bvh.left_out() - left_out) +
                         " triangle(s) were left out when the tree was built, but are valid now");
}

}  // namespace

std::uint64_t BvhD::bytes() const {
    return tree_.nodes().size_bytes() + order().size_bytes() + triangles().size_bytes();
}

void BvhBuilderD::build(const MeshViewD& mesh, const BuildOptions& options, BvhD& tree) {
    require_size(mesh.triangles.size());
    with_threads(options.threads, [&] { raydix::build(mesh, options, *this, {tree}); });
}

void forget_peak(BvhD& tree) { BvhInternals{BvhDInternals{tree}.tree()}.peak_bytes() = 0; }

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
    if (n != bvh.input_count())
        throw InputError("refit: " + std::to_string(n) +
                         " triangles, but the tree was built from " +
                         std::to_string(bvh.input_count()));
    const TriangleSourceD source{mesh.vertices.data(), mesh.triangles.data(), mesh.vertices.size()};
    RefitQuality quality;
    with_threads(threads, [&] {
        const BoundsD bounds = bounds_of(source, n);
        require_triangles_that_fit(mesh, bounds, false);
        require_same_valid(bvh, source, bounds.left_out);
        // The hierarchy kept, boxes around the center that the triangles have now. On an error the
        // tree is as it was.
        BvhD moved;
        const BvhDInternals to{moved}, tree{bvh};
        const Vec3d center = center_of(source, n, bounds.box);
        to.place(bounds.box, center);
        Buffer<Aabb> boxes;
        quality = refit(tree.tree(), local_boxes(source, n, to, boxes), threads);
        tree.place(bounds.box, center);
        copy_corners(tree, source);
    });
    return quality;
}

}  // namespace raydix
