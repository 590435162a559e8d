// Meshes with double coordinates: trees, rays and queries whose answers are computed in double.
// For geometry far from the origin (georeferenced, CAD), where float32 has steps of half a metre at
// 5,000,000, and for answers with more than seven digits.
//
// The rules are those of the float calls of the same names: ties, edges, limits, invalid input and
// its counts. Answers are pure functions of the caller's doubles, so they have the same bits for
// every builder and number of threads. Winding numbers (<raydix/solid.h>), and what follows from
// them on open meshes, are sums over the tree: the same for every number of threads, not for every
// builder. Doubles below 2^-500 in magnitude count as 0.
#pragma once

#include <raydix/bvh.h>
#include <raydix/closest.h>
#include <raydix/mesh.h>
#include <raydix/overlap.h>
#include <raydix/pairs.h>
#include <raydix/refit.h>
#include <raydix/shapes.h>
#include <raydix/trace.h>
#include <raydix/types.h>

#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace raydix {

/// A tree over triangles in double. Its leaves hold the corners as the caller gave them. Its nodes
/// are those of a float tree over boxes around the triangles or, with the builders split and sbvh,
/// around their parts. The boxes are moved so that `center()`, near which most triangles are, is at
/// 0. They are scaled down where the scene reaches farther than 2^39 (`scale()`), and rounded
/// outward. Where detail is finer than 2^-24 of its distance from the center, boxes overlap more
/// than they need to: queries take longer, and are as right. Move-only.
class BvhD {
public:
    [[nodiscard]] bool empty() const { return tree_.empty(); }
    /// A tree of boxes; a point p of the scene is at (p - center()) * scale() in it.
    [[nodiscard]] const Bvh& tree() const { return tree_; }
    [[nodiscard]] Vec3d center() const { return center_; }
    /// 1, 1/2 or 1/4.
    [[nodiscard]] double scale() const { return scale_; }
    /// Position in leaf order -> the caller's triangle, [references].
    [[nodiscard]] std::span<const std::uint32_t> order() const { return tree_.order(); }
    /// Corners in leaf order, [references].
    [[nodiscard]] std::span<const LeafTriangleD> triangles() const { return triangles_.view(); }
    /// Around all triangles of the tree, exactly; lo > hi if there are none.
    [[nodiscard]] AabbD bounds() const { return bounds_; }

    [[nodiscard]] std::uint32_t max_depth() const { return tree_.max_depth(); }
    /// Triangles the caller gave, and how many of them were invalid and left out.
    [[nodiscard]] std::uint64_t input_count() const { return tree_.input_count(); }
    [[nodiscard]] std::uint64_t left_out() const { return tree_.left_out(); }
    /// Milliseconds of the float tree's stages; `total` is of all.
    [[nodiscard]] const BuildMs& build_ms() const { return build_ms_; }
    /// Every byte a trace touches.
    [[nodiscard]] std::uint64_t bytes() const;

private:
    friend struct BvhDInternals;
    Bvh tree_;
    Buffer<LeafTriangleD> triangles_;
    Vec3d center_{0.0, 0.0, 0.0};
    double scale_ = 1.0;
    AabbD bounds_{{infinity, infinity, infinity}, {-infinity, -infinity, -infinity}};
    BuildMs build_ms_;
};

/// Builds a tree over the mesh's triangles. A mesh without any gives an empty tree. Triangles with
/// a coordinate that is not finite or beyond 1e12, and those with a diagonal in (0, 1e-12), are
/// left out and counted. Throws InputError: an option out of range, a vertex index past the end,
/// 2^31 triangles or more; with `options.strict` the first triangle that would be left out.
[[nodiscard]] BvhD build_bvh(const MeshViewD& mesh, const BuildOptions& options = {});
[[nodiscard]] BvhD build_bvh(const MeshD& mesh, const BuildOptions& options = {});
[[nodiscard]] std::vector<BvhD> build_many(std::span<const MeshViewD> meshes,
                                           const BuildOptions& options = {});

/// Gives the tree new corners for the same number of triangles in the same order; the hierarchy is
/// kept. Throws InputError as Refitter::refit does; here the tree is unchanged in every case.
RefitQuality refit(BvhD& bvh, const MeshViewD& mesh, int threads = 0);

/// Finds the closest hit of each ray, the least (t, prim), by the watertight test of Woop, Benthin
/// and Wald (2013) in double. rays [n] -> hits [n]. Of the options only `threads` and `counters`
/// are used. Throws InputError if the sizes differ.
TraceCounts trace(const BvhD& bvh, std::span<const RayD> rays, std::span<HitD> hits,
                  const TraceOptions& options = {});
[[nodiscard]] std::vector<HitD> trace(const BvhD& bvh, std::span<const RayD> rays,
                                      const TraceOptions& options = {});
TraceCounts trace_any(const BvhD& bvh, std::span<const RayD> rays, std::span<std::uint8_t> occluded,
                      const TraceOptions& options = {});

[[nodiscard]] AllHitsD trace_all(const BvhD& bvh, std::span<const RayD> rays,
                                 const TraceOptions& options = {});

[[nodiscard]] HitD closest_hit(const BvhD& bvh, const RayD& ray);
[[nodiscard]] bool any_hit(const BvhD& bvh, const RayD& ray);

/// The same answers by testing every triangle.
[[nodiscard]] std::vector<HitD> trace_brute_force(const MeshViewD& mesh, std::span<const RayD> rays,
                                                  int threads = 0);

/// Finds for each query the least (d2, prim). queries [n] -> results [n]. Throws InputError: sizes
/// that differ, a max_distance that is negative or NaN.
QueryCounts closest_points(const BvhD& bvh, std::span<const Vec3d> queries,
                           std::span<ClosestPointD> results, const ClosestOptionsD& options = {});
[[nodiscard]] std::vector<ClosestPointD> closest_points(const BvhD& bvh,
                                                        std::span<const Vec3d> queries,
                                                        const ClosestOptionsD& options = {});
[[nodiscard]] ClosestPointD closest_point(const BvhD& bvh, Vec3d query,
                                          double max_distance = infinity);

/// As the calls in <raydix/overlap.h>.
QueryCounts touch_any(const BvhD& bvh, std::span<const SegmentD> queries,
                      std::span<std::uint8_t> touched, const OverlapOptions& options = {});
QueryCounts touch_any(const BvhD& bvh, std::span<const SphereD> queries,
                      std::span<std::uint8_t> touched, const OverlapOptions& options = {});
[[nodiscard]] bool touches(const BvhD& bvh, const SegmentD& segment);
[[nodiscard]] bool touches(const BvhD& bvh, const SphereD& sphere);
[[nodiscard]] OverlapLists touch_all(const BvhD& bvh, std::span<const SegmentD> queries,
                                     const OverlapOptions& options = {});
[[nodiscard]] OverlapLists touch_all(const BvhD& bvh, std::span<const SphereD> queries,
                                     const OverlapOptions& options = {});

/// Finds the first contact of each sweep, as in <raydix/overlap.h>: the least (t, prim). sweeps [n]
/// -> hits [n]. Lengths are measured from the start, so that t and the place of the contact are as
/// exact far from the origin as the corners are. Throws InputError if the sizes differ.
QueryCounts sweep_spheres(const BvhD& bvh, std::span<const SphereSweepD> sweeps,
                          std::span<SweepHitD> hits, const OverlapOptions& options = {});
[[nodiscard]] std::vector<SweepHitD> sweep_spheres(const BvhD& bvh,
                                                   std::span<const SphereSweepD> sweeps,
                                                   const OverlapOptions& options = {});
[[nodiscard]] SweepHitD sweep_sphere(const BvhD& bvh, const SphereSweepD& sweep);

/// As the calls in <raydix/pairs.h>: boxes and triangles are those of the doubles.
[[nodiscard]] std::vector<PrimitivePair> overlapping_pairs(const BvhD& bvh,
                                                           const PairOptions& options = {});
[[nodiscard]] std::vector<PrimitivePair> overlapping_pairs(const BvhD& a, const BvhD& b,
                                                           const PairOptions& options = {});
[[nodiscard]] std::uint64_t count_overlapping_pairs(const BvhD& bvh,
                                                    const PairOptions& options = {});
[[nodiscard]] std::uint64_t count_overlapping_pairs(const BvhD& a, const BvhD& b,
                                                    const PairOptions& options = {});

}  // namespace raydix
