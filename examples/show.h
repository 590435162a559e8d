// Pictures of coloured meshes for the examples: sun with shadow, light of the sky by some rays a
// pixel, four primary rays a pixel.
#pragma once

#include <raydix/raydix.h>

#include <algorithm>
#include <filesystem>
#include <functional>
#include <vector>

#include "vec.h"

namespace example {

/// Where a ray met something.
struct Surface {
    Vec3 normal;  // unit, either side
    Vec3 colour;
};

/// What a picture is taken of: closest hits and occlusion of batches, and what a hit looks like.
struct Subject {
    std::function<std::vector<raydix::Hit>(std::span<const raydix::Ray>)> trace;
    std::function<void(std::span<const raydix::Ray>, std::span<std::uint8_t>)> occluded;
    std::function<Surface(const raydix::Hit&, Vec3 place)> surface;
    float size = 1;  // of the whole, in its own units
    Vec3 up{0, 1, 0};
};

namespace show_detail {

inline Vec3 sky(Vec3 way, Vec3 up) {
    const float high = std::clamp(0.5f + 0.5f * dot(way, up), 0.0f, 1.0f);
    return high * Vec3{0.55f, 0.68f, 0.92f} + (1 - high) * Vec3{0.62f, 0.58f, 0.53f};
}

/// Light at the hits: one ray to the sun and `sky_rays` to the sky each.
inline std::vector<Vec3> light_at(const Subject& subject, std::span<const Vec3> places,
                                  std::span<const Vec3> normals, Vec3 sun, int sky_rays) {
    std::vector<raydix::Ray> rays;
    for (std::size_t i = 0; i < places.size(); ++i) {
        Random random(i * 2 + 1);
        const Frame frame(normals[i]);
        const Vec3 from = places[i] + 1e-4f * subject.size * normals[i];
        const float side = dot(normals[i], sun);
        rays.push_back({from, 0, sun, side > 0 ? raydix::infinity : -1.0f});
        for (int k = 0; k < sky_rays; ++k)
            rays.push_back({from, 0, cosine_direction(frame, random)});
    }
    std::vector<std::uint8_t> hidden(rays.size());
    subject.occluded(rays, hidden);
    std::vector<Vec3> light(places.size(), Vec3{0, 0, 0});
    const auto each = static_cast<std::size_t>(sky_rays) + 1;
    for (std::size_t i = 0; i < places.size(); ++i) {
        const std::size_t first = i * each;
        const float side = dot(normals[i], sun);
        if (side > 0 && hidden[first] == 0) light[i] += side * Vec3{0.95f, 0.86f, 0.72f};
        for (std::size_t k = 1; k < each; ++k)
            if (hidden[first + k] == 0)
                light[i] += (0.5f / static_cast<float>(sky_rays)) *
                            sky(rays[first + k].direction, subject.up);
    }
    return light;
}

}  // namespace show_detail

/// `sun`: the way to it.
inline raydix::Picture show(const Subject& subject, const raydix::Camera& camera,
                            std::uint32_t width, std::uint32_t height, Vec3 sun, int sky_rays = 6) {
    std::vector<std::uint32_t> pixels;
    const std::vector<raydix::Ray> rays =
        raydix::make_primary_rays(camera, 2 * width, 2 * height, &pixels);
    const std::vector<raydix::Hit> hits = subject.trace(rays);
    std::vector<Vec3> places, normals, colours;
    for (std::size_t i = 0; i < rays.size(); ++i) {
        if (!hits[i].hit()) continue;
        places.push_back(rays[i].origin + hits[i].t * rays[i].direction);
        const Surface met = subject.surface(hits[i], places.back());
        normals.push_back(dot(met.normal, rays[i].direction) > 0 ? -1.0f * met.normal : met.normal);
        colours.push_back(met.colour);
    }
    const std::vector<Vec3> light =
        show_detail::light_at(subject, places, normals, unit(sun), sky_rays);
    raydix::Picture picture{width, height, std::vector<Vec3>(std::size_t{width} * height)};
    for (std::size_t i = 0, k = 0; i < rays.size(); ++i) {
        const std::uint32_t x = pixels[i] % (2 * width) / 2, y = pixels[i] / (2 * width) / 2;
        Vec3& pixel = picture.pixels[std::size_t{y} * width + x];
        if (hits[i].hit()) {
            pixel += 0.25f * (colours[k] * light[k]);
            ++k;
        } else {
            pixel += 0.25f * show_detail::sky(rays[i].direction, subject.up);
        }
    }
    return picture;
}

/// A mesh as a subject: flat, or by normals of its vertices; colours by triangle. All must outlive
/// the subject.
inline Subject subject_of(const raydix::Mesh& mesh, const raydix::Scene& scene,
                          std::span<const Vec3> colours, std::span<const Vec3> normals = {}) {
    Subject subject;
    subject.trace = [&scene](std::span<const raydix::Ray> rays) {
        return raydix::trace(scene, rays);
    };
    subject.occluded = [&scene](std::span<const raydix::Ray> rays, std::span<std::uint8_t> out) {
        raydix::trace_any(scene, rays, out);
    };
    subject.surface = [&mesh, colours, normals](const raydix::Hit& hit, Vec3) -> Surface {
        const raydix::Triangle& t = mesh.triangles[hit.prim];
        if (!normals.empty())
            return {unit((1 - hit.u - hit.v) * normals[t[0]] + hit.u * normals[t[1]] +
                         hit.v * normals[t[2]]),
                    colours[hit.prim]};
        const Vec3 a = mesh.vertices[t[0]];
        return {unit(cross(mesh.vertices[t[1]] - a, mesh.vertices[t[2]] - a)), colours[hit.prim]};
    };
    const raydix::Aabb box = raydix::inspect(mesh).bounds;
    subject.size = length(box.hi - box.lo);
    return subject;
}

}  // namespace example
