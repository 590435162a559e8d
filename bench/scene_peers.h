// Embree in `bench scene`.
#pragma once

#include <raydix/bvh.h>

#include "scene_side.h"
#include "scene_subjects.h"

namespace raydix::bench {

/// The same on both sides.
using PeerOptions = SubjectOptions;

/// One side for each of Embree's trees that stand beside ours of this quality: LOW; MEDIUM; MEDIUM
/// and HIGH; and each with the flag ROBUST, for single calls. What is given must outlive them.
using EmbreeSides = std::vector<std::unique_ptr<RaySide>>;
[[nodiscard]] EmbreeSides embree_meshes(const Mesh& mesh, const PeerOptions& options);
/// Triangles that accept(prim) takes away from rays, by filter functions.
[[nodiscard]] EmbreeSides embree_filtered_meshes(const Mesh& mesh, AcceptPrimitive accept,
                                                 const PeerOptions& options);
/// Leaves of nested scenes stand on one level where the library was built for one level.
[[nodiscard]] EmbreeSides embree_instances(const PlacedScene& scene, const PeerOptions& options);
[[nodiscard]] EmbreeSides embree_spheres(std::span<const Sphere> spheres,
                                         const PeerOptions& options);
[[nodiscard]] EmbreeSides embree_discs(std::span<const Disc> discs, const PeerOptions& options);

[[nodiscard]] std::vector<std::unique_ptr<AllHitsSide>> embree_all_hits(const Mesh& mesh,
                                                                        const PeerOptions& options);
[[nodiscard]] std::vector<std::unique_ptr<ClosestSide>> embree_closest_points(
    const Mesh& mesh, const PeerOptions& options);
/// Of the quality that stands beside ours, and of the cheapest one with the flag DYNAMIC.
[[nodiscard]] std::vector<std::unique_ptr<MovingSide>> embree_moving_instances(
    const PlacedScene& scene, const PeerOptions& options);
/// Refitted, and built again with the qualities LOW and MEDIUM; LOW also with the flag DYNAMIC,
/// which a refit needs.
[[nodiscard]] std::vector<std::unique_ptr<FrameSide>> embree_moving_mesh(
    const Mesh& mesh, const PeerOptions& options);

}  // namespace raydix::bench
