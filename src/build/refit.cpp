// Refit: first everything that can be found wrong without touching the tree, then one pass over it.
#include <raydix/error.h>
#include <raydix/refit.h>

#include <algorithm>
#include <string>
#include <utility>

#include "base/float_env.h"
#include "build/refit_checks.h"
#include "exec/search.h"
#include "layout/refit_walk.h"
#include "primitives/bounds.h"
#include "tree/bvh_internals.h"

namespace raydix {
namespace {

constexpr const char* kind_names[] = {"triangle", "box", "point"};

std::string count_text(std::uint64_t n, PrimitiveKind kind) {
    return std::to_string(n) + (kind == PrimitiveKind::triangles ? " triangles"
                                : kind == PrimitiveKind::boxes   ? " boxes"
                                                                 : " points");
}

void require_fit(const Bvh& bvh, PrimitiveKind kind, std::size_t n) {
    require_whole(bvh);
    if (n == bvh.input_count() && (kind == bvh.kind() || n == 0)) return;
    throw InputError("refit: " + count_text(n, kind) + ", but the tree was built from " +
                     count_text(bvh.input_count(), bvh.kind()));
}

/// Each primitive of the tree is still valid, and no other one is.
template <class Source>
void require_same_valid(const Bvh& bvh, const Source& source) {
    const char* kind = kind_names[static_cast<int>(bvh.kind())];
    const auto valid = [&](std::uint32_t i) {
        Box3 box;
        return host_box(source, i, box);
    };
    const std::size_t bad = first_index_where(
        bvh.order().size(), [&](std::size_t k) { return !valid(bvh.order()[k]); });
    if (bad != bvh.order().size())
        throw InputError("refit: " + std::string(kind) + ' ' + std::to_string(bvh.order()[bad]) +
                         " is not finite or out of range now");
    const auto n = static_cast<std::uint32_t>(bvh.input_count());
    const Bounds bounds = scene_bounds(source, n);
    if (bounds.left_out != bvh.left_out())
        throw InputError("refit: " + std::to_string(bvh.left_out() - bounds.left_out) + ' ' + kind +
                         "(s) were left out when the tree was built, but are valid now");
}

/// A short way to the same answer in most cases: all vertices are fine, and nothing was left out.
bool all_in_range(std::span<const Vec3> points) {
    return first_index_where(points.size(), [&](std::size_t i) { return !in_range(points[i]); }) ==
           points.size();
}

void require_indices(const MeshView& mesh) {
    const TriangleSource source{mesh.vertices.data(), mesh.triangles.data(), mesh.vertices.size()};
    const std::size_t bad = first_index_where(mesh.triangles.size(), [&](std::size_t i) {
        return !source.readable(static_cast<std::uint32_t>(i));
    });
    if (bad != mesh.triangles.size())
        throw InputError("triangle " + std::to_string(bad) + ": index past the last of " +
                         std::to_string(mesh.vertices.size()) + " vertices");
}

double cost_of(const Bvh& bvh, int threads) {
    return tree_stats(bvh, {.with_hash = false, .threads = threads}).sah.value_or(0.0);
}

/// Arrays of a tree from a file may lie in read-only memory.
template <class T>
void make_writable(Buffer<T>& buffer) {
    if (buffer.empty() || buffer.capacity_bytes() != 0) return;
    Buffer<T> own(buffer.size());
    std::copy(buffer.view().begin(), buffer.view().end(), own.data());
    buffer = std::move(own);
}

template <class Source, class Copy>
double refit_all(Bvh& bvh, const Source& source, Buffer<Copy>& copies) {
    const BvhInternals tree{bvh};
    const char* kind = kind_names[static_cast<int>(bvh.kind())];
    make_writable(tree.nodes());
    make_writable(copies);
    const RefitSum sum = RefitWalk<Source, Copy>(source, bvh.order(), tree.nodes().data(),
                                                 copies.data(), bvh.max_depth())
                             .run();
    if (sum.first_bad != no_primitive) {
        bvh = Bvh();
        throw InputError("refit: " + std::string(kind) + ' ' + std::to_string(sum.first_bad) +
                         " is too small now; the tree is empty");
    }
    tree.refitted() = true;
    const double area = half_area(bvh.bounds());
    return area > 0.0 ? sum.cost / area : 0.0;
}

RefitQuality quality_of(double sah, double sah_at_build) {
    return {sah, sah_at_build, sah > 0.0 && sah_at_build > 0.0 ? sah / sah_at_build : 1.0};
}

}  // namespace

Refitter::Refitter(const Bvh& built, int threads) : sah_at_build_(cost_of(built, threads)) {
    require_whole(built);
}

RefitQuality Refitter::refit(Bvh& bvh, const MeshView& mesh, int threads) const {
    const FloatEnvironment plain;
    const bool points = mesh.triangles.empty();
    const auto kind = points ? PrimitiveKind::points : PrimitiveKind::triangles;
    require_fit(bvh, kind, points ? mesh.vertices.size() : mesh.triangles.size());
    double sah = 0.0;
    with_threads(threads, [&] {
        require_indices(mesh);
        const TriangleSource triangles{mesh.vertices.data(), mesh.triangles.data(),
                                       mesh.vertices.size()};
        const PointSource places{mesh.vertices.data()};
        if (bvh.left_out() != 0 || !all_in_range(mesh.vertices))
            points ? require_same_valid(bvh, places) : require_same_valid(bvh, triangles);
        if (bvh.empty()) return;
        sah = points ? refit_all(bvh, places, BvhInternals{bvh}.points())
                     : refit_all(bvh, triangles, BvhInternals{bvh}.triangles());
    });
    return quality_of(sah, sah_at_build_);
}

RefitQuality Refitter::refit(Bvh& bvh, std::span<const Aabb> boxes, int threads) const {
    const FloatEnvironment plain;
    require_fit(bvh, PrimitiveKind::boxes, boxes.size());
    double sah = 0.0;
    with_threads(threads, [&] {
        const BoxSource source{boxes.data()};
        require_same_valid(bvh, source);
        if (!bvh.empty()) sah = refit_all(bvh, source, BvhInternals{bvh}.boxes());
    });
    return quality_of(sah, sah_at_build_);
}

RefitQuality refit(Bvh& bvh, const MeshView& mesh, int threads) {
    return Refitter(bvh).refit(bvh, mesh, threads);
}

RefitQuality refit(Bvh& bvh, std::span<const Aabb> boxes, int threads) {
    return Refitter(bvh).refit(bvh, boxes, threads);
}

}  // namespace raydix
