// Every surface is the same grey; what differs between the views is where the light comes from.
#include "image/render_light.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/double3.h"
#include "base/math.h"
#include "rays/sampling.h"

namespace raydix {
namespace {

constexpr Vec3 surface_grey{0.72f, 0.70f, 0.67f};
constexpr Vec3 sun_light{0.95f, 0.88f, 0.76f};
/// Lamp in the open, where it only softens shadows, and in a closed room, where it is the light.
constexpr Vec3 lamp_outside{0.15f, 0.15f, 0.14f};
constexpr Vec3 lamp_inside{0.58f, 0.56f, 0.52f};
constexpr Vec3 zenith_light{0.19f, 0.28f, 0.43f};
constexpr Vec3 horizon_light{0.48f, 0.53f, 0.59f};
constexpr std::uint32_t most_bounces = 8;
/// Stands for all that further bounces would add to a surface, so that closed rooms do not go dark.
constexpr Vec3 later_light{0.20f, 0.20f, 0.20f};
/// The even light of a closed room, from below and from above.
constexpr Vec3 room_below{0.20f, 0.19f, 0.18f};
constexpr Vec3 room_above{0.42f, 0.43f, 0.45f};
constexpr Vec3 ground_light{0.20f, 0.19f, 0.18f};

Vec3 tinted(Vec3 a, Vec3 b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }
Vec3 between(Vec3 a, Vec3 b, float part) { return a + part * (b - a); }

/// Sky and ground as a matt surface with this normal sees them, without anything in between;
/// indoors an even light.
Vec3 ambient_light(const Lights& lights, Vec3 normal) {
    const Vec3 sky = 0.5f * (zenith_light + horizon_light);
    const float upward = 0.5f + 0.5f * dot(normal, lights.up);
    const Vec3 outside = between(ground_light, sky, upward);
    return between(outside, between(room_below, room_above, upward), lights.enclosed);
}

/// Which points face a light and see it; toward(point) is the ray there. [points]
template <class Toward>
std::vector<std::uint8_t> lit_points(const RenderScene& scene, std::span<const SurfacePoint> points,
                                     const Toward& toward) {
    std::vector<Ray> rays;
    std::vector<std::uint32_t> facing;
    for (std::size_t i = 0; i < points.size(); ++i) {
        const Ray ray = toward(points[i]);
        if (!(dot(points[i].normal, ray.direction) > 0.0f)) continue;
        rays.push_back(ray);
        facing.push_back(static_cast<std::uint32_t>(i));
    }
    std::vector<std::uint8_t> occluded(rays.size()), lit(points.size(), 0);
    scene.tracer.occluded(rays, occluded);
    for (std::size_t k = 0; k < rays.size(); ++k) lit[facing[k]] = !occluded[k];
    return lit;
}

/// What the camera sees, the lamp sees too, since it is there: no ray is needed.
enum class SeenBy { camera, reflection };

/// Light of sun and lamp on each point, shadows included, before the surface's own colour. [points]
std::vector<Vec3> direct_light(const RenderScene& scene, std::span<const SurfacePoint> points,
                               SeenBy seen_by) {
    const Lights& lights = scene.lights;
    const auto in_sun = lit_points(scene, points, [&](const SurfacePoint& point) {
        return Ray{point.origin, 0.0f, lights.sun, infinity};
    });
    std::vector<std::uint8_t> in_lamplight(points.size(), 1);
    if (seen_by == SeenBy::reflection)
        in_lamplight = lit_points(scene, points, [&](const SurfacePoint& point) {
            return Ray{point.origin, 0.0f, lights.lamp - point.origin, 1.0f};
        });

    const Vec3 lamp_light = between(lamp_outside, lamp_inside, lights.enclosed);
    std::vector<Vec3> light(points.size());
    for (std::size_t i = 0; i < points.size(); ++i) {
        const Double3 normal(points[i].normal);
        const Double3 to_lamp = Double3(lights.lamp) - Double3(points[i].origin);
        const double sun_cosine = dot(normal, Double3(lights.sun));
        const double lamp_distance = length(to_lamp);
        const double lamp_cosine = lamp_distance > 0.0 ? dot(normal, to_lamp) / lamp_distance : 0.0;
        Vec3 sum{0, 0, 0};
        if (sun_cosine > 0.0 && in_sun[i]) sum = sum + static_cast<float>(sun_cosine) * sun_light;
        if (lamp_cosine > 0.0 && in_lamplight[i])
            sum = sum + static_cast<float>(lamp_cosine) * lamp_light;
        light[i] = sum;
    }
    return light;
}

std::vector<Ray> hemisphere_rays(const RenderScene& scene, std::span<const SurfacePoint> points,
                                 float tmax) {
    HemisphereOptions options;
    options.samples = scene.samples_per_ray;
    options.sequences = scene.rays_per_pixel;
    options.tmax = tmax;
    options.seed = scene.options.seed;
    std::vector<Ray> rays(points.size() * options.samples);
    make_hemisphere_rays(points, options, rays);
    return rays;
}

/// The part of the rays above each point that get as far as the AO radius. [points]
std::vector<float> open_parts(const RenderScene& scene, std::span<const SurfacePoint> points) {
    const std::vector<Ray> rays = hemisphere_rays(scene, points, scene.ao_radius);
    std::vector<std::uint8_t> occluded(rays.size());
    scene.tracer.occluded(rays, occluded);
    const std::uint32_t per_point = scene.samples_per_ray;
    std::vector<float> open(points.size());
    for (std::size_t i = 0; i < points.size(); ++i) {
        std::uint32_t blocked = 0;
        for (std::uint32_t k = 0; k < per_point; ++k) blocked += occluded[i * per_point + k];
        open[i] = 1.0f - static_cast<float>(blocked) / static_cast<float>(per_point);
    }
    return open;
}

/// The mean of each `per_point` values in a row.
std::vector<Vec3> means(const std::vector<Vec3>& values, std::uint32_t per_point) {
    std::vector<Vec3> mean(values.size() / per_point);
    for (std::size_t i = 0; i < mean.size(); ++i) {
        Vec3 sum{0, 0, 0};
        for (std::uint32_t k = 0; k < per_point; ++k) sum = sum + values[i * per_point + k];
        mean[i] = (1.0f / static_cast<float>(per_point)) * sum;
    }
    return mean;
}

/// What arrives at each point over the hemisphere: sky where a ray escapes, lit surface where it
/// hits. [points]
std::vector<Vec3> bounced_light(const RenderScene& scene, std::span<const SurfacePoint> points) {
    const std::vector<Ray> rays = hemisphere_rays(scene, points, infinity);
    std::vector<Hit> hits(rays.size());
    std::vector<Double3> normals(rays.size());
    scene.tracer.closest(rays, hits, normals);
    const std::vector<std::uint32_t> positions = positions_of_hits(hits);
    const std::vector<SurfacePoint> seen = points_of_hits(scene, rays, hits, normals, positions);
    const std::vector<Vec3> light_on_seen = direct_light(scene, seen, SeenBy::reflection);

    std::vector<Vec3> arriving(rays.size());
    for (std::size_t i = 0; i < rays.size(); ++i) {
        if (!hits[i].hit()) arriving[i] = sky_colour(scene.lights, rays[i].direction);
    }
    for (std::size_t k = 0; k < positions.size(); ++k) {
        arriving[positions[k]] = tinted(surface_grey, light_on_seen[k] + later_light);
    }
    return means(arriving, scene.samples_per_ray);
}

/// A bounce of path `number` of the `paths` of a pixel. Those of a pixel part evenly, about places
/// that chance gives for each pixel and bounce: so every path goes anywhere, whatever it did
/// before.
Ray ray_of_path(const SurfacePoint& from, std::uint64_t seed, std::uint32_t pixel,
                std::uint32_t number, std::uint32_t paths) {
    const std::uint64_t own = hash_of(seed, pixel);
    const auto index = static_cast<std::uint32_t>((number + hash_of(own, 0)) % paths);
    const auto coordinate = [&](std::uint32_t base) {
        const double x = radical_inverse(base, index) + double{unit_from(hash_of(own, base))};
        return x < 1.0 ? x : x - 1.0;
    };
    return ray_above(from, cosine_direction(coordinate(2), coordinate(3)));
}

/// What arrives at each point over the hemisphere, by paths of up to most_bounces surfaces.
/// [points]
std::vector<Vec3> light_of_paths(const RenderScene& scene, std::span<const SurfacePoint> points) {
    const std::uint32_t per_point = scene.samples_per_ray;
    std::vector<Vec3> arriving(points.size() * per_point, Vec3{0, 0, 0});
    std::vector<std::uint32_t> path(arriving.size());  // of those that go on
    std::iota(path.begin(), path.end(), 0u);
    std::vector<SurfacePoint> from;
    for (const std::uint32_t i : path) from.push_back(points[i / per_point]);
    Vec3 part{1, 1, 1};  // of the light that is left on the way; every surface is the same
    // Without rays too: a tracer over ranks is called by all ranks as often.
    for (std::uint32_t bounce = 1; bounce <= most_bounces; ++bounce) {
        const std::uint64_t seed = hash_of(scene.options.seed, bounce);
        std::vector<Ray> rays(path.size());
        for (std::size_t k = 0; k < rays.size(); ++k) {
            const SurfacePoint& first = points[path[k] / per_point];
            rays[k] = ray_of_path(from[k], seed, first.pixel,
                                  first.sequence * per_point + path[k] % per_point,
                                  scene.rays_per_pixel * per_point);
        }
        std::vector<Hit> hits(rays.size());
        std::vector<Double3> normals(rays.size());
        scene.tracer.closest(rays, hits, normals);
        const auto add = [&](std::size_t k, Vec3 light) {
            arriving[path[k]] = arriving[path[k]] + tinted(part, light);
        };
        for (std::size_t k = 0; k < rays.size(); ++k)
            if (!hits[k].hit()) add(k, sky_colour(scene.lights, rays[k].direction));
        const std::vector<std::uint32_t> positions = positions_of_hits(hits);
        from = points_of_hits(scene, rays, hits, normals, positions);
        const std::vector<Vec3> direct = direct_light(scene, from, SeenBy::reflection);
        part = tinted(part, surface_grey);
        for (std::size_t k = 0; k < positions.size(); ++k) add(positions[k], direct[k]);
        // Positions ascend.
        for (std::size_t k = 0; k < positions.size(); ++k) path[k] = path[positions[k]];
        path.resize(positions.size());
    }
    return means(arriving, per_point);
}

/// Sky for the samples that missed; on_hit(k) for the k-th of those that hit.
template <class OnHit>
std::vector<Vec3> fill_samples(const RenderScene& scene, const PrimarySamples& primary,
                               const OnHit& on_hit) {
    std::vector<Vec3> colours(primary.rays.size());
    for (std::size_t i = 0; i < colours.size(); ++i) {
        colours[i] = sky_colour(scene.lights, primary.rays[i].direction);
    }
    for (std::size_t k = 0; k < primary.points.size(); ++k)
        colours[primary.hit_positions[k]] = on_hit(k);
    return colours;
}

/// Looks around from `place` along fixed directions.
float enclosed_part(const Tracer& tracer, Vec3 place) {
    constexpr std::uint32_t looks = 512;
    std::vector<Ray> rays(looks);
    for (std::uint32_t k = 0; k < looks; ++k) {
        const Vec3 direction =
            sphere_direction(radical_inverse(2, k + 1), radical_inverse(3, k + 1));
        rays[k] = {place, 0.0f, direction, infinity};
    }
    std::vector<std::uint8_t> occluded(looks);
    tracer.occluded(rays, occluded);
    return static_cast<float>(std::count(occluded.begin(), occluded.end(), std::uint8_t{1})) /
           looks;
}

}  // namespace

Lights make_lights(const Tracer& tracer, const CameraFrame& frame, Vec3 camera_up) {
    const float component[3] = {camera_up.x, camera_up.y, camera_up.z};
    int axis = 0;
    for (int k = 1; k < 3; ++k)
        if (std::abs(component[k]) > std::abs(component[axis])) axis = k;
    float up_axis[3] = {0, 0, 0};
    up_axis[axis] = component[axis] < 0.0f ? -1.0f : 1.0f;

    // The sun stands high, behind the viewer's left shoulder: it shows shapes from every side of a
    // scene.
    const Double3 up(up_axis[0], up_axis[1], up_axis[2]);
    const Double3 left = normalized(up * dot(frame.right, up) - frame.right);
    const Double3 backward = cross(up, left);
    const Double3 sun = up * 0.75 + left * 0.62 + backward * 0.38;
    const Vec3 place = frame.position.rounded();
    return {up.rounded(), normalized(sun).rounded(), place, enclosed_part(tracer, place)};
}

Vec3 sky_colour(const Lights& lights, Vec3 direction) {
    const float height = dot(direction, lights.up);
    if (height >= 0.0f)
        return between(horizon_light, zenith_light, std::sqrt(std::min(height, 1.0f)));
    return between(horizon_light, ground_light, std::min(1.0f, -2.0f * height));
}

std::vector<Vec3> shade_samples(const RenderScene& scene, const PrimarySamples& primary) {
    const std::vector<Vec3> direct = direct_light(scene, primary.points, SeenBy::camera);
    const std::vector<float> open = open_parts(scene, primary.points);
    return fill_samples(scene, primary, [&](std::size_t k) {
        const Vec3 ambient = open[k] * ambient_light(scene.lights, primary.points[k].normal);
        return tinted(surface_grey, direct[k] + ambient);
    });
}

std::vector<Vec3> open_sky_samples(const RenderScene& scene, const PrimarySamples& primary) {
    const std::vector<float> open = open_parts(scene, primary.points);
    std::vector<Vec3> colours(primary.rays.size(), Vec3{1, 1, 1});
    for (std::size_t k = 0; k < open.size(); ++k)
        colours[primary.hit_positions[k]] = Vec3{open[k], open[k], open[k]};
    return colours;
}

std::vector<Vec3> diffuse_samples(const RenderScene& scene, const PrimarySamples& primary) {
    const std::vector<Vec3> direct = direct_light(scene, primary.points, SeenBy::camera);
    const std::vector<Vec3> bounced = bounced_light(scene, primary.points);
    return fill_samples(scene, primary, [&](std::size_t k) {
        return tinted(surface_grey, direct[k] + bounced[k]);
    });
}

std::vector<Vec3> path_samples(const RenderScene& scene, const PrimarySamples& primary) {
    const std::vector<Vec3> direct = direct_light(scene, primary.points, SeenBy::camera);
    const std::vector<Vec3> arriving = light_of_paths(scene, primary.points);
    return fill_samples(scene, primary, [&](std::size_t k) {
        return tinted(surface_grey, direct[k] + arriving[k]);
    });
}

}  // namespace raydix
