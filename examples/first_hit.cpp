#include <raydix/raydix.h>

#include <cstdio>
int main() {
    const raydix::Model scene = raydix::load_model("builtin:figure?triangles=20000");
    const raydix::Bvh bvh = raydix::build_bvh(scene.mesh);
    const auto rays = raydix::make_primary_rays(scene.cameras.cameras[0], 640, 480);
    std::size_t found = 0;
    for (const raydix::Hit& hit : raydix::trace(bvh, rays)) found += hit.hit();
    std::printf("%zu of %zu rays hit the figure\n", found, rays.size());
    return found != 0 ? 0 : 1;
}
