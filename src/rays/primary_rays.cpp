// Camera -> one ray per pixel centre, in Morton order of the screen [width * height].
#include <raydix/rays.h>

#include "exec/parallel.h"
#include "rays/camera_frame.h"
#include "rays/screen_order.h"

namespace raydix {

std::vector<Ray> make_primary_rays(const Camera& camera, std::uint32_t width, std::uint32_t height,
                                   std::vector<std::uint32_t>* pixels) {
    const CameraFrame frame = make_camera_frame(camera, width, height);
    std::vector<std::uint32_t> order = pixels_in_morton_order(width, height);
    std::vector<Ray> rays(order.size());
    for_each_index(order.size(), [&](std::size_t i) {
        rays[i] = ray_through(frame, order[i] % width + 0.5, order[i] / width + 0.5);
    });
    if (pixels) *pixels = std::move(order);
    return rays;
}

}  // namespace raydix
