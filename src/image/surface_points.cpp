// What a hit says about the surface there, and the checks that come before rays start from it.
#include "image/surface_points.h"

#include <raydix/error.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "base/math.h"
#include "engine/hit_points.h"
#include "engine/scene_state.h"
#include "exec/search.h"

namespace raydix {
namespace {

/// The call that checks hits, as errors name it.
constexpr const char* secondary_call = "make_secondary_rays";

}  // namespace

Aabb BvhSurface::bounds() const { return bvh_.empty() ? empty_box() : bvh_.bounds(); }

Double3 BvhSurface::normal(const Ray&, const Hit& hit) const {
    const LeafTriangle& t = lookup_.triangle(hit.prim);
    return normal_of(t.v0, t.v1, t.v2);
}

void BvhSurface::check(std::span<const Hit> hits) const {
    const std::size_t bad = first_index_where(hits.size(), [&](std::size_t i) {
        return hits[i].hit() && !lookup_.contains(hits[i].prim);
    });
    if (bad < hits.size())
        throw InputError("hit " + std::to_string(bad) + ": the tree holds no triangle " +
                         std::to_string(hits[bad].prim));
}

SceneSurface::SceneSurface(const Scene& scene) : tree_(SceneInternals::tree(scene)) {}

Aabb SceneSurface::bounds() const { return tree_->bounds; }

Double3 SceneSurface::normal(const Ray& ray, const Hit& hit) const {
    return normal_at(*tree_, ray, hit);
}

void SceneSurface::check(std::span<const Hit> hits) const {
    require_normals(*tree_, hits, secondary_call);
}

SpaceAround space_around(const AabbD& box) {
    if (!(box.lo.x <= box.hi.x)) return {{}, empty_box()};
    const Double3 lo(box.lo), hi(box.hi), middle = (lo + hi) * 0.5;
    return {middle, {(lo - middle).rounded(), (hi - middle).rounded()}};
}

SceneSurfaceD::SceneSurfaceD(const SceneD& scene)
    : tree_(SceneInternalsD::tree(scene)), space_(space_around(tree_->bounds)) {}

Double3 SceneSurfaceD::normal(const RayD& ray, const HitD& hit) const {
    return normal_at(*tree_, ray, hit);
}

void SceneSurfaceD::check(std::span<const HitD> hits) const {
    require_normals(*tree_, hits, secondary_call);
}

SurfacePoint SceneSurfaceD::point(const RayD& ray, const HitD& hit, std::uint32_t pixel,
                                  double step_back) const {
    const Double3 direction(ray.direction);
    const double t = hit.t - step_back / length(direction);
    const Double3 place = (Double3(ray.origin) - space_.middle) + direction * t;
    return {place.rounded(), turned_against(normal(ray, hit), direction).rounded(), pixel, 0};
}

void require_triangles(const Bvh& bvh, std::string_view call) {
    if (bvh.empty() || bvh.kind() == PrimitiveKind::triangles) return;
    throw InputError(std::string(call) + " needs a tree over triangles; this one holds " +
                     (bvh.kind() == PrimitiveKind::boxes ? "boxes" : "points"));
}

float ao_radius_or_default(const Aabb& box, float given) {
    if (!(given >= 0.0f))
        throw InputError("ao_radius is " + std::to_string(given) + "; it must not be negative");
    return given > 0.0f ? given : static_cast<float>(ao_radius_part * diagonal_of(box));
}

double step_back_distance(const Aabb& box) {
    double largest = 0.0;
    for (const Vec3& p : {box.lo, box.hi})
        for (const float x : {p.x, p.y, p.z}) largest = std::max(largest, std::abs(double(x)));
    return std::max(step_back_part * diagonal_of(box), 8.0 * 0x1p-23 * largest);
}

std::vector<RayD> in_space_around(Double3 middle, std::span<const Ray> rays) {
    std::vector<RayD> out(rays.size());
    for (std::size_t i = 0; i < rays.size(); ++i) {
        (Double3(rays[i].origin) + middle).round_to(out[i].origin);
        Double3(rays[i].direction).round_to(out[i].direction);
        out[i].tmin = rays[i].tmin;
        out[i].tmax = rays[i].tmax;
    }
    return out;
}

SurfacePoint surface_point(const Double3& normal, const Ray& ray, float t, std::uint32_t pixel,
                           double step_back) {
    return {point_before(ray, t, step_back), normal_toward(normal, ray.direction), pixel, 0};
}

}  // namespace raydix
