// Tree or scene, and camera -> picture: the screen in tiles along its Morton order, each tile on
// one thread, one batch of rays per step of a view. What a tile holds stays in that core's caches.
#include <raydix/error.h>
#include <raydix/picture.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <string>

#include "base/float_env.h"
#include "base/math.h"
#include "base/options.h"
#include "exec/progress.h"
#include "image/picture_parts.h"
#include "image/render_light.h"
#include "image/render_scene.h"
#include "rays/sampling.h"
#include "rays/screen_order.h"
#include "report/colour_map.h"

namespace raydix {
namespace {

constexpr int max_samples = 4096;
constexpr std::array<std::string_view, 8> view_names = {"shaded", "normal",  "depth", "primitive",
                                                        "ao",     "diffuse", "steps", "path"};

/// Where in a pixel its rays go: the centre, or four points of a turned square.
constexpr double one_place[][2] = {{0.5, 0.5}};
constexpr double four_places[][2] = {
    {0.375, 0.125}, {0.875, 0.375}, {0.125, 0.625}, {0.625, 0.875}};

bool gathers_light(View view) {
    return view == View::shaded || view == View::ao || view == View::diffuse || view == View::path;
}

/// Light of `shaded` comes from the sun and an even sky, and is smooth with few rays.
int default_samples(View view) {
    return view == View::ao || view == View::path ? 64 : view == View::diffuse ? 32 : 16;
}

/// Rays of each pixel.
struct PixelRays {
    std::uint32_t primary, secondary;
};

PixelRays pixel_rays(const RenderOptions& options) {
    const auto samples = static_cast<std::uint32_t>(light_samples(options));
    return {samples >= 4 ? 4u : 1u, samples};
}

std::uint64_t rays_of(const RenderOptions& options) {
    const PixelRays per_pixel = pixel_rays(options);
    return std::uint64_t{options.width} * options.height *
           (per_pixel.primary + per_pixel.secondary);
}

RenderScene make_scene(const Tracer& tracer, const PictureCamera& camera,
                       const RenderOptions& options) {
    const PixelRays per_pixel = pixel_rays(options);
    Aabb box = tracer.bounds();
    const bool empty = !(box.lo.x <= box.hi.x);
    if (empty) box = {{0, 0, 0}, {0, 0, 0}};
    return {tracer,
            options,
            camera.frame,
            make_lights(tracer, camera.frame, camera.up),
            step_back_distance(box),
            empty ? 1.0f : ao_radius_or_default(box, options.ao_radius),
            per_pixel.primary,
            (per_pixel.secondary + per_pixel.primary - 1) / per_pixel.primary};
}

Vec3 grey(float value) { return {value, value, value}; }

/// One number for each triangle; its own in a scene of one mesh.
std::uint32_t number_of(const Hit& hit) {
    if (hit.geometry == 0 && hit.instance == 0) return hit.prim;
    return hit.prim ^ static_cast<std::uint32_t>(hash_of(hit.instance, hit.geometry));
}

/// Normal, depth and primitive: one value per pixel, from its hit alone. Depth stays a distance
/// along the view for now.
Vec3 surface_value(const RenderScene& scene, const Ray& ray, const Hit& hit,
                   const Double3& normal) {
    if (!hit.hit()) return scene.options.view == View::depth ? grey(infinity) : grey(0.0f);
    switch (scene.options.view) {
        case View::primitive:
            return id_colour(number_of(hit));
        case View::depth:
            return grey(
                static_cast<float>(hit.t * dot(Double3(ray.direction), scene.frame.forward)));
        default:
            return 0.5f * (normal_toward(normal, ray.direction) + grey(1.0f));
    }
}

std::vector<Vec3> surface_values(const RenderScene& scene, const PrimarySamples& primary) {
    std::vector<Vec3> values(primary.rays.size());
    for (std::size_t i = 0; i < values.size(); ++i)
        values[i] = surface_value(scene, primary.rays[i], primary.hits[i], primary.normals[i]);
    return values;
}

/// Primary rays of the tile, in a row for each pixel.
std::vector<Ray> primary_rays(const RenderScene& scene, std::span<const std::uint32_t> pixels) {
    const std::uint32_t per_pixel = scene.rays_per_pixel, width = scene.options.width;
    const auto* places = per_pixel == 4 ? four_places : one_place;
    std::vector<Ray> rays(pixels.size() * per_pixel);
    for (std::size_t i = 0; i < rays.size(); ++i) {
        const std::uint32_t pixel = pixels[i / per_pixel];
        const auto& place = places[i % per_pixel];
        rays[i] = ray_through(scene.frame, pixel % width + place[0], pixel / width + place[1]);
    }
    return rays;
}

/// Node visits of each pixel's ray, as a count for now.
std::vector<Vec3> step_counts(const RenderScene& scene, std::span<const std::uint32_t> pixels) {
    const std::vector<Ray> rays = primary_rays(scene, pixels);
    std::vector<std::uint32_t> visits(rays.size());
    scene.tracer.count_steps(rays, visits);
    std::vector<Vec3> counts(rays.size());
    for (std::size_t i = 0; i < counts.size(); ++i) counts[i] = grey(static_cast<float>(visits[i]));
    return counts;
}

std::vector<Vec3> tile_samples(const RenderScene& scene, std::span<const std::uint32_t> pixels) {
    if (scene.options.view == View::steps) return step_counts(scene, pixels);
    const PrimarySamples primary = trace_primary(scene, pixels);
    switch (scene.options.view) {
        case View::shaded:
            return shade_samples(scene, primary);
        case View::ao:
            return open_sky_samples(scene, primary);
        case View::diffuse:
            return diffuse_samples(scene, primary);
        case View::path:
            return path_samples(scene, primary);
        default:
            return surface_values(scene, primary);
    }
}

/// Distances -> 1 at the nearest hit of the picture down to 1/10 at the farthest; nothing hit is 0.
void scale_depth(Picture& picture) {
    float nearest = infinity, farthest = 0.0f;
    for (const Vec3& p : picture.pixels) {
        if (p.x == infinity) continue;
        nearest = std::min(nearest, p.x);
        farthest = std::max(farthest, p.x);
    }
    const float range = farthest > nearest ? farthest - nearest : 1.0f;
    for (Vec3& p : picture.pixels)
        p = p.x == infinity ? grey(0.0f) : grey(1.0f - 0.9f * (p.x - nearest) / range);
}

/// Counts -> heat map. Its top is the count that 1 pixel in 200 exceeds, so that a few extremes do
/// not darken all.
void colour_steps(Picture& picture) {
    std::vector<float> counts(picture.pixels.size());
    for (std::size_t i = 0; i < counts.size(); ++i) counts[i] = picture.pixels[i].x;
    const auto place =
        counts.begin() + static_cast<std::ptrdiff_t>((counts.size() - 1) * 199 / 200);
    std::nth_element(counts.begin(), place, counts.end());
    const float top = std::max(*place, 1.0f);
    for (Vec3& p : picture.pixels) p = heat_colour(p.x / top);
}

void render_tiles(const PictureParts& parts, const RenderOptions& options, Picture& picture) {
    const std::span<const std::uint32_t> pixels = parts.pixels();
    picture.pixels.resize(pixels.size());
    ProgressListener listener(options.progress);
    const ProgressCounter progress({&listener, 0, 1}, static_cast<double>(pixels.size()));
    for_each_block(pixels.size(), parts.pixels_of_rays(PictureParts::rays_of_thread),
                   [&](std::size_t, std::size_t begin, std::size_t end) {
                       const std::vector<Vec3> colours = parts.render(begin, end);
                       for (std::size_t i = begin; i < end; ++i)
                           picture.pixels[pixels[i]] = colours[i - begin];
                       progress.add(static_cast<double>(end - begin));
                   });
    listener.finish();
}

/// `take` calls picture_of(tracer) once.
template <class Take>
Picture render_with(const PictureCamera& camera, const RenderOptions& options, const Take& take) {
    Picture picture{options.width, options.height, {}};
    with_threads(options.threads, [&] {
        take([&](const Tracer& tracer) {
            render_tiles(PictureParts(tracer, camera, options), options, picture);
        });
    });
    finish_picture(picture, options.view);
    return picture;
}

}  // namespace

void check_render_options(const RenderOptions& options) {
    check_enum("view", options.view, View::path);
    if (options.samples < 0 || options.samples > max_samples)
        throw InputError("render: samples is " + std::to_string(options.samples) +
                         "; it must be 0.." + std::to_string(max_samples));
}

PictureCamera picture_camera(const Camera& camera, const RenderOptions& options, Double3 middle) {
    CameraFrame frame = make_camera_frame(camera, options.width, options.height);
    frame.position = frame.position - middle;
    return {frame, camera.up};
}

PictureCamera picture_camera(const CameraD& camera, const RenderOptions& options, Double3 middle) {
    CameraFrame frame = make_camera_frame(camera, options.width, options.height);
    frame.position = frame.position - middle;
    return {frame, normalized(Double3(camera.up)).rounded()};
}

PictureParts::PictureParts(const Tracer& tracer, const PictureCamera& camera,
                           const RenderOptions& options)
    : scene_(make_scene(tracer, camera, options)),
      order_(pixels_in_morton_order(options.width, options.height)) {}

std::size_t PictureParts::pixels_of_rays(std::size_t rays) const {
    const std::size_t per_pixel = scene_.rays_per_pixel * (scene_.samples_per_ray + 1);
    return std::bit_floor(std::max<std::size_t>(16, rays / per_pixel));
}

/// A pixel is the mean of its samples.
std::vector<Vec3> PictureParts::render(std::size_t begin, std::size_t end) const {
    const std::size_t rays_per_pixel = scene_.rays_per_pixel;
    const std::vector<Vec3> samples =
        tile_samples(scene_, std::span(order_).subspan(begin, end - begin));
    std::vector<Vec3> colours(end - begin);
    for (std::size_t i = 0; i < colours.size(); ++i) {
        Vec3 sum = samples[i * rays_per_pixel];
        for (std::size_t k = 1; k < rays_per_pixel; ++k)
            sum = sum + samples[i * rays_per_pixel + k];
        colours[i] = (1.0f / static_cast<float>(rays_per_pixel)) * sum;
    }
    return colours;
}

void finish_picture(Picture& picture, View view) {
    if (view == View::depth) scale_depth(picture);
    if (view == View::steps) colour_steps(picture);
}

std::vector<SurfacePoint> points_of_hits(const RenderScene& scene, std::span<const Ray> rays,
                                         std::span<const Hit> hits,
                                         std::span<const Double3> normals,
                                         std::span<const std::uint32_t> positions) {
    std::vector<SurfacePoint> points(positions.size());
    for (std::size_t k = 0; k < positions.size(); ++k) {
        const std::uint32_t i = positions[k];
        points[k] = surface_point(normals[i], rays[i], hits[i].t, 0, scene.step_back);
    }
    return points;
}

PrimarySamples trace_primary(const RenderScene& scene, std::span<const std::uint32_t> pixels) {
    PrimarySamples primary;
    primary.rays = primary_rays(scene, pixels);
    primary.hits.resize(primary.rays.size());
    primary.normals.resize(primary.rays.size());
    scene.tracer.closest(primary.rays, primary.hits, primary.normals);
    primary.hit_positions = positions_of_hits(primary.hits);
    primary.points =
        points_of_hits(scene, primary.rays, primary.hits, primary.normals, primary.hit_positions);
    for (std::size_t k = 0; k < primary.points.size(); ++k) {
        const std::uint32_t i = primary.hit_positions[k];
        primary.points[k].pixel = pixels[i / scene.rays_per_pixel];
        primary.points[k].sequence = i % scene.rays_per_pixel;
    }
    return primary;
}

int light_samples(const RenderOptions& options) {
    if (!gathers_light(options.view)) return 0;
    const int asked = options.samples > 0 ? options.samples : default_samples(options.view);
    return asked >= 4 ? (asked + 3) / 4 * 4 : asked;
}

bool is_tone_mapped(View view) {
    return view == View::shaded || view == View::diffuse || view == View::path;
}

std::string_view view_name(View view) {
    const auto i = static_cast<std::size_t>(view);
    return i < view_names.size() ? view_names[i] : "unknown";
}

View view_from_name(std::string_view name) {
    const auto found = std::find(view_names.begin(), view_names.end(), name);
    if (found != view_names.end()) return static_cast<View>(found - view_names.begin());
    std::string message = "unknown view '" + std::string(name) + "'; known:";
    for (const std::string_view known : view_names) message.append(" ").append(known);
    throw InputError(message);
}

Picture render(const Bvh& bvh, const Camera& camera, const RenderOptions& options) {
    const FloatEnvironment plain;
    check_render_options(options);
    require_triangles(bvh, "render");
    return render_with(picture_camera(camera, options), options, [&](const auto& picture_of) {
        const std::uint64_t rays = options.view == View::steps ? 0 : rays_of(options);
        picture_of(BvhTracer(bvh, rays));
    });
}

Picture render(const Scene& scene, const Camera& camera, const RenderOptions& options) {
    const FloatEnvironment plain;
    check_render_options(options);
    return render_with(picture_camera(camera, options), options,
                       [&](const auto& picture_of) { picture_of(SceneTracer(scene)); });
}

Picture render(const SceneD& scene, const CameraD& camera, const RenderOptions& options) {
    const FloatEnvironment plain;
    check_render_options(options);
    const SceneTracerD tracer(scene);
    return render_with(picture_camera(camera, options, tracer.middle()), options,
                       [&](const auto& picture_of) { picture_of(tracer); });
}

}  // namespace raydix
