// Distances of the C interface: closest points of scenes, solids. In float and double.
#include "inside.h"

namespace raydix_c {

template <class Result, class Handle, class Scalar, class CResult, class COptions>
raydix_status closest_points(const Handle* scene, const Scalar* queries, std::size_t count,
                             CResult* results, const COptions* options, const COptions& defaults) {
    static_assert(sizeof(CResult) == sizeof(Result));
    static_assert(offsetof(CResult, u) == offsetof(Result, u));
    static_assert(offsetof(CResult, prim) == offsetof(Result, prim));
    return guarded([&] {
        require(scene, "scene");
        const COptions asked = options_over(options, defaults);
        const raydix::BasicSceneClosestOptions<Scalar> how{
            .max_distance = asked.max_distance, .mask = asked.mask, .threads = asked.threads};
        using Point = raydix::BasicVec3<Scalar>;
        raydix::closest_points(scene->scene, array_of<Point>(queries, count, "queries"),
                               results_at<Result>(results, count, "results"), how);
    });
}

template <class Handle>
raydix_status create_solid(const auto* scene, Handle** solid) {
    return guarded([&] {
        require(scene, "scene");
        require(solid, "solid");
        *solid = new Handle{decltype(Handle::solid)(scene->scene)};
    });
}

raydix_status is_closed(const auto* solid, int* closed) {
    return guarded([&] {
        require(solid, "solid");
        require(closed, "closed");
        *closed = solid->solid.closure() != raydix::Closure::open;
    });
}

template <class Options, class Scalar>
raydix_status signed_distances(const auto* solid, const Scalar* queries, std::size_t count,
                               Scalar* distances, int threads) {
    return guarded([&] {
        require(solid, "solid");
        Options how;
        how.threads = threads;
        using Point = raydix::BasicVec3<Scalar>;
        raydix::signed_distances(solid->solid, array_of<Point>(queries, count, "queries"),
                                 results_at<Scalar>(distances, count, "distances"), how);
    });
}

template <class Scalar>
raydix_status contains(const auto* solid, const Scalar* queries, std::size_t count,
                       std::uint8_t* inside, int threads) {
    return guarded([&] {
        require(solid, "solid");
        using Point = raydix::BasicVec3<Scalar>;
        raydix::contains(solid->solid, array_of<Point>(queries, count, "queries"),
                         results_at<std::uint8_t>(inside, count, "inside"), threads);
    });
}

}  // namespace raydix_c

extern "C" {

raydix_status raydix_closest_points(const raydix_scene* scene, const float* queries, size_t count,
                                    raydix_closest_point* results,
                                    const raydix_closest_options* options) {
    return raydix_c::closest_points<raydix::SceneClosestPoint>(
        scene, queries, count, results, options, raydix_closest_options RAYDIX_CLOSEST_OPTIONS);
}

raydix_status raydix_closest_points_d(const raydix_scene_d* scene, const double* queries,
                                      size_t count, raydix_closest_point_d* results,
                                      const raydix_closest_options_d* options) {
    return raydix_c::closest_points<raydix::SceneClosestPointD>(
        scene, queries, count, results, options, raydix_closest_options_d RAYDIX_CLOSEST_OPTIONS_D);
}

raydix_status raydix_solid_create(const raydix_scene* scene, raydix_solid** solid) {
    return raydix_c::create_solid(scene, solid);
}

raydix_status raydix_solid_create_d(const raydix_scene_d* scene, raydix_solid_d** solid) {
    return raydix_c::create_solid(scene, solid);
}

void raydix_solid_destroy(raydix_solid* solid) { delete solid; }

void raydix_solid_destroy_d(raydix_solid_d* solid) { delete solid; }

raydix_status raydix_solid_is_closed(const raydix_solid* solid, int* closed) {
    return raydix_c::is_closed(solid, closed);
}

raydix_status raydix_solid_is_closed_d(const raydix_solid_d* solid, int* closed) {
    return raydix_c::is_closed(solid, closed);
}

raydix_status raydix_signed_distances(const raydix_solid* solid, const float* queries, size_t count,
                                      float* distances, int threads) {
    return raydix_c::signed_distances<raydix::ClosestOptions>(solid, queries, count, distances,
                                                              threads);
}

raydix_status raydix_signed_distances_d(const raydix_solid_d* solid, const double* queries,
                                        size_t count, double* distances, int threads) {
    return raydix_c::signed_distances<raydix::ClosestOptionsD>(solid, queries, count, distances,
                                                               threads);
}

raydix_status raydix_contains(const raydix_solid* solid, const float* queries, size_t count,
                              uint8_t* inside, int threads) {
    return raydix_c::contains(solid, queries, count, inside, threads);
}

raydix_status raydix_contains_d(const raydix_solid_d* solid, const double* queries, size_t count,
                                uint8_t* inside, int threads) {
    return raydix_c::contains(solid, queries, count, inside, threads);
}

}  // extern "C"
