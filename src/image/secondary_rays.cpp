// Primary rays and their hits [n] -> AO or diffuse rays [hits * samples] of the protocol (Aila and
// Laine 2009).
#include <raydix/error.h>
#include <raydix/rays.h>

#include <algorithm>
#include <string>

#include "base/double3.h"
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

void check_arguments(std::span<const Ray> rays, std::span<const Hit> hits,
                     std::span<const std::uint32_t> pixels, const SecondaryOptions& options) {
    if (hits.size() != rays.size() || pixels.size() != rays.size())
        throw InputError("make_secondary_rays: " + std::to_string(rays.size()) + " rays, " +
                         std::to_string(hits.size()) + " hits and " +
                         std::to_string(pixels.size()) + " pixels; the three must be equally many");
    if (options.samples < 1 || options.samples > max_samples)
        throw InputError("samples is " + std::to_string(options.samples) + "; it must be 1.." +
                         std::to_string(max_samples));
    check_enum("kind", options.kind, RayKind::diffuse_shuffled);
    if (options.kind != RayKind::ao && options.kind != RayKind::diffuse &&
        options.kind != RayKind::diffuse_shuffled)
        throw InputError("make_secondary_rays makes ao, diffuse and diffuse_shuffled rays");
    if (rays.size() * static_cast<std::size_t>(options.samples) > no_primitive)
        throw InputError("make_secondary_rays: 2^32 rays or more in one call; give fewer hits");
}

std::vector<Ray> make_rays(const Surface& surface, std::span<const Ray> rays,
                           std::span<const Hit> hits, std::span<const std::uint32_t> pixels,
                           const SecondaryOptions& options) {
    surface.check(hits);
    const double step_back = step_back_part * diagonal_of(surface.bounds());
    const std::vector<std::uint32_t> positions = positions_of_hits(hits);
    std::vector<SurfacePoint> points(positions.size());
    for_each_index(points.size(), [&](std::size_t k) {
        const std::uint32_t i = positions[k];
        points[k] = surface_point(surface, rays[i], hits[i], pixels[i], step_back);
    });

    HemisphereOptions hemisphere;
    hemisphere.samples = static_cast<std::uint32_t>(options.samples);
    hemisphere.seed = options.seed;
    if (options.kind == RayKind::ao)
        hemisphere.tmax = ao_radius_or_default(surface.bounds(), options.ao_radius);
    std::vector<Ray> secondary(points.size() * hemisphere.samples);
    make_hemisphere_rays(points, hemisphere, secondary);
    if (options.kind == RayKind::diffuse_shuffled) {
        shuffle_rays(secondary, options.seed);
    } else if (options.sorted) {
        sort_rays(secondary, far_of(surface.bounds()));
    }
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
    check_arguments(rays, hits, pixels, options);
    std::vector<Ray> secondary;
    with_threads(options.threads,
                 [&] { secondary = make_rays(BvhSurface(bvh), rays, hits, pixels, options); });
    return secondary;
}

std::vector<Ray> make_secondary_rays(const Scene& scene, std::span<const Ray> rays,
                                     std::span<const Hit> hits,
                                     std::span<const std::uint32_t> pixels,
                                     const SecondaryOptions& options) {
    const SceneSurface surface(scene);
    check_arguments(rays, hits, pixels, options);
    std::vector<Ray> secondary;
    with_threads(options.threads,
                 [&] { secondary = make_rays(surface, rays, hits, pixels, options); });
    return secondary;
}

}  // namespace raydix
