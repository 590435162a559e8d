// Primary rays and their hits [n] -> AO or diffuse rays [hits * samples] of the protocol (Aila and
// Laine 2009).
#include <raydix/error.h>
#include <raydix/rays.h>

#include <algorithm>
#include <string>

#include "base/double3.h"
#include "base/float_env.h"
#include "base/options.h"
#include "exec/parallel.h"
#include "image/surface_points.h"
#include "rays/ray_order.h"

namespace raydix {
namespace {

constexpr int max_samples = 1024;

/// Where diffuse rays end as far as their order is concerned: Aila and Laine's release has a camera
/// whose far plane lies at 1.5 times the largest side of the scene's box, and diffuse rays of that
/// length.
float far_of(const Aabb& bounds) {
    const Vec3 size = bounds.hi - bounds.lo;
    return 1.5f * std::max({size.x, size.y, size.z});
}

void check_arguments(std::size_t rays, std::size_t hits, std::size_t pixels,
                     const SecondaryOptions& options) {
    if (hits != rays || pixels != rays)
        throw InputError("make_secondary_rays: " + std::to_string(rays) + " rays, " +
                         std::to_string(hits) + " hits and " + std::to_string(pixels) +
                         " pixels; the three must be equally many");
    if (options.samples < 1 || options.samples > max_samples)
        throw InputError("samples is " + std::to_string(options.samples) + "; it must be 1.." +
                         std::to_string(max_samples));
    check_enum("kind", options.kind, RayKind::diffuse_shuffled);
    if (options.kind != RayKind::ao && options.kind != RayKind::diffuse &&
        options.kind != RayKind::diffuse_shuffled)
        throw InputError("make_secondary_rays makes ao, diffuse and diffuse_shuffled rays");
    if (rays * static_cast<std::size_t>(options.samples) > no_primitive)
        throw InputError("make_secondary_rays: 2^32 rays or more in one call; give fewer hits");
}

/// point_of(i, step_back): the surface point of ray i, which hit.
template <class AnyHit, class PointOf>
std::vector<Ray> make_rays(const Aabb& bounds, std::span<const AnyHit> hits,
                           const SecondaryOptions& options, const PointOf& point_of) {
    const double step_back = step_back_part * diagonal_of(bounds);
    const std::vector<std::uint32_t> positions = positions_of_hits(hits);
    std::vector<SurfacePoint> points(positions.size());
    for_each_index(points.size(),
                   [&](std::size_t k) { points[k] = point_of(positions[k], step_back); });

    HemisphereOptions hemisphere;
    hemisphere.samples = static_cast<std::uint32_t>(options.samples);
    hemisphere.seed = options.seed;
    if (options.kind == RayKind::ao)
        hemisphere.tmax = ao_radius_or_default(bounds, options.ao_radius);
    std::vector<Ray> secondary(points.size() * hemisphere.samples);
    make_hemisphere_rays(points, hemisphere, secondary);
    if (options.kind == RayKind::diffuse_shuffled) {
        shuffle_rays(secondary, options.seed);
    } else if (options.sorted) {
        sort_rays(secondary, far_of(bounds));
    }
    return secondary;
}

template <class AnySurface>
std::vector<Ray> make_float_rays(const AnySurface& surface, std::span<const Ray> rays,
                                 std::span<const Hit> hits, std::span<const std::uint32_t> pixels,
                                 const SecondaryOptions& options) {
    check_arguments(rays.size(), hits.size(), pixels.size(), options);
    std::vector<Ray> secondary;
    with_threads(options.threads, [&] {
        surface.check(hits);
        secondary =
            make_rays(surface.bounds(), hits, options, [&](std::uint32_t i, double step_back) {
                return surface_point(surface.normal(rays[i], hits[i]), rays[i], hits[i].t,
                                     pixels[i], step_back);
            });
    });
    return secondary;
}

}  // namespace

std::string_view ray_kind_name(RayKind kind) {
    switch (kind) {
        case RayKind::primary:
            return "primary";
        case RayKind::ao:
            return "ao";
        case RayKind::diffuse:
            return "diffuse";
        case RayKind::diffuse_shuffled:
            return "diffuse_shuffled";
    }
    return "unknown";
}

std::vector<Ray> make_secondary_rays(const Bvh& bvh, std::span<const Ray> rays,
                                     std::span<const Hit> hits,
                                     std::span<const std::uint32_t> pixels,
                                     const SecondaryOptions& options) {
    require_triangles(bvh, "make_secondary_rays");
    return make_float_rays(BvhSurface(bvh), rays, hits, pixels, options);
}

std::vector<Ray> make_secondary_rays(const Scene& scene, std::span<const Ray> rays,
                                     std::span<const Hit> hits,
                                     std::span<const std::uint32_t> pixels,
                                     const SecondaryOptions& options) {
    return make_float_rays(SceneSurface(scene), rays, hits, pixels, options);
}

std::vector<RayD> make_secondary_rays(const SceneD& scene, std::span<const RayD> rays,
                                      std::span<const HitD> hits,
                                      std::span<const std::uint32_t> pixels,
                                      const SecondaryOptions& options) {
    const FloatEnvironment plain;
    const SceneSurfaceD surface(scene);
    check_arguments(rays.size(), hits.size(), pixels.size(), options);
    std::vector<RayD> secondary;
    with_threads(options.threads, [&] {
        surface.check(hits);
        const std::vector<Ray> made =
            make_rays(surface.bounds(), hits, options, [&](std::uint32_t i, double step_back) {
                return surface.point(rays[i], hits[i], pixels[i], step_back);
            });
        secondary = in_space_around(surface.middle(), made);
    });
    return secondary;
}

}  // namespace raydix
