/* Scenes, rays, distances and points in double: every call of raydix_c.h that has coordinates, with
   _d at the end of its name and of its types. What raydix_c.h says of a call holds here.

   For maps and CAD, whose coordinates float would round. Rays meet triangles and shapes in double.
   A ray that passes a sphere, capsule or point within 2^-50 of (distance of its origin from the
   shape + the shape's length and radius) may hit or miss it. */
#ifndef RAYDIX_C_DOUBLE_H
#define RAYDIX_C_DOUBLE_H

#include <raydix_c.h>

#ifdef __cplusplus
extern "C" {
#endif

/* ---- Scenes ----------------------------------------------------------------------------- */

typedef struct raydix_scene_d raydix_scene_d;

typedef struct raydix_ray_d {
    double origin[3], tmin, direction[3], tmax;
} raydix_ray_d;

typedef struct raydix_hit_d {
    double t;
    uint32_t prim;
    double u, v;
    uint32_t geometry, instance;
} raydix_hit_d;

/* As raydix_user_test. A hit must lie within the box of its primitive, up to 2^-41 of the distance
   that the ray has come and 2^-44 of the box's largest coordinate. */
typedef int (*raydix_user_test_d)(void* user, uint32_t prim, const raydix_ray_d* ray,
                                  raydix_hit_d* hit);

RAYDIX_C_API raydix_status raydix_scene_create_d(raydix_scene_d** scene);
/* Of .rdx files with scenes it reads those of raydix_scene_save_d alone; raydix_scene_load reads
   none of them. Of other files the coordinates are rounded to float first, as raydix_scene_load
   has them: give what a float does not hold to raydix_scene_add_mesh_d. */
RAYDIX_C_API raydix_status raydix_scene_load_d(const char* path,
                                               const raydix_commit_options* options,
                                               raydix_scene_d** scene);
RAYDIX_C_API void raydix_scene_destroy_d(raydix_scene_d* scene);
/* Every double comes to the file as it is. Trees do not: loading builds them. */
RAYDIX_C_API raydix_status raydix_scene_save_d(const raydix_scene_d* scene, const char* path);
RAYDIX_C_API raydix_status raydix_scene_add_mesh_d(raydix_scene_d* scene, const double* vertices,
                                                   size_t vertex_count, const uint32_t* triangles,
                                                   size_t triangle_count, uint32_t mask,
                                                   uint32_t* id);
RAYDIX_C_API raydix_status raydix_scene_add_spheres_d(raydix_scene_d* scene, const double* spheres,
                                                      size_t count, uint32_t mask, uint32_t* id);
RAYDIX_C_API raydix_status raydix_scene_add_capsules_d(raydix_scene_d* scene,
                                                       const double* capsules, size_t count,
                                                       uint32_t mask, uint32_t* id);
RAYDIX_C_API raydix_status raydix_scene_add_points_d(raydix_scene_d* scene, const double* points,
                                                     size_t count, double radius, uint32_t mask,
                                                     uint32_t* id);
RAYDIX_C_API raydix_status raydix_scene_add_user_d(raydix_scene_d* scene, const double* boxes,
                                                   size_t count, raydix_user_test_d test,
                                                   void* user, uint32_t mask, uint32_t* id);
/* A scene in double holds scenes in double alone. */
RAYDIX_C_API raydix_status raydix_scene_add_instance_d(raydix_scene_d* scene,
                                                       const raydix_scene_d* child,
                                                       const double* transform, uint32_t mask,
                                                       uint32_t* id);
RAYDIX_C_API raydix_status raydix_scene_update_mesh_d(raydix_scene_d* scene, uint32_t id,
                                                      const double* vertices, size_t vertex_count,
                                                      const uint32_t* triangles,
                                                      size_t triangle_count);
RAYDIX_C_API raydix_status raydix_scene_update_spheres_d(raydix_scene_d* scene, uint32_t id,
                                                         const double* spheres, size_t count);
RAYDIX_C_API raydix_status raydix_scene_update_capsules_d(raydix_scene_d* scene, uint32_t id,
                                                          const double* capsules, size_t count);
RAYDIX_C_API raydix_status raydix_scene_update_points_d(raydix_scene_d* scene, uint32_t id,
                                                        const double* points, size_t count,
                                                        double radius);
RAYDIX_C_API raydix_status raydix_scene_set_transform_d(raydix_scene_d* scene, uint32_t id,
                                                        const double* transform);
RAYDIX_C_API raydix_status raydix_scene_set_mask_d(raydix_scene_d* scene, uint32_t id,
                                                   uint32_t mask);
RAYDIX_C_API raydix_status raydix_scene_remove_d(raydix_scene_d* scene, uint32_t id);
RAYDIX_C_API raydix_status raydix_scene_commit_d(raydix_scene_d* scene,
                                                 const raydix_commit_options* options);
RAYDIX_C_API raydix_status raydix_scene_size_d(const raydix_scene_d* scene, uint32_t* size);
RAYDIX_C_API raydix_status raydix_scene_bounds_d(const raydix_scene_d* scene, double* lo,
                                                 double* hi);
RAYDIX_C_API raydix_status raydix_scene_path_d(const raydix_scene_d* scene, uint32_t instance,
                                               uint32_t* ids, size_t capacity, size_t* count);

/* ---- Rays ------------------------------------------------------------------------------- */

typedef int (*raydix_hit_filter_d)(void* user, size_t place, const raydix_ray_d* ray,
                                   const raydix_hit_d* hit);

typedef struct raydix_trace_options_d {
    size_t struct_size;
    uint32_t mask;
    int threads;
    const uint32_t* masks;
    raydix_hit_filter_d filter;
    void* user;
    uint64_t max_result_bytes;
} raydix_trace_options_d;
#define RAYDIX_TRACE_OPTIONS_D \
    { sizeof(raydix_trace_options_d), RAYDIX_ALL, 0, NULL, NULL, NULL, 0 }

typedef struct raydix_hit_lists_d raydix_hit_lists_d;

RAYDIX_C_API raydix_status raydix_trace_closest_d(const raydix_scene_d* scene,
                                                  const raydix_ray_d* rays, size_t count,
                                                  raydix_hit_d* hits,
                                                  const raydix_trace_options_d* options);
RAYDIX_C_API raydix_status raydix_trace_any_d(const raydix_scene_d* scene, const raydix_ray_d* rays,
                                              size_t count, uint8_t* occluded,
                                              const raydix_trace_options_d* options);
RAYDIX_C_API raydix_status raydix_trace_all_d(const raydix_scene_d* scene, const raydix_ray_d* rays,
                                              size_t count, raydix_hit_lists_d** lists,
                                              const raydix_trace_options_d* options);
RAYDIX_C_API void raydix_hit_lists_destroy_d(raydix_hit_lists_d* lists);
RAYDIX_C_API raydix_status raydix_hit_lists_arrays_d(const raydix_hit_lists_d* lists, size_t* rays,
                                                     const uint64_t** offsets,
                                                     const raydix_hit_d** hits);
RAYDIX_C_API raydix_status raydix_hit_positions_d(const raydix_scene_d* scene,
                                                  const raydix_ray_d* rays,
                                                  const raydix_hit_d* hits, size_t count,
                                                  double* positions, int threads);
RAYDIX_C_API raydix_status raydix_hit_normals_d(const raydix_scene_d* scene,
                                                const raydix_ray_d* rays, const raydix_hit_d* hits,
                                                size_t count, double* normals, int threads);

/* ---- Distances -------------------------------------------------------------------------- */

typedef struct raydix_closest_point_d {
    double position[3], distance;
    uint32_t prim, geometry, instance;
    double u, v;
} raydix_closest_point_d;

typedef struct raydix_closest_options_d {
    size_t struct_size;
    double max_distance;
    uint32_t mask;
    int threads;
} raydix_closest_options_d;
#define RAYDIX_CLOSEST_OPTIONS_D \
    { sizeof(raydix_closest_options_d), INFINITY, RAYDIX_ALL, 0 }

typedef struct raydix_solid_d raydix_solid_d;

RAYDIX_C_API raydix_status raydix_closest_points_d(const raydix_scene_d* scene,
                                                   const double* queries, size_t count,
                                                   raydix_closest_point_d* results,
                                                   const raydix_closest_options_d* options);
RAYDIX_C_API raydix_status raydix_solid_create_d(const raydix_scene_d* scene,
                                                 raydix_solid_d** solid);
RAYDIX_C_API void raydix_solid_destroy_d(raydix_solid_d* solid);
RAYDIX_C_API raydix_status raydix_solid_is_closed_d(const raydix_solid_d* solid, int* closed);
RAYDIX_C_API raydix_status raydix_signed_distances_d(const raydix_solid_d* solid,
                                                     const double* queries, size_t count,
                                                     double* distances, int threads);
RAYDIX_C_API raydix_status raydix_contains_d(const raydix_solid_d* solid, const double* queries,
                                             size_t count, uint8_t* inside, int threads);

/* ---- Points ----------------------------------------------------------------------------- */

typedef struct raydix_points_d raydix_points_d;
typedef struct raydix_lists_d raydix_lists_d;

RAYDIX_C_API raydix_status raydix_points_create_d(const double* points, size_t count, int threads,
                                                  raydix_points_d** index);
RAYDIX_C_API void raydix_points_destroy_d(raydix_points_d* index);
RAYDIX_C_API raydix_status raydix_points_size_d(const raydix_points_d* index, size_t* size);
RAYDIX_C_API raydix_status raydix_points_knn_d(const raydix_points_d* index, const double* queries,
                                               size_t count, uint32_t k, uint32_t* indices,
                                               double* distances, int threads);
RAYDIX_C_API raydix_status raydix_points_knn_within_d(const raydix_points_d* index,
                                                      const double* queries, size_t count,
                                                      uint32_t k, double max_distance,
                                                      uint32_t* indices, double* distances,
                                                      int threads);
RAYDIX_C_API raydix_status raydix_points_count_d(const raydix_points_d* index,
                                                 const double* queries, size_t count, double radius,
                                                 uint32_t* counts, int threads);
RAYDIX_C_API raydix_status raydix_points_radius_d(const raydix_points_d* index,
                                                  const double* queries, size_t count,
                                                  double radius, int sorted, int threads,
                                                  raydix_lists_d** lists);
RAYDIX_C_API raydix_status raydix_points_radius_limited_d(const raydix_points_d* index,
                                                          const double* queries, size_t count,
                                                          double radius, int sorted,
                                                          uint64_t max_result_bytes, int threads,
                                                          raydix_lists_d** lists);
RAYDIX_C_API void raydix_lists_destroy_d(raydix_lists_d* lists);
RAYDIX_C_API raydix_status raydix_lists_arrays_d(const raydix_lists_d* lists, size_t* rows,
                                                 const uint64_t** offsets, const uint32_t** indices,
                                                 const double** distances);

#ifdef __cplusplus
}
#endif
#endif
