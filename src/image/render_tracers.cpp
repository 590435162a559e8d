#include "image/render_tracers.h"

#include <raydix/error.h>
#include <raydix/trace.h>

#include <vector>

#include "engine/scene_state.h"
#include "engine/trace_on_this_thread.h"
#include "image/surface_points.h"
#include "trace/scalar.h"
#include "trace/simd/trace_on_this_thread.h"

namespace raydix {
namespace {

/// Making a wide tree takes about as long as tracing so many rays per triangle without it.
constexpr std::uint64_t rays_per_triangle = 1;

/// `rays` and `hits`: in the surface's own space.
template <class Surface, class Rays, class Hits>
void fill_normals(const Surface& surface, const Rays& rays, const Hits& hits,
                  std::span<Double3> normals) {
    for (std::size_t i = 0; i < hits.size(); ++i)
        if (hits[i].hit()) normals[i] = surface.normal(rays[i], hits[i]);
}

}  // namespace

BvhTracer::BvhTracer(const Bvh& bvh, std::uint64_t rays) : bvh_(bvh), surface_(bvh) {
    if (rays > bvh.order().size() * rays_per_triangle) wide_.emplace(bvh);
}

void BvhTracer::closest(std::span<const Ray> rays, std::span<Hit> hits,
                        std::span<Double3> normals) const {
    if (wide_)
        closest_on_this_thread(*wide_, rays, hits);
    else
        trace(bvh_, rays, hits);
    fill_normals(surface_, rays, hits, normals);
}

void BvhTracer::occluded(std::span<const Ray> rays, std::span<std::uint8_t> found) const {
    if (wide_)
        occluded_on_this_thread(*wide_, rays, found);
    else
        trace_any(bvh_, rays, found);
}

void BvhTracer::count_steps(std::span<const Ray> rays, std::span<std::uint32_t> visits) const {
    std::vector<Hit> hits(rays.size());
    std::vector<RaySteps> steps(rays.size());
    trace_steps(bvh_, rays, hits, steps, 0);
    for (std::size_t i = 0; i < visits.size(); ++i) visits[i] = steps[i].node_visits;
}

SceneTracer::SceneTracer(const Scene& scene)
    : tree_(SceneInternals::tree(scene)), surface_(scene) {}

void SceneTracer::closest(std::span<const Ray> rays, std::span<Hit> hits,
                          std::span<Double3> normals) const {
    closest_on_this_thread(*tree_, rays, hits);
    fill_normals(surface_, rays, hits, normals);
}

void SceneTracer::occluded(std::span<const Ray> rays, std::span<std::uint8_t> found) const {
    occluded_on_this_thread(*tree_, rays, found);
}

void SceneTracer::count_steps(std::span<const Ray> rays, std::span<std::uint32_t> visits) const {
    count_steps_on_this_thread(*tree_, rays, visits);
}

SceneTracerD::SceneTracerD(const SceneD& scene)
    : tree_(SceneInternalsD::tree(scene)), surface_(scene) {}

void SceneTracerD::closest(std::span<const Ray> rays, std::span<Hit> hits,
                           std::span<Double3> normals) const {
    std::vector<HitD> found(rays.size());
    const std::vector<RayD> placed = in_space_around(middle(), rays);
    closest_on_this_thread(*tree_, placed, found);
    for (std::size_t i = 0; i < found.size(); ++i) {
        const HitD& hit = found[i];
        hits[i].t = static_cast<float>(hit.t);
        hits[i].prim = hit.prim;
        hits[i].u = static_cast<float>(hit.u);
        hits[i].v = static_cast<float>(hit.v);
        hits[i].geometry = hit.geometry;
        hits[i].instance = hit.instance;
    }
    fill_normals(surface_, placed, found, normals);
}

void SceneTracerD::occluded(std::span<const Ray> rays, std::span<std::uint8_t> found) const {
    occluded_on_this_thread(*tree_, in_space_around(middle(), rays), found);
}

void SceneTracerD::count_steps(std::span<const Ray>, std::span<std::uint32_t>) const {
    throw InputError(
        "render: the view steps counts nodes in scenes in float; this one is in double");
}

}  // namespace raydix
