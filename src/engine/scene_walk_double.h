// Rays of a job in double through a scene. Included once per instruction set by
// scene_kernels_double.cpp.
#if defined(RAYDIX_ENGINE_SCENE_WALK_DOUBLE_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYDIX_ENGINE_SCENE_WALK_DOUBLE_H
#undef RAYDIX_ENGINE_SCENE_WALK_DOUBLE_H
#else
#define RAYDIX_ENGINE_SCENE_WALK_DOUBLE_H
#endif

#include <hwy/highway.h>

#include <algorithm>

#include "engine/mesh_packets_double.h"
#include "engine/scene_ray_double.h"
#include "engine/scene_turns_double.h"

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

/// A valid ray alone; for any hit only prim has a meaning.
template <bool any>
HitD hit_of_scene(const SceneTreeD& scene, const RayD& ray, std::uint32_t mask,
                  const HitFilterD* filter, std::size_t place, const WideStackView& stack) {
    if (filter != nullptr) {
        SceneRayD<any ? Wanted::any_accepted : Wanted::closest_accepted> one(ray, place, mask,
                                                                             stack);
        one.filter_by(*filter, ray);
        one.trace(scene, ray);
        return one.best();
    }
    SceneRayD<any ? Wanted::any : Wanted::closest> one(ray, place, mask, stack);
    one.trace(scene, ray);
    return one.best();
}

/// Ray k of a job. The stack has its room.
template <bool any>
void trace_alone(SceneJobD& job, std::size_t k) {
    const std::size_t place = job.place(k);
    const RayD& ray = job.rays[place];
    HitD hit;
    if (is_valid(ray))
        hit = hit_of_scene<any>(*job.tree, ray, job.mask_of(place), job.filter, job.first + place,
                                job.stack.view());
    else
        ++job.invalid;
    job.set(place, hit);
}

template <bool any>
void trace_scene_as(SceneJobD& job) {
    job.stack.reserve_words(job.tree->stack_size);
    if (job.way == PathWay::packets)
        MeshPacketsD<any>(job).trace([&](std::size_t k) { trace_alone<any>(job, k); });
    else if (job.way == PathWay::turns)
        SceneTurnsD<any>(job).trace();
    else
        for (std::size_t k = 0; k < job.n; ++k) trace_alone<any>(job, k);
}

inline void trace_scene(SceneJobD& job) {
    job.invalid = job.hit_count = 0;
    if (job.hits == nullptr)
        trace_scene_as<true>(job);
    else
        trace_scene_as<false>(job);
}

/// All hits of the rays of a job, one ray after the other.
inline void all_scene_hits(SceneJobD& job) {
    job.invalid = job.hit_count = 0;
    job.stack.reserve_words(job.tree->stack_size);
    for (std::size_t k = 0; k < job.n; ++k) {
        const RayD& ray = job.rays[k];
        const std::size_t before = job.found->size();
        if (is_valid(ray)) {
            SceneRayD<Wanted::all>(ray, job.first + k, job.mask_of(k), job.stack.view(), job.found)
                .trace(*job.tree, ray);
            if (job.filter != nullptr) {
                const auto first = job.found->begin() + static_cast<std::ptrdiff_t>(before);
                const auto refused = [&](const HitD& hit) {
                    return !(*job.filter)(job.first + k, ray, hit);
                };
                job.found->erase(std::remove_if(first, job.found->end(), refused),
                                 job.found->end());
            }
            finish_scene_ray(*job.found, before);
        } else {
            ++job.invalid;
        }
        job.hit_count += job.hit_counts[k] = job.found->size() - before;
    }
}

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
