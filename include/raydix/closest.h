// The point of a mesh that is closest to a query, in batches over threads or one by one.
#pragma once

#include <raydix/bvh.h>
#include <raydix/types.h>

#include <cstdint>
#include <span>
#include <vector>

namespace raydix {

/// Where a mesh comes closest to a query. `position` is (1-u-v)*v0 + u*v1 + v*v2 of triangle
/// `prim`, rounded to float and not outside the triangle's box. `distance` is sqrtf(d2) with d2 =
/// (dx*dx + dy*dy) + dz*dz in float32 from the query to `position`, without FMA. If nothing is
/// found prim is no_primitive and the distance infinity.
struct ClosestPoint {
    Vec3 position{infinity, infinity, infinity};
    float distance = infinity;
    std::uint32_t prim = no_primitive;
    float u = 0.0f, v = 0.0f;

    [[nodiscard]] constexpr bool found() const { return prim != no_primitive; }
};

struct ClosestOptions {
    float max_distance = infinity;  // only points with d2 <= R*R are found. A small one saves time
    int threads = 0;  // 0 to 1,024; 0: all the machine has. Results do not depend on it
};

/// What a batch met.
struct ClosestCounts {
    std::uint64_t queries = 0;
    std::uint64_t found = 0;
    std::uint64_t invalid_queries = 0;  // a coordinate is NaN or Inf: nothing is near
};

/// Finds for each query the least (d2, prim) over all triangles of the tree. queries [n] -> results
/// [n], in any order. The answers have the same bits for every builder and number of threads.
/// Triangles without area count as segments or points (docs/contract.md 3). The square of a
/// distance above 1.8e19 is infinite, but the point is found. Throws InputError: sizes that differ,
/// a max_distance that is negative or NaN, a tree that holds boxes or points.
ClosestCounts closest_points(const Bvh& bvh, std::span<const Vec3> queries,
                             std::span<ClosestPoint> results, const ClosestOptions& options = {});
[[nodiscard]] std::vector<ClosestPoint> closest_points(const Bvh& bvh,
                                                       std::span<const Vec3> queries,
                                                       const ClosestOptions& options = {});
/// One query, on the caller's thread.
[[nodiscard]] ClosestPoint closest_point(const Bvh& bvh, Vec3 query, float max_distance = infinity);

}  // namespace raydix
