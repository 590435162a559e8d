// What a segment or a sphere touches of a mesh, and where a moving sphere first does.
#pragma once

#include <raydix/batch.h>
#include <raydix/bvh.h>
#include <raydix/shapes.h>
#include <raydix/types.h>

#include <cstdint>
#include <span>
#include <vector>

namespace raydix {

struct OverlapOptions {
    /// touch_all only: the most bytes that the call may hold. 0: half of what is left to the
    /// process (result_limit.h).
    std::uint64_t max_result_bytes = 0;
    int threads = 0;  // 0 to 1,024; 0: all the machine has. Results do not depend on it
};

/// Says whether each query has a point in common with any triangle: 1 or 0. queries [n] -> touched
/// [n]. Segments are decided without rounding, triangles in their plane and triangles without area
/// included. A sphere touches a triangle if d2 <= radius * radius with the d2 of closest_points.
/// Throws InputError: sizes that differ, a tree that holds boxes or points.
QueryCounts touch_any(const Bvh& bvh, std::span<const Segment> queries,
                      std::span<std::uint8_t> touched, const OverlapOptions& options = {});
QueryCounts touch_any(const Bvh& bvh, std::span<const Sphere> queries,
                      std::span<std::uint8_t> touched, const OverlapOptions& options = {});
[[nodiscard]] bool touches(const Bvh& bvh, const Segment& segment);
[[nodiscard]] bool touches(const Bvh& bvh, const Sphere& sphere);

/// All triangles that each query touches. Those of query i are [offsets[i], offsets[i + 1]) of
/// `prims`, ascending.
struct OverlapLists {
    std::vector<std::uint64_t> offsets;  // [queries + 1]
    std::vector<std::uint32_t> prims;
    QueryCounts counts;
};

/// As touch_any, but lists all triangles that each query touches. None is ever dropped. Throws
/// ResultTooLarge, an InputError, if the call would take more than options.max_result_bytes.
[[nodiscard]] OverlapLists touch_all(const Bvh& bvh, std::span<const Segment> queries,
                                     const OverlapOptions& options = {});
[[nodiscard]] OverlapLists touch_all(const Bvh& bvh, std::span<const Sphere> queries,
                                     const OverlapOptions& options = {});

/// The first contact. The ball touches triangle `prim` at `position`, (1-u-v)*v0 + u*v1 + v*v2,
/// when its center is at t; with a radius that is its closest point, as closest_points has it. A
/// ball that touches at the start has t = tmin.
template <class Scalar>
struct BasicSweepHit {
    Scalar t = infinity;
    std::uint32_t prim = no_primitive;
    BasicVec3<Scalar> position{infinity, infinity, infinity};
    Scalar u = 0, v = 0;

    [[nodiscard]] constexpr bool hit() const { return prim != no_primitive; }
};
using SweepHit = BasicSweepHit<float>;
using SweepHitD = BasicSweepHit<double>;

/// Finds the first contact of each sweep: the least (t, prim) with a finite t. sweeps [n] -> hits
/// [n]. The answers have the same bits for every builder and number of threads. They are computed
/// in double. Throws InputError: sizes that differ, a tree that holds boxes or points.
QueryCounts sweep_spheres(const Bvh& bvh, std::span<const SphereSweep> sweeps,
                          std::span<SweepHit> hits, const OverlapOptions& options = {});
[[nodiscard]] std::vector<SweepHit> sweep_spheres(const Bvh& bvh,
                                                  std::span<const SphereSweep> sweeps,
                                                  const OverlapOptions& options = {});
[[nodiscard]] SweepHit sweep_sphere(const Bvh& bvh, const SphereSweep& sweep);

}  // namespace raydix
