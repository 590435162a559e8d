// Distance and overlap on scenes: the closest point, what a segment or a sphere touches, where a
// moving sphere first does. On everything that a scene holds, instances included; in float and in
// double.
#pragma once

#include <raydix/batch.h>
#include <raydix/scene.h>
#include <raydix/shapes.h>
#include <raydix/types.h>

#include <compare>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace raydix {

/// All calls of this header answer from the scene's last commit. Any number of threads may ask at
/// once, beside others that trace. Answers have the same bits for every number of threads and
/// instruction set.
///
/// Vertices of an instance are moved by each transform in turn, the innermost first, in double, and
/// rounded once, to the scene's type. So the answers are those of one mesh of all triangles, ids
/// apart. Triangles without area, which rays never hit, count here as segments or points.
///
/// Spheres, capsules and points answer closest points and touch. They are closed bodies there: a
/// query inside is at distance 0. Where an instance stretches or shears them, their images answer,
/// in double.
///
/// A query with a coordinate that is NaN or infinite finds nothing and is counted.
///
/// All calls throw InputError: a scene that was never committed, user geometry that the mask shows
/// (it is named), an instruction set that this processor does not have.
///
/// `instance` counts as in hits of rays: 0 is the scene itself, others are for Scene::path.
///
/// A Scene is asked through the trees that rays take. Of a SceneD the first query after a commit
/// makes a mesh of all triangles on every path of instances, and trees over it and over all shapes.
/// The scene keeps them for later queries: up to four, for masks that show different things. The
/// query throws ResultTooLarge, an InputError, before anything is made if that would take more than
/// half of the memory that is left; touch_all if it would take more than its max_result_bytes.

/// The closest point of a scene to a query. position, distance, u and v are as closest.h has
/// them. Of a sphere u and v are 0. Of a capsule u is the place along its axis, from 0 at a to 1 at
/// b. If nothing is found prim is no_primitive and the distance infinity.
template <class Scalar>
struct BasicSceneClosestPoint {
    BasicVec3<Scalar> position{infinity, infinity, infinity};
    Scalar distance = infinity;
    std::uint32_t prim = no_primitive;
    std::uint32_t geometry = no_primitive;
    std::uint32_t instance = 0;
    Scalar u = 0, v = 0;

    [[nodiscard]] constexpr bool found() const { return prim != no_primitive; }
};
using SceneClosestPoint = BasicSceneClosestPoint<float>;
using SceneClosestPointD = BasicSceneClosestPoint<double>;

template <class Scalar>
struct BasicSceneClosestOptions {
    Scalar max_distance = infinity;    // as in ClosestOptions
    std::uint32_t mask = 0xFFFFFFFFu;  // of all queries, as of rays
    int threads = 0;       // 0 to 1,024; 0: all the machine has. Results do not depend on it
    std::string isa = {};  // one of simd_instruction_sets() (wide.h); empty: the best. Results do
                           // not depend on it
};
using SceneClosestOptions = BasicSceneClosestOptions<float>;
using SceneClosestOptionsD = BasicSceneClosestOptions<double>;

/// Finds for each query the least (d2, instance, geometry, prim) over all triangles and shapes, d2
/// as in closest.h. queries [n] -> results [n], in any order. Throws InputError also for sizes that
/// differ and for a max_distance that is negative or NaN.
QueryCounts closest_points(const Scene& scene, std::span<const Vec3> queries,
                           std::span<SceneClosestPoint> results,
                           const SceneClosestOptions& options = {});
[[nodiscard]] std::vector<SceneClosestPoint> closest_points(
    const Scene& scene, std::span<const Vec3> queries, const SceneClosestOptions& options = {});
QueryCounts closest_points(const SceneD& scene, std::span<const Vec3d> queries,
                           std::span<SceneClosestPointD> results,
                           const SceneClosestOptionsD& options = {});
[[nodiscard]] std::vector<SceneClosestPointD> closest_points(
    const SceneD& scene, std::span<const Vec3d> queries, const SceneClosestOptionsD& options = {});
/// One query, on the caller's thread.
[[nodiscard]] SceneClosestPoint closest_point(const Scene& scene, Vec3 query,
                                              float max_distance = infinity,
                                              std::uint32_t mask = 0xFFFFFFFFu);
[[nodiscard]] SceneClosestPointD closest_point(const SceneD& scene, Vec3d query,
                                               double max_distance = infinity,
                                               std::uint32_t mask = 0xFFFFFFFFu);

struct SceneOverlapOptions {
    std::uint32_t mask = 0xFFFFFFFFu;  // of all queries, as of rays
    /// touch_all only: bounds the peak of the call. 0: half of what is left (result_limit.h).
    std::uint64_t max_result_bytes = 0;
    int threads = 0;       // 0 to 1,024; 0: all the machine has. Results do not depend on it
    std::string isa = {};  // as in SceneClosestOptions
};

/// Says whether each query has a point in common with any triangle or shape: 1 or 0. queries [n] ->
/// touched [n]. Triangles are decided as by touch_any of overlap.h. A sphere touches a shape if
/// d2 <= radius * radius with the d2 of closest_points. A segment and a shape are decided in
/// double. Throws InputError also for sizes that differ.
QueryCounts touch_any(const Scene& scene, std::span<const Segment> queries,
                      std::span<std::uint8_t> touched, const SceneOverlapOptions& options = {});
QueryCounts touch_any(const Scene& scene, std::span<const Sphere> queries,
                      std::span<std::uint8_t> touched, const SceneOverlapOptions& options = {});
QueryCounts touch_any(const SceneD& scene, std::span<const SegmentD> queries,
                      std::span<std::uint8_t> touched, const SceneOverlapOptions& options = {});
QueryCounts touch_any(const SceneD& scene, std::span<const SphereD> queries,
                      std::span<std::uint8_t> touched, const SceneOverlapOptions& options = {});
[[nodiscard]] bool touches(const Scene& scene, const Segment& segment,
                           std::uint32_t mask = 0xFFFFFFFFu);
[[nodiscard]] bool touches(const Scene& scene, const Sphere& sphere,
                           std::uint32_t mask = 0xFFFFFFFFu);
[[nodiscard]] bool touches(const SceneD& scene, const SegmentD& segment,
                           std::uint32_t mask = 0xFFFFFFFFu);
[[nodiscard]] bool touches(const SceneD& scene, const SphereD& sphere,
                           std::uint32_t mask = 0xFFFFFFFFu);

/// A primitive of a scene: the path of instances to it, its geometry, and its number there. They
/// are compared in this order.
struct ScenePrimitive {
    std::uint32_t instance, geometry, prim;

    friend constexpr auto operator<=>(const ScenePrimitive&, const ScenePrimitive&) = default;
};

/// All that each query touches: those of query i are prims[offsets[i]] .. prims[offsets[i + 1]],
/// ascending.
struct SceneOverlapLists {
    std::vector<std::uint64_t> offsets;  // [queries + 1]
    std::vector<ScenePrimitive> prims;
    QueryCounts counts;
};

/// As touch_any, but lists all that each query touches, each once. None is ever dropped. Throws
/// ResultTooLarge, an InputError, if the call would take more than options.max_result_bytes.
[[nodiscard]] SceneOverlapLists touch_all(const Scene& scene, std::span<const Segment> queries,
                                          const SceneOverlapOptions& options = {});
[[nodiscard]] SceneOverlapLists touch_all(const Scene& scene, std::span<const Sphere> queries,
                                          const SceneOverlapOptions& options = {});
[[nodiscard]] SceneOverlapLists touch_all(const SceneD& scene, std::span<const SegmentD> queries,
                                          const SceneOverlapOptions& options = {});
[[nodiscard]] SceneOverlapLists touch_all(const SceneD& scene, std::span<const SphereD> queries,
                                          const SceneOverlapOptions& options = {});

/// As SweepHit, and where in a scene it is.
template <class Scalar>
struct BasicSceneSweepHit {
    Scalar t = infinity;
    std::uint32_t prim = no_primitive;
    std::uint32_t geometry = no_primitive;
    std::uint32_t instance = 0;
    BasicVec3<Scalar> position{infinity, infinity, infinity};
    Scalar u = 0, v = 0;

    [[nodiscard]] constexpr bool hit() const { return prim != no_primitive; }
};
using SceneSweepHit = BasicSceneSweepHit<float>;
using SceneSweepHitD = BasicSceneSweepHit<double>;

/// Finds the first contact of each sweep with triangles: the least (t, instance, geometry, prim)
/// with a finite t, as sweep_spheres of overlap.h. sweeps [n] -> hits [n]. A sweep without a radius
/// is a ray through the triangles as they are in the world. Throws InputError also for sizes that
/// differ and for spheres, capsules or points that the mask shows (they are named).
QueryCounts sweep_spheres(const Scene& scene, std::span<const SphereSweep> sweeps,
                          std::span<SceneSweepHit> hits, const SceneOverlapOptions& options = {});
[[nodiscard]] std::vector<SceneSweepHit> sweep_spheres(const Scene& scene,
                                                       std::span<const SphereSweep> sweeps,
                                                       const SceneOverlapOptions& options = {});
QueryCounts sweep_spheres(const SceneD& scene, std::span<const SphereSweepD> sweeps,
                          std::span<SceneSweepHitD> hits, const SceneOverlapOptions& options = {});
[[nodiscard]] std::vector<SceneSweepHitD> sweep_spheres(const SceneD& scene,
                                                        std::span<const SphereSweepD> sweeps,
                                                        const SceneOverlapOptions& options = {});
[[nodiscard]] SceneSweepHit sweep_sphere(const Scene& scene, const SphereSweep& sweep,
                                         std::uint32_t mask = 0xFFFFFFFFu);
[[nodiscard]] SceneSweepHitD sweep_sphere(const SceneD& scene, const SphereSweepD& sweep,
                                          std::uint32_t mask = 0xFFFFFFFFu);

}  // namespace raydix
