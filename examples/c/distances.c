/* A cube and a moving copy of it in plain C: rays, distances, nearest points, the caller's threads.
   Each answer is compared with what geometry says. Exit code 0: all of them agree. */
#include <math.h>
#include <pthread.h>
#include <raydix_c.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const float corners[] = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0,
                                0, 0, 1, 1, 0, 1, 1, 1, 1, 0, 1, 1};
static const uint32_t faces[] = {0, 2, 1, 0, 3, 2, 4, 5, 6, 4, 6, 7, 0, 1, 5, 0, 5, 4,
                                 1, 2, 6, 1, 6, 5, 2, 3, 7, 2, 7, 6, 3, 0, 4, 3, 4, 7};

/* Ends the program with the library's message unless the call went well. */
static void check(raydix_status status, const char* call) {
    if (status == RAYDIX_OK) return;
    fprintf(stderr, "%s: error %d: %s\n", call, (int)status, raydix_last_error());
    exit(1);
}
#define CHECK(call) check(call, #call)

/* Ends the program if a value is not the expected one. */
static void expect(int holds, const char* what) {
    if (holds) return;
    fprintf(stderr, "wrong: %s\n", what);
    exit(1);
}
#define EXPECT(condition) expect(condition, #condition)

/* A thread pool as small as one can be: a thread for each job but the last. */
struct job {
    void (*run)(void* data, size_t number);
    void* data;
    size_t number;
};
static void* run_job(void* argument) {
    struct job* job = argument;
    job->run(job->data, job->number);
    return NULL;
}
static int pool_workers(void* user) {
    (void)user;
    return 3;
}
static void pool_run(void* user, size_t jobs, void (*run)(void* data, size_t number), void* data) {
    pthread_t threads[3];
    struct job list[3];
    size_t i, begun = 0;
    ++*(int*)user;
    for (i = 0; i + 1 < jobs && i < 2; ++i) {
        list[begun].run = run;
        list[begun].data = data;
        list[begun].number = i;
        if (pthread_create(&threads[begun], NULL, run_job, &list[begun]) == 0)
            ++begun;
        else
            run(data, i);
    }
    for (; i < jobs; ++i) run(data, i);
    for (i = 0; i < begun; ++i) pthread_join(threads[i], NULL);
}

/* The cube, and beside it an instance of it that is moved by 3 along x. */
static raydix_scene* make_world(void) {
    const float moved[12] = {1, 0, 0, 3, 0, 1, 0, 0, 0, 0, 1, 0};
    raydix_commit_options options = RAYDIX_COMMIT_OPTIONS;
    raydix_scene *cube, *world;
    uint32_t mesh = 99, instance = 99;
    options.quality = RAYDIX_FAST;
    CHECK(raydix_scene_create(&cube));
    CHECK(raydix_scene_add_mesh(cube, corners, 8, faces, 12, RAYDIX_ALL, NULL));
    CHECK(raydix_scene_commit(cube, &options));
    CHECK(raydix_scene_create(&world));
    CHECK(raydix_scene_add_mesh(world, corners, 8, faces, 12, 1, &mesh));
    CHECK(raydix_scene_add_instance(world, cube, moved, 2, &instance));
    CHECK(raydix_scene_commit(world, &options));
    raydix_scene_destroy(cube);
    EXPECT(mesh == 0 && instance == 1);
    return world;
}

static void shoot(const raydix_scene* world) {
    enum { count = 1000 };
    static raydix_ray rays[count];
    static raydix_hit hits[count];
    static uint8_t occluded[count];
    static float normals[3 * count];
    raydix_trace_options only_instance = RAYDIX_TRACE_OPTIONS;
    uint32_t path[4];
    size_t length = 0;
    int i;
    for (i = 0; i < count; ++i) { /* from above, at x from 0 to 4 */
        const raydix_ray ray = {{(float)i * 0.004f + 0.002f, 0.5f, 3}, 0, {0, 0, -2}, INFINITY};
        rays[i] = ray;
    }
    CHECK(raydix_trace_closest(world, rays, count, hits, NULL));
    CHECK(raydix_trace_any(world, rays, count, occluded, NULL));
    CHECK(raydix_hit_normals(world, rays, hits, count, normals, 0));
    for (i = 0; i < count; ++i) {
        const float x = rays[i].origin[0];
        const int hit = x < 1 || x > 3;
        EXPECT(occluded[i] == hit);
        EXPECT((hits[i].prim != RAYDIX_MISSING) == hit);
        if (!hit) continue;
        EXPECT(hits[i].t == 1); /* in units of the direction, whose length is 2 */
        EXPECT(hits[i].instance == (x > 3));
        EXPECT(normals[3 * i + 2] == 1);
    }
    CHECK(raydix_scene_path(world, 1, path, 4, &length));
    EXPECT(length == 1 && path[0] == 1);
    only_instance.mask = 2;
    CHECK(raydix_trace_closest(world, rays, 1, hits, &only_instance));
    EXPECT(hits[0].prim == RAYDIX_MISSING);
}

static void measure(const raydix_scene* world) {
    const float queries[] = {0.5f, 0.5f, 0.25f, 2, 0.5f, 0.5f, 3.5f, 0.5f, 2};
    raydix_closest_options near = RAYDIX_CLOSEST_OPTIONS;
    raydix_closest_point points[3];
    raydix_solid* solid;
    float distances[3];
    uint8_t inside[3];
    int closed = 0;
    CHECK(raydix_closest_points(world, queries, 3, points, NULL));
    EXPECT(points[0].distance == 0.25f && points[0].position[2] == 0);
    EXPECT(points[1].distance == 1 && points[1].instance == 0); /* as near: the lower one */
    EXPECT(points[2].distance == 1 && points[2].instance == 1);
    near.max_distance = 0.5f;
    CHECK(raydix_closest_points(world, queries, 3, points, &near));
    EXPECT(points[1].prim == RAYDIX_MISSING && isinf(points[1].distance));
    CHECK(raydix_solid_create(world, &solid));
    CHECK(raydix_solid_is_closed(solid, &closed));
    CHECK(raydix_signed_distances(solid, queries, 3, distances, 0));
    CHECK(raydix_contains(solid, queries, 3, inside, 0));
    EXPECT(closed && distances[0] == -0.25f && distances[1] == 1 && distances[2] == 1);
    EXPECT(inside[0] == 1 && inside[1] == 0 && inside[2] == 0);
    raydix_solid_destroy(solid);
}

static void find_neighbours(void) {
    enum { count = 100 };
    float line[3 * count];
    const float query[3] = {10.25f, 0, 0};
    raydix_points* index;
    raydix_lists* lists;
    const uint64_t* offsets;
    const uint32_t* found;
    const float* far;
    uint32_t nearest[3], within = 0;
    float distances[3];
    size_t rows = 0, size = 0, i;
    memset(line, 0, sizeof line);
    for (i = 0; i < count; ++i) line[3 * i] = (float)i;
    CHECK(raydix_points_create(line, count, 0, &index));
    CHECK(raydix_points_size(index, &size));
    CHECK(raydix_points_knn(index, query, 1, 3, nearest, distances, 0));
    EXPECT(size == count);
    EXPECT(nearest[0] == 10 && nearest[1] == 11 && nearest[2] == 9);
    EXPECT(distances[0] == 0.25f && distances[1] == 0.75f && distances[2] == 1.25f);
    CHECK(raydix_points_count(index, query, 1, 1.25f, &within, 0));
    CHECK(raydix_points_radius(index, query, 1, 1.25f, 1, 0, &lists));
    CHECK(raydix_lists_arrays(lists, &rows, &offsets, &found, &far));
    EXPECT(within == 3 && rows == 1 && offsets[0] == 0 && offsets[1] == 3);
    EXPECT(memcmp(found, nearest, sizeof nearest) == 0);
    EXPECT(memcmp(far, distances, sizeof distances) == 0);
    raydix_lists_destroy(lists);
    raydix_points_destroy(index);
}

/* What is wrong is refused, and the message says what it was. */
static void make_mistakes(raydix_scene* world) {
    const uint32_t far_index[3] = {0, 1, 8};
    raydix_commit_options options = RAYDIX_COMMIT_OPTIONS;
    raydix_scene* scene = NULL;
    EXPECT(raydix_scene_create(NULL) == RAYDIX_INPUT_ERROR);
    EXPECT(strcmp(raydix_last_error(), "scene is NULL") == 0);
    EXPECT(raydix_scene_add_mesh(world, corners, 8, far_index, 1, 1, NULL) == RAYDIX_INPUT_ERROR);
    EXPECT(strstr(raydix_last_error(), "8") != NULL);
    EXPECT(raydix_scene_add_mesh(world, NULL, 8, faces, 12, 1, NULL) == RAYDIX_INPUT_ERROR);
    EXPECT(strcmp(raydix_last_error(), "vertices is NULL") == 0);
    EXPECT(raydix_scene_load("no/such/file.ply", NULL, &scene) == RAYDIX_INPUT_ERROR);
    EXPECT(strstr(raydix_last_error(), "no/such/file.ply") != NULL && scene == NULL);
    EXPECT(raydix_scene_remove(world, 7) == RAYDIX_INPUT_ERROR);
    options.quality = 17;
    EXPECT(raydix_scene_commit(world, &options) == RAYDIX_INPUT_ERROR);
    options.struct_size = 1000;
    EXPECT(raydix_scene_commit(world, &options) == RAYDIX_INPUT_ERROR);
    EXPECT(strstr(raydix_last_error(), "struct_size") != NULL);
    raydix_scene_destroy(NULL);
}

int main(void) {
    int loops = 0;
    raydix_thread_pool pool = {&loops, pool_workers, pool_run};
    int round;
    for (round = 0; round < 2; ++round) {
        raydix_scene* world;
        if (round == 1) CHECK(raydix_use_thread_pool(&pool));
        world = make_world();
        shoot(world);
        measure(world);
        find_neighbours();
        make_mistakes(world);
        raydix_scene_destroy(world);
    }
    EXPECT(loops > 0); /* the second round ran on this program's threads */
    CHECK(raydix_use_thread_pool(NULL));
    printf("raydix %s: all answers as expected, %s\n", raydix_version(), "twice");
    return 0;
}
