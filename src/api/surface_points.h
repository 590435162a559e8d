// Hits -> the points that secondary rays start from. What render and make_secondary_rays share.
#pragma once

#include <raydix/bvh.h>
#include <raydix/types.h>

#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "api/primitive_lookup.h"
#include "rays/hemisphere_rays.h"

namespace raydix {

/// Throws InputError "CALL needs a tree over triangles; this one holds ..." unless the tree is
/// empty or has them.
void require_triangles(const Bvh& bvh, std::string_view call);

/// `given`, or 5 % of the diagonal of the tree's box if it is 0. Throws InputError if it is
/// negative or NaN.
[[nodiscard]] float ao_radius_or_default(const Bvh& bvh, float given);

/// How far secondary rays of pictures start before their surface: the protocol's distance, but
/// never less than what float32 can tell apart at the coordinates of `box` (the protocol's rays do
/// without: they must stay comparable).
[[nodiscard]] double step_back_distance(const Aabb& box);

/// Positions of the rays that hit something, ascending.
[[nodiscard]] std::vector<std::uint32_t> positions_of_hits(std::span<const Hit> hits);

/// Origin `step_back` before the hit, geometric normal turned toward the ray.
[[nodiscard]] SurfacePoint surface_point(const PrimitiveLookup& lookup, const Ray& ray,
                                         const Hit& hit, std::uint32_t pixel, double step_back);

}  // namespace raydix
