// Camera -> one ray per pixel centre, in Morton order of the screen [width * height].
#include <raydix/rays.h>

#include "base/float_env.h"
#include "exec/parallel.h"
#include "rays/camera_frame.h"
#include "rays/screen_order.h"

namespace raydix {
namespace {

/// ray_at(frame, x, y) for each pixel.
template <class AnyRay, class AnyCamera, class RayAt>
std::vector<AnyRay> rays_of(const AnyCamera& camera, std::uint32_t width, std::uint32_t height,
                            std::vector<std::uint32_t>* pixels, const RayAt& ray_at) {
    const FloatEnvironment plain;
    const CameraFrame frame = make_camera_frame(camera, width, height);
    std::vector<std::uint32_t> order = pixels_in_morton_order(width, height);
    std::vector<AnyRay> rays(order.size());
    for_each_index(order.size(), [&](std::size_t i) {
        rays[i] = ray_at(frame, order[i] % width + 0.5, order[i] / width + 0.5);
    });
    if (pixels) *pixels = std::move(order);
    return rays;
}

}  // namespace

std::vector<Ray> make_primary_rays(const Camera& camera, std::uint32_t width, std::uint32_t height,
                                   std::vector<std::uint32_t>* pixels) {
    return rays_of<Ray>(camera, width, height, pixels, ray_through);
}

std::vector<RayD> make_primary_rays(const CameraD& camera, std::uint32_t width,
                                    std::uint32_t height, std::vector<std::uint32_t>* pixels) {
    return rays_of<RayD>(camera, width, height, pixels,
                         [](const CameraFrame& frame, double x, double y) {
                             RayD ray;
                             frame.position.round_to(ray.origin);
                             direction_through(frame, x, y).round_to(ray.direction);
                             return ray;
                         });
}

}  // namespace raydix
