#include <raydix/raydix.h>

#include <cstdio>
int main() {
    const raydix::Model model = raydix::load_model("builtin:figure?triangles=20000");
    const raydix::Scene scene(model);
    const auto rays = raydix::make_primary_rays(model.cameras.cameras[0], 640, 480);
    std::size_t found = 0;
    for (const raydix::Hit& hit : raydix::trace(scene, rays)) found += hit.hit();
    std::printf("%zu of %zu rays hit the figure\n", found, rays.size());
    return found != 0 ? 0 : 1;
}
