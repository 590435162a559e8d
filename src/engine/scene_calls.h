// Rays through a scene one by one: all hits of each, counted visits, a ray that is all of a call.
// Included once per instruction set by scene_kernels.cpp.
#if defined(RAYDIX_ENGINE_SCENE_CALLS_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYDIX_ENGINE_SCENE_CALLS_H
#undef RAYDIX_ENGINE_SCENE_CALLS_H
#else
#define RAYDIX_ENGINE_SCENE_CALLS_H
#endif

#include <hwy/highway.h>

#include <algorithm>

#include "engine/scene_job.h"
#include "engine/scene_moves.h"
#include "engine/scene_ray.h"

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

/// All hits of the rays of a job, one ray after the other.
inline void all_hits_one_by_one(SceneJob& job) {
    job.invalid = 0;
    job.single_stack.reserve_words(job.tree->stack_size);
    for (std::size_t k = 0; k < job.n; ++k) {
        const Ray& ray = job.rays[k];
        const std::size_t before = job.found->size();
        if (is_valid(ray)) {
            SceneRay<Wanted::all>(
                {ray.tmin, ray.tmax, job.masks == nullptr ? job.mask : job.masks[k]}, job.place(k),
                {}, job.single_stack.view(), job.found)
                .walk(*job.tree, 0, line_of(ray));
            if (job.filter != nullptr) {
                const auto first = job.found->begin() + static_cast<std::ptrdiff_t>(before);
                const auto refused = [&](const Hit& hit) { return !job.accepts(k, hit); };
                job.found->erase(std::remove_if(first, job.found->end(), refused),
                                 job.found->end());
            }
            finish_scene_ray(*job.found, before);
        } else {
            ++job.invalid;
        }
        job.hit_counts[k] = job.found->size() - before;
    }
}

/// Closest hits, one ray after the other: how many nodes each visits, those over parts included.
inline void count_scene_steps(SceneJob& job) {
    job.single_stack.reserve_words(job.tree->stack_size);
    for (std::size_t k = 0; k < job.n; ++k) {
        const Ray& ray = job.rays[k];
        job.visits[k] = 0;
        if (!is_valid(ray)) continue;
        SceneRay<Wanted::closest, true> one({ray.tmin, ray.tmax, job.mask}, k, {},
                                            job.single_stack.view());
        one.walk(*job.tree, 0, line_of(ray));
        job.visits[k] = static_cast<std::uint32_t>(one.visits());
    }
}

/// A ray alone through a mesh that is all of a scene, for what the filter accepts. The frame is
/// that of a tree's own single calls: it takes no lines in double.
template <bool any, bool compact, bool guessing>
HWY_INLINE WideBest accepted_in_mesh(const WideView& view, const SingleFrame& frame,
                                     const WideStackView& stack, const HitCheck& check,
                                     const Ray& ray) {
    SimdCounts counts;
    SingleRay<any ? Wanted::any_accepted : Wanted::closest_accepted, compact, compact, guessing>
        one(view, frame, stack, counts);
    one.check_by(check, &ray);
    return one.trace(0, {frame.tmax});
}

/// Asks a filter about hits of a mesh that is all of a scene, of a ray that is all of a call.
struct FilterOfOneRay {
    const MeshTree& mesh;
    const HitFilter& filter;
    std::size_t place;

    static bool accepts(const void* context, const Ray* ray, const TreeHit& hit) {
        const auto& ask = *static_cast<const FilterOfOneRay*>(context);
        return ask.filter(ask.place, *ray, hit_in_scene(ask.mesh, 0, 1.0, hit));
    }
};

template <bool any>
Hit accepted_hit_of_mesh(const MeshTree& mesh, const Ray& ray, const HitFilter& filter,
                         std::size_t place, const WideStackView& stack, CallHistory& history) {
    SingleFrame frame;
    if (mesh.tree->empty() || !fill_frame(mesh.view, ray, frame)) return {};
    const FilterOfOneRay ask{mesh, filter, place};
    const HitCheck check{&FilterOfOneRay::accepts, &ask};
    WideBest best;
    if (mesh.view.is_compact) {
        TriangleBlock room{};
        WideView view = mesh.view;
        view.room = &room;
        best = accepted_in_mesh<any, true, false>(view, frame, stack, check, ray);
    } else if (follows(mesh.view, frame, history)) {
        best = accepted_in_mesh<any, false, true>(mesh.view, frame, stack, check, ray);
    } else {
        best = accepted_in_mesh<any, false, false>(mesh.view, frame, stack, check, ray);
    }
    if (!best.found()) return {};
    return hit_in_scene(mesh, 0, 1.0, {best.t * frame.t_scale, best.prim, best.u, best.v});
}

/// A ray alone; for any hit only prim has a meaning.
template <bool any>
Hit hit_of_scene(const SceneTree& scene, const Ray& ray, std::uint32_t mask,
                 const HitFilter* filter, std::size_t place, const WideStackView& stack,
                 CallHistory& history) {
    if (const MeshTree* const mesh = scene.only_mesh(); mesh != nullptr && filter != nullptr) {
        if ((mesh->mask & mask) == 0) return {};
        return accepted_hit_of_mesh<any>(*mesh, ray, *filter, place, stack, history);
    }
    if (!is_valid(ray)) return {};
    const SceneJob::Limits limits{ray.tmin, ray.tmax, mask};
    const auto walk = [&](auto& one) {
        if (scene.only_shapes() != nullptr) one.come_after(history);
        one.walk(scene, 0, line_of(ray));
        return one.best();
    };
    if (filter != nullptr) {
        SceneRay<any ? Wanted::any_accepted : Wanted::closest_accepted> one(limits, place, {},
                                                                            stack);
        one.filter_by(*filter, ray);
        return walk(one);
    }
    SceneRay<any ? Wanted::any : Wanted::closest> one(limits, place, {}, stack);
    return walk(one);
}

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
