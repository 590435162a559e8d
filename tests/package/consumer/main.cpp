// A ray from above onto a square of two triangles.
#include <raydix/bvh.h>
#include <raydix/raydix.h>
#include <raydix/trace.h>

#include <cstdio>

int main() {
    raydix::Mesh mesh;
    mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
    mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
    const raydix::Bvh bvh = raydix::build_bvh(mesh);
    const raydix::Ray ray{.origin = {0.75f, 0.25f, 2}, .direction = {0, 0, -1}};
    const raydix::Hit hit = raydix::closest_hit(bvh, ray);
    std::printf("triangle %u at t = %g\n", hit.prim, static_cast<double>(hit.t));
    return hit.hit() ? 0 : 1;
}
