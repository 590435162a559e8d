// The view of a tree: the shaded scene or its points, then the boxes level by level, last ones
// first, each level as one mask of lines.
#include <raydix/trace.h>
#include <raydix/tree_view.h>

#include <algorithm>
#include <functional>
#include <vector>

#include "base/float_env.h"
#include "image/tree_picture.h"

#include "base/double3.h"
#include "base/math.h"
#include "exec/parallel.h"
#include "rays/camera_frame.h"
#include "report/colour_map.h"
#include "report/line_mask.h"
#include "report/srgb.h"

namespace raydix {
namespace {

constexpr float scene_light = 0.40f;   // of the shaded picture under the lines
constexpr float sky_light = 0.06f;     // of the sky around it
constexpr double behind = 0.30;        // strength of lines behind a surface
constexpr double depth_slack = 0.004;  // a line that lies on a surface is in front of it
constexpr double width_per_pixel = 1.0 / 1024;

/// Points of space -> ends of lines on the screen.
class Screen {
public:
    explicit Screen(const CameraFrame& frame)
        : frame_(frame),
          per_right_(1 / dot(frame.right, frame.right)),
          per_up_(1 / dot(frame.up, frame.up)) {}

    /// In the camera's axes: right and up in halves of the screen at distance 1, and distance.
    [[nodiscard]] Double3 seen(const Double3& p) const {
        const Double3 from = p - frame_.position;
        return {dot(from, frame_.right) * per_right_, dot(from, frame_.up) * per_up_,
                dot(from, frame_.forward)};
    }
    [[nodiscard]] LineMask::End end_at(const Double3& seen) const {
        return {0.5 * frame_.width * (1 + seen.x / seen.z),
                0.5 * frame_.height * (1 - seen.y / seen.z), 1 / seen.z};
    }

private:
    const CameraFrame& frame_;
    double per_right_, per_up_;
};

/// Inverse distances along the view of what each pixel shows, 0 where nothing is.
std::vector<float> inverse_depths(const Bvh& scene, const CameraFrame& frame,
                                  const RenderOptions& options) {
    std::vector<Ray> rays(std::size_t{options.width} * options.height);
    for_each_index(rays.size(), [&](std::size_t i) {
        rays[i] = ray_through(frame, static_cast<double>(i % options.width) + 0.5,
                              static_cast<double>(i / options.width) + 0.5);
    });
    std::vector<float> result(rays.size(), 0.0f);
    if (scene.kind() != PrimitiveKind::triangles || scene.empty()) return result;
    const std::vector<Hit> hits = trace(scene, rays);
    for (std::size_t i = 0; i < hits.size(); ++i)
        if (hits[i].hit())
            result[i] = static_cast<float>(
                1 / (hits[i].t * dot(Double3(rays[i].direction), frame.forward)));
    return result;
}

/// Cuts the segment at the plane just before the camera.
bool clip_near(Double3& a, Double3& b, double near) {
    if (a.z < near && b.z < near) return false;
    Double3& outside = a.z < near ? a : b;
    const Double3& inside = a.z < near ? b : a;
    if (outside.z < near)
        outside = outside + (inside - outside) * ((near - outside.z) / (inside.z - outside.z));
    return true;
}

template <class Draw>
void for_each_edge(const Aabb& box, const Draw& draw) {
    const auto corner = [&](int i) {
        return Double3(Vec3{(i & 1) != 0 ? box.hi.x : box.lo.x, (i & 2) != 0 ? box.hi.y : box.lo.y,
                            (i & 4) != 0 ? box.hi.z : box.lo.z});
    };
    for (int i = 0; i < 8; ++i)
        for (const int bit : {1, 2, 4})
            if ((i & bit) == 0) draw(corner(i), corner(i | bit));
}

void draw_levels(Picture& picture, const CameraFrame& frame, std::span<const LevelBox> boxes,
                 const std::vector<float>& surface, double near) {
    const LevelScale scale(boxes);
    const Screen screen(frame);
    const double unit = std::max(0.5, picture.width * width_per_pixel);
    LineMask mask(picture.width, picture.height);
    const auto shade = [&](std::size_t pixel, double inverse_depth) {
        return inverse_depth * (1 + depth_slack) < double(surface[pixel]) ? behind : 1.0;
    };
    std::vector<std::uint32_t> levels;  // that have boxes, from the last up
    for (const LevelBox& b : boxes) levels.push_back(b.level);
    std::ranges::sort(levels, std::greater<>());
    levels.erase(std::unique(levels.begin(), levels.end()), levels.end());
    for (const std::uint32_t level : levels) {
        const float part = scale.part(level);
        const double line_width = unit * (2.4 - 1.5 * double(part));
        mask.clear();
        for (const LevelBox& b : boxes) {
            if (b.level != level) continue;
            for_each_edge(b.box, [&](const Double3& from, const Double3& to) {
                Double3 s = screen.seen(from), t = screen.seen(to);
                if (!clip_near(s, t, near)) return;
                mask.add_line(screen.end_at(s), screen.end_at(t), line_width, shade);
            });
        }
        blend(picture, mask, heat_colour(1.0f - 0.55f * part), 0.95f - 0.2f * part);
    }
}

/// A dark sky with one dot per point.
Picture dots(const Bvh& scene, const CameraFrame& frame, const RenderOptions& options,
             double near) {
    Picture picture{options.width, options.height, {}};
    picture.pixels.assign(std::size_t{options.width} * options.height, Vec3{0.012f, 0.014f, 0.02f});
    const Screen screen(frame);
    LineMask mask(options.width, options.height);
    const double size = std::max(0.6, 1.9 * options.width * width_per_pixel);
    for (const Vec3& p : scene.points()) {
        const Double3 seen = screen.seen(Double3(p));
        if (seen.z < near) continue;
        const LineMask::End at = screen.end_at(seen);
        mask.add_line(at, at, size, [](std::size_t, double) { return 1.0; });
    }
    blend(picture, mask, {0.35f, 0.42f, 0.5f}, 0.9f);
    return picture;
}

Picture shaded_below(const Bvh& scene, const Camera& camera, const RenderOptions& options,
                     const std::vector<float>& surface) {
    RenderOptions shaded = options;
    shaded.view = View::shaded;
    Picture picture = render(scene, camera, shaded);
    // Grey and darker: colours belong to the levels.
    for (std::size_t i = 0; i < surface.size(); ++i) {
        Vec3& p = picture.pixels[i];
        p = {film_curve(p.x), film_curve(p.y), film_curve(p.z)};
        const float light = 0.2126f * p.x + 0.7152f * p.y + 0.0722f * p.z;
        p = (surface[i] > 0.0f ? scene_light : sky_light) *
            (0.35f * p + 0.65f * Vec3{light, light, light});
    }
    return picture;
}

}  // namespace

Picture render_tree(const Bvh& scene, const Camera& camera, std::span<const LevelBox> boxes,
                    const RenderOptions& options) {
    const FloatEnvironment plain;
    const CameraFrame frame = make_camera_frame(camera, options.width, options.height);
    const Aabb bounds = scene.bounds();
    const Double3 size = Double3(bounds.hi) - Double3(bounds.lo);
    const double near = scene.empty() ? 1e-6 : std::max(1e-4 * length(size), 1e-30);
    Picture picture;
    with_threads(options.threads, [&] {
        const std::vector<float> surface = inverse_depths(scene, frame, options);
        picture = scene.kind() == PrimitiveKind::points && !scene.empty()
                      ? dots(scene, frame, options, near)
                      : shaded_below(scene, camera, options, surface);
        if (!boxes.empty()) draw_levels(picture, frame, boxes, surface, near);
    });
    return picture;
}

}  // namespace raydix
