// Rays through geometry of the caller's own whose coordinates are doubles: as
// <raydix/user_geometry.h>, for places where float32 has steps of half a metre.
#pragma once

#include <raydix/bvh.h>
#include <raydix/double.h>
#include <raydix/refit.h>
#include <raydix/trace.h>
#include <raydix/types.h>

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

namespace raydix {

/// A tree over boxes in double. As with BvhD its nodes are those of a float tree: the boxes, a
/// little larger (by 2^-43 of their largest coordinate), moved so that `center()` is at 0, scaled
/// by `scale()`, and rounded outward. The boxes themselves are not kept.
class BoxBvhD {
public:
    [[nodiscard]] bool empty() const { return tree_.empty(); }
    /// A point p of the scene is at (p - center()) * scale() in it.
    [[nodiscard]] const Bvh& tree() const { return tree_; }
    [[nodiscard]] Vec3d center() const { return center_; }
    /// 1, 1/2 or 1/4.
    [[nodiscard]] double scale() const { return scale_; }
    /// Position in leaf order -> the caller's box, [boxes that are not left out].
    [[nodiscard]] std::span<const std::uint32_t> order() const { return tree_.order(); }
    /// Around all boxes of the tree as they were given; lo > hi if there are none.
    [[nodiscard]] AabbD bounds() const { return bounds_; }

    [[nodiscard]] std::uint32_t max_depth() const { return tree_.max_depth(); }
    /// Boxes the caller gave, and how many of them were invalid and left out.
    [[nodiscard]] std::uint64_t input_count() const { return tree_.input_count(); }
    [[nodiscard]] std::uint64_t left_out() const { return tree_.left_out(); }
    /// Milliseconds of the float tree's stages; `total` is of all.
    [[nodiscard]] const BuildMs& build_ms() const { return build_ms_; }
    /// Every byte a trace touches, without the caller's own.
    [[nodiscard]] std::uint64_t bytes() const;

private:
    friend struct BoxBvhDAccess;
    Bvh tree_;
    Vec3d center_{0.0, 0.0, 0.0};
    double scale_ = 1.0;
    AabbD bounds_{};
    BuildMs build_ms_;
};

/// Builds a tree over `boxes`, which need not be kept. Boxes with lo > hi, with a coordinate that
/// is not finite or beyond 1e12, and those with a diagonal in (0, 1e-12), are left out and counted;
/// `options.strict` throws instead. Builders split and sbvh are sweep here. Same input, same tree,
/// for every thread count. Throws InputError: option out of range, 2^31 boxes or more.
[[nodiscard]] BoxBvhD build_bvh(std::span<const AabbD> boxes, const BuildOptions& options = {});

/// New boxes, as many and in the same order; the hierarchy is kept. Throws InputError that names a
/// box, the tree unchanged: another number of boxes, one of the tree that is not valid any more, or
/// one that was left out and is valid now.
RefitQuality refit(BoxBvhD& bvh, std::span<const AabbD> boxes, int threads = 0);

/// As IntersectPrimitive.
using IntersectPrimitiveD = std::function<bool(std::uint32_t prim, const RayD& ray, HitD& hit)>;

/// Closest hit of each ray: the least (t, prim) that `intersect` gives. The same for every builder
/// and thread count, if the ray is in the primitive's box at t, or at a place whose t is off by at
/// most 2^-41 of itself; where the box counts as larger on all sides by 2^-44 of its largest
/// coordinate (in magnitude) and 2^-44 of the longest distance along an axis from the ray's origin
/// to the far side of `boxes.bounds()`: some hundred roundings of a double each. rays [n] ->
/// hits [n]. Only the threads of `options` and its counters (tests: calls of `intersect`) are used.
/// Throws InputError if the sizes differ, and what `intersect` throws.
TraceCounts trace(const BoxBvhD& boxes, const IntersectPrimitiveD& intersect,
                  std::span<const RayD> rays, std::span<HitD> hits,
                  const TraceOptions& options = {});
/// Whether each ray hits anything: 1 or 0. rays [n] -> occluded [n].
TraceCounts trace_any(const BoxBvhD& boxes, const IntersectPrimitiveD& intersect,
                      std::span<const RayD> rays, std::span<std::uint8_t> occluded,
                      const TraceOptions& options = {});
[[nodiscard]] HitD closest_hit(const BoxBvhD& boxes, const IntersectPrimitiveD& intersect,
                               const RayD& ray);
[[nodiscard]] bool any_hit(const BoxBvhD& boxes, const IntersectPrimitiveD& intersect,
                           const RayD& ray);

/// Boxes to build the tree over, rounded outward; invalid shapes get boxes that builders leave out.
[[nodiscard]] std::vector<AabbD> boxes_of(std::span<const SphereD> spheres);
[[nodiscard]] std::vector<AabbD> boxes_of(std::span<const CapsuleD> capsules);
[[nodiscard]] std::vector<AabbD> boxes_of(std::span<const Vec3d> points, double radius);

/// The surfaces of the shapes, from both sides, as in <raydix/user_geometry.h>. Lengths are taken
/// from the ray's origin and from where it comes closest, so that neither a place far from 0 nor a
/// small shape far away costs digits: the point of the ray at t is within 2^-50 of (distance of the
/// origin from the shape + its length and radius) of the surface. What the ray passes or starts
/// from within that may be hit or missed. The arrays must outlive the function and be those that
/// the tree was built over.
[[nodiscard]] IntersectPrimitiveD intersect_spheres(std::span<const SphereD> spheres);
[[nodiscard]] IntersectPrimitiveD intersect_capsules(std::span<const CapsuleD> capsules);
[[nodiscard]] IntersectPrimitiveD intersect_points(std::span<const Vec3d> points, double radius);

}  // namespace raydix
