// raydix in `bench scene`: the only file of it that knows which calls of the library answer which
// workload.
#pragma once

#include <raydix/bvh.h>

#include "scene_side.h"

namespace raydix::bench {

struct SubjectOptions {
    Quality quality = Quality::balanced;
    int threads = 1;
};

/// What is given must outlive what is made. Null: raydix has no such thing.
[[nodiscard]] std::unique_ptr<RaySide> our_mesh(const Mesh& mesh, const SubjectOptions& options);
[[nodiscard]] std::unique_ptr<RaySide> our_double_mesh(const Mesh& mesh,
                                                       const SubjectOptions& options);
[[nodiscard]] std::unique_ptr<RaySide> our_instances(const PlacedScene& scene,
                                                     const SubjectOptions& options);
[[nodiscard]] std::unique_ptr<RaySide> our_spheres(std::span<const Sphere> spheres,
                                                   const SubjectOptions& options);
[[nodiscard]] std::unique_ptr<RaySide> our_discs(std::span<const Disc> discs,
                                                 const SubjectOptions& options);
/// Triangles that accept(prim) takes away from rays.
using AcceptPrimitive = bool (*)(std::uint32_t prim);
[[nodiscard]] std::unique_ptr<RaySide> our_filtered_mesh(const Mesh& mesh, AcceptPrimitive accept,
                                                         const SubjectOptions& options);
/// Many meshes as geometries of one scene that does not change.
[[nodiscard]] std::unique_ptr<RaySide> our_fixed_scene(const std::vector<SharedMesh>& meshes,
                                                       const SubjectOptions& options);
[[nodiscard]] std::unique_ptr<AllHitsSide> our_all_hits(const Mesh& mesh,
                                                        const SubjectOptions& options);
[[nodiscard]] std::unique_ptr<ClosestSide> our_closest_points(const Mesh& mesh,
                                                              const SubjectOptions& options);
[[nodiscard]] std::unique_ptr<MovingSide> our_moving_instances(const PlacedScene& scene,
                                                               const SubjectOptions& options);
[[nodiscard]] std::unique_ptr<FrameSide> our_moving_mesh(const Mesh& mesh,
                                                         const SubjectOptions& options);

}  // namespace raydix::bench
