// Rays through geometry of the caller's own: a tree over boxes, and a function that knows what is
// in them. Spheres, capsules and points with a radius come with the library.
#pragma once

#include <raydix/bvh.h>
#include <raydix/shapes.h>
#include <raydix/trace.h>
#include <raydix/types.h>

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

namespace raydix {

/// Whether `ray` hits primitive `prim`, a position in the boxes that the tree was built over; if
/// so, where: a finite hit.t in [ray.tmin, ray.tmax] (others are no hits; -0 becomes +0), and hit.u
/// and hit.v as it likes.
/// `ray` is the caller's, with tmax cut to the best hit so far. Called from several threads at
/// once, in any order, at least once for each primitive that may have the closest hit.
using IntersectPrimitive = std::function<bool(std::uint32_t prim, const Ray& ray, Hit& hit)>;

/// Closest hit of each ray: the least (t, prim) that `intersect` gives. The same for every builder
/// and thread count, if it is within its box up to 2^-17 of t. rays [n] -> hits [n]. Only the
/// threads of `options` and its counters (tests: calls of `intersect`) are used. Throws InputError
/// if the sizes differ, and what `intersect` throws.
TraceCounts trace(const Bvh& boxes, const IntersectPrimitive& intersect, std::span<const Ray> rays,
                  std::span<Hit> hits, const TraceOptions& options = {});
/// Whether each ray hits anything: 1 or 0. rays [n] -> occluded [n].
TraceCounts trace_any(const Bvh& boxes, const IntersectPrimitive& intersect,
                      std::span<const Ray> rays, std::span<std::uint8_t> occluded,
                      const TraceOptions& options = {});
[[nodiscard]] Hit closest_hit(const Bvh& boxes, const IntersectPrimitive& intersect,
                              const Ray& ray);
[[nodiscard]] bool any_hit(const Bvh& boxes, const IntersectPrimitive& intersect, const Ray& ray);

/// Boxes to build the tree over, rounded outward; invalid shapes get boxes that builders leave out.
[[nodiscard]] std::vector<Aabb> boxes_of(std::span<const Sphere> spheres);
[[nodiscard]] std::vector<Aabb> boxes_of(std::span<const Capsule> capsules);
[[nodiscard]] std::vector<Aabb> boxes_of(std::span<const Vec3> points, float radius);

/// The surfaces of the shapes, from both sides: a ray that starts inside hits where it leaves. In
/// double inside. hit.u of a capsule is the place along its axis, 0 at a and 1 at b; else 0. The
/// arrays must outlive the function and be those that the tree was built over.
[[nodiscard]] IntersectPrimitive intersect_spheres(std::span<const Sphere> spheres);
[[nodiscard]] IntersectPrimitive intersect_capsules(std::span<const Capsule> capsules);
[[nodiscard]] IntersectPrimitive intersect_points(std::span<const Vec3> points, float radius);

}  // namespace raydix
