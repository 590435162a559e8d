// Scenes and rays of the C interface, in float.
#include "scene_calls.h"

using FloatCalls = raydix_c::SceneCalls<float>;

extern "C" {

raydix_status raydix_scene_create(raydix_scene** scene) { return FloatCalls::create(scene); }

raydix_status raydix_scene_load(const char* path, const raydix_commit_options* options,
                                raydix_scene** scene) {
    return FloatCalls::load(path, options, scene);
}

void raydix_scene_destroy(raydix_scene* scene) { delete scene; }

raydix_status raydix_scene_save(const raydix_scene* scene, const char* path) {
    return FloatCalls::save(scene, path);
}

raydix_status raydix_scene_add_mesh(raydix_scene* scene, const float* vertices, size_t vertex_count,
                                    const uint32_t* triangles, size_t triangle_count, uint32_t mask,
                                    uint32_t* id) {
    return FloatCalls::add_mesh(scene, vertices, vertex_count, triangles, triangle_count, mask, id);
}

raydix_status raydix_scene_add_spheres(raydix_scene* scene, const float* spheres, size_t count,
                                       uint32_t mask, uint32_t* id) {
    return FloatCalls::add_shapes<FloatCalls::Sphere>(scene, spheres, count, "spheres", mask, id);
}

raydix_status raydix_scene_add_capsules(raydix_scene* scene, const float* capsules, size_t count,
                                        uint32_t mask, uint32_t* id) {
    return FloatCalls::add_shapes<FloatCalls::Capsule>(scene, capsules, count, "capsules", mask,
                                                       id);
}

raydix_status raydix_scene_add_points(raydix_scene* scene, const float* points, size_t count,
                                      float radius, uint32_t mask, uint32_t* id) {
    return FloatCalls::add_points(scene, points, count, radius, mask, id);
}

raydix_status raydix_scene_add_user(raydix_scene* scene, const float* boxes, size_t count,
                                    raydix_user_test test, void* user, uint32_t mask,
                                    uint32_t* id) {
    return FloatCalls::add_user(scene, boxes, count, test, user, mask, id);
}

raydix_status raydix_scene_add_instance(raydix_scene* scene, const raydix_scene* child,
                                        const float* transform, uint32_t mask, uint32_t* id) {
    return FloatCalls::add_instance(scene, child, transform, mask, id);
}

raydix_status raydix_scene_update_mesh(raydix_scene* scene, uint32_t id, const float* vertices,
                                       size_t vertex_count, const uint32_t* triangles,
                                       size_t triangle_count) {
    return FloatCalls::update_mesh(scene, id, vertices, vertex_count, triangles, triangle_count);
}

raydix_status raydix_scene_update_spheres(raydix_scene* scene, uint32_t id, const float* spheres,
                                          size_t count) {
    return FloatCalls::update_shapes<FloatCalls::Sphere>(scene, id, spheres, count, "spheres");
}

raydix_status raydix_scene_update_capsules(raydix_scene* scene, uint32_t id, const float* capsules,
                                           size_t count) {
    return FloatCalls::update_shapes<FloatCalls::Capsule>(scene, id, capsules, count, "capsules");
}

raydix_status raydix_scene_update_points(raydix_scene* scene, uint32_t id, const float* points,
                                         size_t count, float radius) {
    return FloatCalls::update_points(scene, id, points, count, radius);
}

raydix_status raydix_scene_set_transform(raydix_scene* scene, uint32_t id, const float* transform) {
    return FloatCalls::set_transform(scene, id, transform);
}

raydix_status raydix_scene_set_mask(raydix_scene* scene, uint32_t id, uint32_t mask) {
    return FloatCalls::set_mask(scene, id, mask);
}

raydix_status raydix_scene_remove(raydix_scene* scene, uint32_t id) {
    return FloatCalls::remove(scene, id);
}

raydix_status raydix_scene_commit(raydix_scene* scene, const raydix_commit_options* options) {
    return FloatCalls::commit(scene, options);
}

raydix_status raydix_scene_size(const raydix_scene* scene, uint32_t* size) {
    return FloatCalls::size(scene, size);
}

raydix_status raydix_scene_bounds(const raydix_scene* scene, float* lo, float* hi) {
    return FloatCalls::bounds(scene, lo, hi);
}

raydix_status raydix_scene_path(const raydix_scene* scene, uint32_t instance, uint32_t* ids,
                                size_t capacity, size_t* count) {
    return FloatCalls::path(scene, instance, ids, capacity, count);
}

raydix_status raydix_trace_closest(const raydix_scene* scene, const raydix_ray* rays, size_t count,
                                   raydix_hit* hits, const raydix_trace_options* options) {
    return FloatCalls::closest(scene, rays, count, hits, options);
}

raydix_status raydix_trace_any(const raydix_scene* scene, const raydix_ray* rays, size_t count,
                               uint8_t* occluded, const raydix_trace_options* options) {
    return FloatCalls::any(scene, rays, count, occluded, options);
}

raydix_status raydix_trace_all(const raydix_scene* scene, const raydix_ray* rays, size_t count,
                               raydix_hit_lists** lists, const raydix_trace_options* options) {
    return FloatCalls::all(scene, rays, count, lists, options);
}

void raydix_hit_lists_destroy(raydix_hit_lists* lists) { delete lists; }

raydix_status raydix_hit_lists_arrays(const raydix_hit_lists* lists, size_t* rays,
                                      const uint64_t** offsets, const raydix_hit** hits) {
    return FloatCalls::arrays(lists, rays, offsets, hits);
}

raydix_status raydix_hit_positions(const raydix_scene* scene, const raydix_ray* rays,
                                   const raydix_hit* hits, size_t count, float* positions,
                                   int threads) {
    return FloatCalls::positions(scene, rays, hits, count, positions, threads);
}

raydix_status raydix_hit_normals(const raydix_scene* scene, const raydix_ray* rays,
                                 const raydix_hit* hits, size_t count, float* normals,
                                 int threads) {
    return FloatCalls::normals(scene, rays, hits, count, normals, threads);
}

}  // extern "C"
