#include "image/render_tracers.h"

#include <raydix/trace.h>

#include <vector>

#include "engine/scene_state.h"
#include "engine/trace_on_this_thread.h"
#include "trace/scalar.h"
#include "trace/simd/trace_on_this_thread.h"

namespace raydix {
namespace {

/// Making a wide tree takes about as long as tracing so many rays per triangle without it.
constexpr std::uint64_t rays_per_triangle = 1;

}  // namespace

BvhTracer::BvhTracer(const Bvh& bvh, std::uint64_t rays) : bvh_(bvh) {
    if (rays > bvh.order().size() * rays_per_triangle) wide_.emplace(bvh);
}

void BvhTracer::closest(std::span<const Ray> rays, std::span<Hit> hits) const {
    if (wide_)
        closest_on_this_thread(*wide_, rays, hits);
    else
        trace(bvh_, rays, hits);
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

SceneTracer::SceneTracer(const Scene& scene) : tree_(SceneInternals::tree(scene)) {}

void SceneTracer::closest(std::span<const Ray> rays, std::span<Hit> hits) const {
    closest_on_this_thread(*tree_, rays, hits);
}

void SceneTracer::occluded(std::span<const Ray> rays, std::span<std::uint8_t> found) const {
    occluded_on_this_thread(*tree_, rays, found);
}

void SceneTracer::count_steps(std::span<const Ray> rays, std::span<std::uint32_t> visits) const {
    count_steps_on_this_thread(*tree_, rays, visits);
}

}  // namespace raydix
