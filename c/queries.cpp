// Distances of the C interface: closest points of scenes, solids.
#include "inside.h"

using raydix_c::array_of;
using raydix_c::guarded;
using raydix_c::options_over;
using raydix_c::require;
using raydix_c::results_at;

static_assert(sizeof(raydix_closest_point) == sizeof(raydix::SceneClosestPoint));
static_assert(offsetof(raydix_closest_point, u) == offsetof(raydix::SceneClosestPoint, u));

extern "C" {

raydix_status raydix_closest_points(const raydix_scene* scene, const float* queries, size_t count,
                                    raydix_closest_point* results,
                                    const raydix_closest_options* options) {
    return guarded([&] {
        require(scene, "scene");
        const raydix_closest_options asked = options_over(options, RAYDIX_CLOSEST_OPTIONS);
        const raydix::SceneClosestOptions how{
            .max_distance = asked.max_distance, .mask = asked.mask, .threads = asked.threads};
        raydix::closest_points(scene->scene, array_of<raydix::Vec3>(queries, count, "queries"),
                               results_at<raydix::SceneClosestPoint>(results, count, "results"),
                               how);
    });
}

raydix_status raydix_solid_create(const raydix_scene* scene, raydix_solid** solid) {
    return guarded([&] {
        require(scene, "scene");
        require(solid, "solid");
        *solid = new raydix_solid{raydix::Solid(scene->scene)};
    });
}

void raydix_solid_destroy(raydix_solid* solid) { delete solid; }

raydix_status raydix_solid_is_closed(const raydix_solid* solid, int* closed) {
    return guarded([&] {
        require(solid, "solid");
        require(closed, "closed");
        *closed = solid->solid.closure() != raydix::Closure::open;
    });
}

raydix_status raydix_signed_distances(const raydix_solid* solid, const float* queries, size_t count,
                                      float* distances, int threads) {
    return guarded([&] {
        require(solid, "solid");
        raydix::ClosestOptions how;
        how.threads = threads;
        raydix::signed_distances(solid->solid, array_of<raydix::Vec3>(queries, count, "queries"),
                                 results_at<float>(distances, count, "distances"), how);
    });
}

raydix_status raydix_contains(const raydix_solid* solid, const float* queries, size_t count,
                              uint8_t* inside, int threads) {
    return guarded([&] {
        require(solid, "solid");
        raydix::contains(solid->solid, array_of<raydix::Vec3>(queries, count, "queries"),
                         results_at<std::uint8_t>(inside, count, "inside"), threads);
    });
}

}  // extern "C"
