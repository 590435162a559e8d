// Scenes and rays of the C interface, in double.
#include "scene_calls.h"

using DoubleCalls = raydix_c::SceneCalls<double>;

extern "C" {

raydix_status raydix_scene_create_d(raydix_scene_d** scene) { return DoubleCalls::create(scene); }

raydix_status raydix_scene_load_d(const char* path, const raydix_commit_options* options,
                                  raydix_scene_d** scene) {
    return DoubleCalls::load(path, options, scene);
}

void raydix_scene_destroy_d(raydix_scene_d* scene) { delete scene; }

raydix_status raydix_scene_save_d(const raydix_scene_d* scene, const char* path) {
    return DoubleCalls::save(scene, path);
}

raydix_status raydix_scene_add_mesh_d(raydix_scene_d* scene, const double* vertices,
                                      size_t vertex_count, const uint32_t* triangles,
                                      size_t triangle_count, uint32_t mask, uint32_t* id) {
    return DoubleCalls::add_mesh(scene, vertices, vertex_count, triangles, triangle_count, mask,
                                 id);
}

raydix_status raydix_scene_add_spheres_d(raydix_scene_d* scene, const double* spheres, size_t count,
                                         uint32_t mask, uint32_t* id) {
    return DoubleCalls::add_shapes<DoubleCalls::Sphere>(scene, spheres, count, "spheres", mask, id);
}

raydix_status raydix_scene_add_capsules_d(raydix_scene_d* scene, const double* capsules,
                                          size_t count, uint32_t mask, uint32_t* id) {
    return DoubleCalls::add_shapes<DoubleCalls::Capsule>(scene, capsules, count, "capsules", mask,
                                                         id);
}

raydix_status raydix_scene_add_points_d(raydix_scene_d* scene, const double* points, size_t count,
                                        double radius, uint32_t mask, uint32_t* id) {
    return DoubleCalls::add_points(scene, points, count, radius, mask, id);
}

raydix_status raydix_scene_add_user_d(raydix_scene_d* scene, const double* boxes, size_t count,
                                      raydix_user_test_d test, void* user, uint32_t mask,
                                      uint32_t* id) {
    return DoubleCalls::add_user(scene, boxes, count, test, user, mask, id);
}

raydix_status raydix_scene_add_instance_d(raydix_scene_d* scene, const raydix_scene_d* child,
                                          const double* transform, uint32_t mask, uint32_t* id) {
    return DoubleCalls::add_instance(scene, child, transform, mask, id);
}

raydix_status raydix_scene_update_mesh_d(raydix_scene_d* scene, uint32_t id, const double* vertices,
                                         size_t vertex_count, const uint32_t* triangles,
                                         size_t triangle_count) {
    return DoubleCalls::update_mesh(scene, id, vertices, vertex_count, triangles, triangle_count);
}

raydix_status raydix_scene_update_spheres_d(raydix_scene_d* scene, uint32_t id,
                                            const double* spheres, size_t count) {
    return DoubleCalls::update_shapes<DoubleCalls::Sphere>(scene, id, spheres, count, "spheres");
}

raydix_status raydix_scene_update_capsules_d(raydix_scene_d* scene, uint32_t id,
                                             const double* capsules, size_t count) {
    return DoubleCalls::update_shapes<DoubleCalls::Capsule>(scene, id, capsules, count, "capsules");
}

raydix_status raydix_scene_update_points_d(raydix_scene_d* scene, uint32_t id, const double* points,
                                           size_t count, double radius) {
    return DoubleCalls::update_points(scene, id, points, count, radius);
}

raydix_status raydix_scene_set_transform_d(raydix_scene_d* scene, uint32_t id,
                                           const double* transform) {
    return DoubleCalls::set_transform(scene, id, transform);
}

raydix_status raydix_scene_set_mask_d(raydix_scene_d* scene, uint32_t id, uint32_t mask) {
    return DoubleCalls::set_mask(scene, id, mask);
}

raydix_status raydix_scene_remove_d(raydix_scene_d* scene, uint32_t id) {
    return DoubleCalls::remove(scene, id);
}

raydix_status raydix_scene_commit_d(raydix_scene_d* scene, const raydix_commit_options* options) {
    return DoubleCalls::commit(scene, options);
}

raydix_status raydix_scene_size_d(const raydix_scene_d* scene, uint32_t* size) {
    return DoubleCalls::size(scene, size);
}

raydix_status raydix_scene_bounds_d(const raydix_scene_d* scene, double* lo, double* hi) {
    return DoubleCalls::bounds(scene, lo, hi);
}

raydix_status raydix_scene_path_d(const raydix_scene_d* scene, uint32_t instance, uint32_t* ids,
                                  size_t capacity, size_t* count) {
    return DoubleCalls::path(scene, instance, ids, capacity, count);
}

raydix_status raydix_trace_closest_d(const raydix_scene_d* scene, const raydix_ray_d* rays,
                                     size_t count, raydix_hit_d* hits,
                                     const raydix_trace_options_d* options) {
    return DoubleCalls::closest(scene, rays, count, hits, options);
}

raydix_status raydix_trace_any_d(const raydix_scene_d* scene, const raydix_ray_d* rays,
                                 size_t count, uint8_t* occluded,
                                 const raydix_trace_options_d* options) {
    return DoubleCalls::any(scene, rays, count, occluded, options);
}

raydix_status raydix_trace_all_d(const raydix_scene_d* scene, const raydix_ray_d* rays,
                                 size_t count, raydix_hit_lists_d** lists,
                                 const raydix_trace_options_d* options) {
    return DoubleCalls::all(scene, rays, count, lists, options);
}

void raydix_hit_lists_destroy_d(raydix_hit_lists_d* lists) { delete lists; }

raydix_status raydix_hit_lists_arrays_d(const raydix_hit_lists_d* lists, size_t* rays,
                                        const uint64_t** offsets, const raydix_hit_d** hits) {
    return DoubleCalls::arrays(lists, rays, offsets, hits);
}

raydix_status raydix_hit_positions_d(const raydix_scene_d* scene, const raydix_ray_d* rays,
                                     const raydix_hit_d* hits, size_t count, double* positions,
                                     int threads) {
    return DoubleCalls::positions(scene, rays, hits, count, positions, threads);
}

raydix_status raydix_hit_normals_d(const raydix_scene_d* scene, const raydix_ray_d* rays,
                                   const raydix_hit_d* hits, size_t count, double* normals,
                                   int threads) {
    return DoubleCalls::normals(scene, rays, hits, count, normals, threads);
}

}  // extern "C"
