// The point of a mesh that is closest to a query, in batches over threads or one by one.
#pragma once

#include <raydix/batch.h>
#include <raydix/bvh.h>
#include <raydix/types.h>

#include <cstdint>
#include <span>
#include <vector>

namespace raydix {

/// Where a mesh comes closest to a query. `position` is (1-u-v)*v0 + u*v1 + v*v2 of triangle
/// `prim`, rounded once and not outside the triangle's box. `distance` is sqrt(d2) with d2 =
/// (dx*dx + dy*dy) + dz*dz from the query to `position`, without FMA. If nothing is found prim is
/// no_primitive and the distance infinity.
template <class Scalar>
struct BasicClosestPoint {
    BasicVec3<Scalar> position{infinity, infinity, infinity};
    Scalar distance = infinity;
    std::uint32_t prim = no_primitive;
    Scalar u = 0, v = 0;

    [[nodiscard]] constexpr bool found() const { return prim != no_primitive; }
};
using ClosestPoint = BasicClosestPoint<float>;
using ClosestPointD = BasicClosestPoint<double>;

/// Finds for each query the least (d2, prim) over all triangles of the tree. queries [n] -> results
/// [n], in any order. The answers have the same bits for every builder and number of threads.
/// Triangles without area count as segments or points (docs/contract.md 3). The square of a
/// distance above 1.8e19 is infinite, but the point is found. Throws InputError: sizes that differ,
/// a max_distance that is negative or NaN, a tree that holds boxes or points.
QueryCounts closest_points(const Bvh& bvh, std::span<const Vec3> queries,
                           std::span<ClosestPoint> results, const ClosestOptions& options = {});
[[nodiscard]] std::vector<ClosestPoint> closest_points(const Bvh& bvh,
                                                       std::span<const Vec3> queries,
                                                       const ClosestOptions& options = {});
/// One query, on the caller's thread.
[[nodiscard]] ClosestPoint closest_point(const Bvh& bvh, Vec3 query, float max_distance = infinity);

}  // namespace raydix
