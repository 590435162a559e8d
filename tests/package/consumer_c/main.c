/* A ray from above onto a square of two triangles. */
#include <raydix_c.h>
#include <raydix_c_double.h>
#include <stdio.h>

int main(void) {
    const float vertices[] = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};
    const uint32_t triangles[] = {0, 1, 2, 0, 2, 3};
    const raydix_ray ray = {{0.75f, 0.25f, 2}, 0, {0, 0, -1}, INFINITY};
    raydix_hit hit;
    raydix_scene* scene = NULL;
    int failed = raydix_scene_create(&scene) ||
                 raydix_scene_add_mesh(scene, vertices, 4, triangles, 2, RAYDIX_ALL, NULL) ||
                 raydix_scene_commit(scene, NULL) ||
                 raydix_trace_closest(scene, &ray, 1, &hit, NULL);
    if (failed)
        printf("%s\n", raydix_last_error());
    else
        printf("triangle %u at t = %g\n", (unsigned)hit.prim, (double)hit.t);
    raydix_scene_destroy(scene);
    return failed;
}
