/* The C interface of raydix: scenes and rays, distances, points. Plain C99; library libraydix_c.

   Calls return a status. Where it is not RAYDIX_OK, raydix_last_error() says what was wrong and
   where, and results are as they were. No C++ exception leaves the library.

   Handles (raydix_scene*, ...) are made by *_create and *_load and belong to the caller, who ends
   them by *_destroy. To destroy NULL does nothing. Any other NULL is an error that names the
   argument, except where NULL has a meaning of its own or the array is empty.

   Arrays belong to the caller. They are read or written during the call only. Meshes and points
   are copied.

   Threads: any number of threads may ask one handle at once (const in the declaration). Calls that
   change a handle need it for themselves. To commit a scene, or to add one to another, also needs
   that no scene below changes meanwhile.

   Units: coordinates are float, in the caller's unit (raydix_c_double.h has the same calls in
   double); distances are in that unit, and never squared. t of a ray is in units of its direction,
   which need not have length 1. Coordinates beyond 1e12, infinite ones and NaN are out of range:
   what has them is left out and never found.

   Options may be NULL: all defaults. Otherwise start from the macro that sets the defaults:
       raydix_trace_options options = RAYDIX_TRACE_OPTIONS;
   Later versions add fields at the end only; `struct_size` says which ones the caller knew. */
#ifndef RAYDIX_C_H
#define RAYDIX_C_H

#include <math.h>
#include <stddef.h>
#include <stdint.h>

#if defined(__GNUC__)
#define RAYDIX_C_API __attribute__((visibility("default")))
#else
#define RAYDIX_C_API
#endif

#ifdef __cplusplus
extern "C" {
#endif

#define RAYDIX_MISSING 0xFFFFFFFFu /* in prim, geometry and indices: nothing was found */
#define RAYDIX_ALL 0xFFFFFFFFu     /* a mask: everything is seen */

typedef enum raydix_status {
    RAYDIX_OK = 0,
    RAYDIX_INPUT_ERROR = 1,      /* an argument or a file is at fault */
    RAYDIX_RESULT_TOO_LARGE = 2, /* the result would take more memory than it may */
    RAYDIX_UNAVAILABLE = 3,      /* this build or machine does not have what was asked for */
    RAYDIX_OUT_OF_MEMORY = 4,
    RAYDIX_INTERNAL_ERROR = 5 /* a fault of the library */
} raydix_status;

/* The message of the last call on this thread that failed; "" before the first. Valid until the
   next call on this thread that fails. */
RAYDIX_C_API const char* raydix_last_error(void);
/* Such as "0.1.0". */
RAYDIX_C_API const char* raydix_version(void);

/* ---- Threads ---------------------------------------------------------------------------- */

/* The caller's thread pool. Without one the library has threads of its own. */
typedef struct raydix_thread_pool {
    void* user; /* given to both functions */
    /* How many threads can work on one loop, the calling one included. */
    int (*workers)(void* user);
    /* Calls job(data, i) once for each i below `jobs`, on any threads and in any order, and
       returns when all of these calls have. A job waits for no other one. Several threads may call
       this at once. Neither function may throw or jump out. */
    void (*run)(void* user, size_t jobs, void (*job)(void* data, size_t number), void* data);
} raydix_thread_pool;

/* All loops run on this pool from now on; NULL: on the library's own threads. No other call may be
   at work meanwhile. `user` must stay valid until another pool takes over. No result depends on
   it. */
RAYDIX_C_API raydix_status raydix_use_thread_pool(const raydix_thread_pool* pool);

/* ---- Scenes ----------------------------------------------------------------------------- */

typedef struct raydix_scene raydix_scene;

typedef enum raydix_quality {
    RAYDIX_FAST = 0,     /* trees that are built each frame */
    RAYDIX_BALANCED = 1, /* once for some million rays */
    RAYDIX_HIGH = 2      /* once for many */
} raydix_quality;

typedef struct raydix_commit_options {
    size_t struct_size;
    int quality;  /* a raydix_quality. No hit depends on it */
    int moving;   /* 1: each mesh has a tree of its own, and changed ones are refitted */
    int compact;  /* 1: trees of about 60 % of the size */
    int strict;   /* 1: what would be left out is an error */
    int threads;  /* 0 to 1024; 0: all there are */
    int reserved; /* 0 */
} raydix_commit_options;
#define RAYDIX_COMMIT_OPTIONS \
    { sizeof(raydix_commit_options), RAYDIX_BALANCED, 0, 0, 0, 0, 0 }

/* An empty scene. */
RAYDIX_C_API raydix_status raydix_scene_create(raydix_scene** scene);
/* Reads a file (.ply .obj .stl .off .gltf .glb .rdx) or makes a built-in scene ("builtin:NAME"),
   and commits it. The ending of the path says what it is. The options have no effect on a scene
   that raydix_scene_save wrote, whose trees are read. Of an .rdx file that holds one tree the mesh
   is read, and a tree is built. */
RAYDIX_C_API raydix_status raydix_scene_load(const char* path, const raydix_commit_options* options,
                                             raydix_scene** scene);
RAYDIX_C_API void raydix_scene_destroy(raydix_scene* scene);
/* Writes a scene as its last commit left it, with the scenes that stand in it, to a file of type
   .rdx, which loads without building trees. A name that does not end in .rdx, changes that no
   commit has taken in and geometry of the caller's own are errors. */
RAYDIX_C_API raydix_status raydix_scene_save(const raydix_scene* scene, const char* path);

/* Points origin + t * direction for t in [tmin, tmax]. Rays that are not finite, have direction 0
   or tmin > tmax miss. tmax may be INFINITY. */
typedef struct raydix_ray {
    float origin[3], tmin, direction[3], tmax;
} raydix_ray;

/* The point (1-u-v)*v0 + u*v1 + v*v2 of triangle `prim` of geometry `geometry`. instance 0: of the
   scene itself; else a number for raydix_scene_path. A miss has t INFINITY, prim and geometry
   RAYDIX_MISSING. */
typedef struct raydix_hit {
    float t;
    uint32_t prim;
    float u, v;
    uint32_t geometry, instance;
} raydix_hit;

/* Geometries. `id`, may be NULL: receives the new geometry's number: 0, 1, 2, ... in the order of
   calls, never given again. A ray sees a geometry if mask & the ray's mask is not 0. */

/* vertices [3 * vertex_count], triangles [3 * triangle_count]: indices of vertices. */
RAYDIX_C_API raydix_status raydix_scene_add_mesh(raydix_scene* scene, const float* vertices,
                                                 size_t vertex_count, const uint32_t* triangles,
                                                 size_t triangle_count, uint32_t mask,
                                                 uint32_t* id);
/* spheres [4 * count]: center, radius. */
RAYDIX_C_API raydix_status raydix_scene_add_spheres(raydix_scene* scene, const float* spheres,
                                                    size_t count, uint32_t mask, uint32_t* id);
/* capsules [7 * count]: both ends of the axis, radius. */
RAYDIX_C_API raydix_status raydix_scene_add_capsules(raydix_scene* scene, const float* capsules,
                                                     size_t count, uint32_t mask, uint32_t* id);
/* points [3 * count], all with this radius. */
RAYDIX_C_API raydix_status raydix_scene_add_points(raydix_scene* scene, const float* points,
                                                   size_t count, float radius, uint32_t mask,
                                                   uint32_t* id);
/* Where a ray hits a primitive of the caller's own: sets t, u and v of `hit` and returns 1, or
   returns 0. The ray is in the geometry's own space. t outside [tmin, tmax] is no hit; tmax is the
   best hit so far. Round t to the type of the ray before it is compared with them: else which of
   equal hits counts depends on the path. Comes from several threads at once and in any order; the
   answer may depend on the arguments alone. It may trace and query, and must return. */
typedef int (*raydix_user_test)(void* user, uint32_t prim, const raydix_ray* ray, raydix_hit* hit);
/* Primitives that `test` intersects. boxes [6 * count]: low and high corner of the box around each.
   `user` must stay valid as long as a scene holds the geometry. */
RAYDIX_C_API raydix_status raydix_scene_add_user(raydix_scene* scene, const float* boxes,
                                                 size_t count, raydix_user_test test, void* user,
                                                 uint32_t mask, uint32_t* id);
/* An instance of `child` as its own last commit left it. transform [12]: three rows of four; x' =
   t[0]*x + t[1]*y + t[2]*z + t[3]. The child may be destroyed afterwards. */
RAYDIX_C_API raydix_status raydix_scene_add_instance(raydix_scene* scene, const raydix_scene* child,
                                                     const float* transform, uint32_t mask,
                                                     uint32_t* id);
/* Other vertices and triangles for a mesh; as many or not. */
RAYDIX_C_API raydix_status raydix_scene_update_mesh(raydix_scene* scene, uint32_t id,
                                                    const float* vertices, size_t vertex_count,
                                                    const uint32_t* triangles,
                                                    size_t triangle_count);
/* Other shapes of the same kind; as many or not. */
RAYDIX_C_API raydix_status raydix_scene_update_spheres(raydix_scene* scene, uint32_t id,
                                                       const float* spheres, size_t count);
RAYDIX_C_API raydix_status raydix_scene_update_capsules(raydix_scene* scene, uint32_t id,
                                                        const float* capsules, size_t count);
RAYDIX_C_API raydix_status raydix_scene_update_points(raydix_scene* scene, uint32_t id,
                                                      const float* points, size_t count,
                                                      float radius);
RAYDIX_C_API raydix_status raydix_scene_set_transform(raydix_scene* scene, uint32_t id,
                                                      const float* transform);
RAYDIX_C_API raydix_status raydix_scene_set_mask(raydix_scene* scene, uint32_t id, uint32_t mask);
RAYDIX_C_API raydix_status raydix_scene_remove(raydix_scene* scene, uint32_t id);

/* Takes all changes in. Until then rays and queries meet what the last commit saw. */
RAYDIX_C_API raydix_status raydix_scene_commit(raydix_scene* scene,
                                               const raydix_commit_options* options);

/* Number of geometries, those without a commit included. */
RAYDIX_C_API raydix_status raydix_scene_size(const raydix_scene* scene, uint32_t* size);
/* The box around all that the last commit saw; lo > hi if that is nothing. lo [3], hi [3]. */
RAYDIX_C_API raydix_status raydix_scene_bounds(const raydix_scene* scene, float* lo, float* hi);
/* The ids of the instances on the path `instance` of a hit, outermost first: the first `capacity`
   of them into ids, which may be NULL for 0. `count` receives how many there are. */
RAYDIX_C_API raydix_status raydix_scene_path(const raydix_scene* scene, uint32_t instance,
                                             uint32_t* ids, size_t capacity, size_t* count);

/* ---- Rays ------------------------------------------------------------------------------- */

/* Whether a hit counts: 1 or 0. `place` is the number of the ray in the call. Comes from several
   threads at once, in any order and any number of times, also for hits that turn out not to be the
   closest: the answer may depend on the arguments alone. It may trace and query, and must return.
 */
typedef int (*raydix_hit_filter)(void* user, size_t place, const raydix_ray* ray,
                                 const raydix_hit* hit);

typedef struct raydix_trace_options {
    size_t struct_size;
    uint32_t mask;             /* of all rays */
    int threads;               /* 0 to 1024; 0: all there are. No hit depends on it */
    const uint32_t* masks;     /* [count] one for each ray instead of mask; or NULL */
    raydix_hit_filter filter;  /* NULL: all hits count */
    void* user;                /* given to the filter */
    uint64_t max_result_bytes; /* of raydix_trace_all; 0: half of the memory that is left */
} raydix_trace_options;
#define RAYDIX_TRACE_OPTIONS \
    { sizeof(raydix_trace_options), RAYDIX_ALL, 0, NULL, NULL, NULL, 0 }

/* The closest hit of each ray: rays [count] -> hits [count]. At equal t the lower instance wins,
   then geometry, then prim. One ray alone goes through on the calling thread. */
RAYDIX_C_API raydix_status raydix_trace_closest(const raydix_scene* scene, const raydix_ray* rays,
                                                size_t count, raydix_hit* hits,
                                                const raydix_trace_options* options);
/* Whether each ray hits anything: 1 or 0. rays [count] -> occluded [count]. */
RAYDIX_C_API raydix_status raydix_trace_any(const raydix_scene* scene, const raydix_ray* rays,
                                            size_t count, uint8_t* occluded,
                                            const raydix_trace_options* options);
/* All hits of all rays: those of ray i are [offsets[i], offsets[i + 1]) of `hits`, sorted by (t,
   instance, geometry, prim). Each primitive comes at most once a ray. An edge belongs to one of its
   triangles here, so that a closed mesh is crossed an even number of times from outside. */
typedef struct raydix_hit_lists raydix_hit_lists;
/* Too many hits for max_result_bytes: RAYDIX_RESULT_TOO_LARGE, and no list. */
RAYDIX_C_API raydix_status raydix_trace_all(const raydix_scene* scene, const raydix_ray* rays,
                                            size_t count, raydix_hit_lists** lists,
                                            const raydix_trace_options* options);
RAYDIX_C_API void raydix_hit_lists_destroy(raydix_hit_lists* lists);
/* The arrays, which belong to `lists` and live as long as it does. Each of the last three may be
   NULL: not asked for. rays: their number; offsets [rays + 1]. */
RAYDIX_C_API raydix_status raydix_hit_lists_arrays(const raydix_hit_lists* lists, size_t* rays,
                                                   const uint64_t** offsets,
                                                   const raydix_hit** hits);
/* The point of each hit in world space: for triangles by u and v, else from the ray; NaN for a
   miss. rays [count], hits [count] -> positions [3 * count]. */
RAYDIX_C_API raydix_status raydix_hit_positions(const raydix_scene* scene, const raydix_ray* rays,
                                                const raydix_hit* hits, size_t count,
                                                float* positions, int threads);
/* The unit normal at each hit; NaN for a miss. In the mesh's own space it points to the side from
   which the corners of the triangle appear counter-clockwise. The outside of a mesh stays outside
   where an instance mirrors it; there the corners appear clockwise. A hit on geometry of the
   caller's own is an error. rays [count], hits [count] -> normals [3 * count]. */
RAYDIX_C_API raydix_status raydix_hit_normals(const raydix_scene* scene, const raydix_ray* rays,
                                              const raydix_hit* hits, size_t count, float* normals,
                                              int threads);

/* ---- Distances -------------------------------------------------------------------------- */

/* The point of a scene that is closest to a query. Of a triangle it is (1-u-v)*v0 + u*v1 + v*v2. Of
   a capsule u is the place along its axis, 0 at the first end and 1 at the second, and v is 0. Of a
   sphere and of a point both are 0. Nothing found: distance INFINITY, prim RAYDIX_MISSING. */
typedef struct raydix_closest_point {
    float position[3], distance;
    uint32_t prim, geometry, instance;
    float u, v;
} raydix_closest_point;

typedef struct raydix_closest_options {
    size_t struct_size;
    float max_distance; /* farther ones are not found. A small one saves time */
    uint32_t mask;
    int threads;
    int reserved; /* 0 */
} raydix_closest_options;
#define RAYDIX_CLOSEST_OPTIONS \
    { sizeof(raydix_closest_options), INFINITY, RAYDIX_ALL, 0, 0 }

/* queries [3 * count] -> results [count]. */
RAYDIX_C_API raydix_status raydix_closest_points(const raydix_scene* scene, const float* queries,
                                                 size_t count, raydix_closest_point* results,
                                                 const raydix_closest_options* options);

/* All meshes of a scene's last commit as one body. */
typedef struct raydix_solid raydix_solid;
/* Refers to nothing of the scene. A scene with spheres, capsules, points or geometry of the
   caller's own is an error. */
RAYDIX_C_API raydix_status raydix_solid_create(const raydix_scene* scene, raydix_solid** solid);
RAYDIX_C_API void raydix_solid_destroy(raydix_solid* solid);
/* 1: every edge belongs to an even number of triangles. Then inside is exact. */
RAYDIX_C_API raydix_status raydix_solid_is_closed(const raydix_solid* solid, int* closed);
/* Distances to the surface, negative inside. queries [3 * count] -> distances [count]. */
RAYDIX_C_API raydix_status raydix_signed_distances(const raydix_solid* solid, const float* queries,
                                                   size_t count, float* distances, int threads);
/* 1 inside and on the surface, else 0. queries [3 * count] -> inside [count]. */
RAYDIX_C_API raydix_status raydix_contains(const raydix_solid* solid, const float* queries,
                                           size_t count, uint8_t* inside, int threads);

/* ---- Points ----------------------------------------------------------------------------- */

/* An index over points in space. */
typedef struct raydix_points raydix_points;
/* points [3 * count]. threads as above. */
RAYDIX_C_API raydix_status raydix_points_create(const float* points, size_t count, int threads,
                                                raydix_points** index);
RAYDIX_C_API void raydix_points_destroy(raydix_points* index);
/* Points in the index; those out of range are not. */
RAYDIX_C_API raydix_status raydix_points_size(const raydix_points* index, size_t* size);
/* The k nearest of each query, by (distance, index): queries [3 * count] -> indices and distances
   [count * k]. A row with fewer ends with RAYDIX_MISSING and INFINITY. Both arrays are needed. */
RAYDIX_C_API raydix_status raydix_points_knn(const raydix_points* index, const float* queries,
                                             size_t count, uint32_t k, uint32_t* indices,
                                             float* distances, int threads);
/* The same among the points within max_distance, that distance itself included. 0 or more. */
RAYDIX_C_API raydix_status raydix_points_knn_within(const raydix_points* index,
                                                    const float* queries, size_t count, uint32_t k,
                                                    float max_distance, uint32_t* indices,
                                                    float* distances, int threads);
/* How many points are within the radius of each query, the radius itself included: queries
   [3 * count] -> counts [count]. */
RAYDIX_C_API raydix_status raydix_points_count(const raydix_points* index, const float* queries,
                                               size_t count, float radius, uint32_t* counts,
                                               int threads);

/* Rows of any length: row i is [offsets[i], offsets[i + 1]) of indices and distances. */
typedef struct raydix_lists raydix_lists;
/* Which points are within the radius of each query. sorted 1: rows by (distance, index), else by
   index. */
RAYDIX_C_API raydix_status raydix_points_radius(const raydix_points* index, const float* queries,
                                                size_t count, float radius, int sorted, int threads,
                                                raydix_lists** lists);
/* The same. A call that would take more than max_result_bytes: RAYDIX_RESULT_TOO_LARGE, and no
   lists. 0: half of the memory that is left. */
RAYDIX_C_API raydix_status raydix_points_radius_limited(const raydix_points* index,
                                                        const float* queries, size_t count,
                                                        float radius, int sorted,
                                                        uint64_t max_result_bytes, int threads,
                                                        raydix_lists** lists);
RAYDIX_C_API void raydix_lists_destroy(raydix_lists* lists);
/* The arrays, which belong to `lists` and live as long as it does. Each of the last four may be
   NULL: not asked for. rows: number of rows; offsets [rows + 1]. */
RAYDIX_C_API raydix_status raydix_lists_arrays(const raydix_lists* lists, size_t* rows,
                                               const uint64_t** offsets, const uint32_t** indices,
                                               const float** distances);

#ifdef __cplusplus
}
#endif
#endif
