// A picture in parts: pixels in the Morton order of the screen, for whoever shares them out among
// threads or processes. A pixel does not depend on the part that it comes in.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "image/render_scene.h"

namespace raydix {

/// Throws InputError for a view or a number of samples out of range.
void check_render_options(const RenderOptions& options);

/// A camera in the space of a tracer.
struct PictureCamera {
    CameraFrame frame;
    Vec3 up;
};
/// `middle`: the origin of that space in the camera's.
[[nodiscard]] PictureCamera picture_camera(const Camera& camera, const RenderOptions& options,
                                           Double3 middle = {});
[[nodiscard]] PictureCamera picture_camera(const CameraD& camera, const RenderOptions& options,
                                           Double3 middle);

class PictureParts {
public:
    /// Of a part that one thread renders: what it holds stays in a core's caches.
    static constexpr std::size_t rays_of_thread = std::size_t{1} << 15;

    /// Traces a few rays for the light. The tracer and the options must outlive this.
    PictureParts(const Tracer& tracer, const PictureCamera& camera, const RenderOptions& options);

    /// All pixels, in order.
    [[nodiscard]] std::span<const std::uint32_t> pixels() const { return order_; }
    /// How many pixels take about so many rays, secondary ones included; a power of two.
    [[nodiscard]] std::size_t pixels_of_rays(std::size_t rays) const;
    /// Colours of pixels()[begin..end), on this thread. The calls of the tracer are the same for
    /// every part, an empty one too; only their rays differ.
    [[nodiscard]] std::vector<Vec3> render(std::size_t begin, std::size_t end) const;

private:
    RenderScene scene_;
    std::vector<std::uint32_t> order_;
};

/// Of a picture whose pixels are all there: views that need to see the whole before its colours.
void finish_picture(Picture& picture, View view);

}  // namespace raydix
