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
#include <array>
#include <optional>
#include <type_traits>

#include "engine/mesh_packets_double.h"
#include "engine/scene_ray_double.h"
#include "trace/simd/turns.h"

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

/// Rays of a job through one mesh, which all of them can see, in turn.
template <bool any>
class MeshTurnsD {
    static constexpr Wanted wanted = any ? Wanted::any : Wanted::closest;

public:
    explicit MeshTurnsD(SceneJobD& job) : job_(job), mesh_(*job.tree->only_mesh()) {}

    void trace() {
        std::array<Turn, rays_in_turn> turns;
        const std::size_t size = job_.tree->stack_size;
        job_.stack.reserve_words(size * rays_in_turn);
        const WideStackView stack = job_.stack.view();
        for (std::size_t k = 0; k < turns.size(); ++k) {
            turns[k].all = this;
            turns[k].stack = {stack.words + k * size, stack.entries + k * size};
        }
        take_turns(turns);
    }

private:
    using Leaves = TriangleLeavesD<wanted>;
    using One = SingleRay<wanted, false, false, false, Leaves>;
    struct Turn {
        MeshTurnsD* all;
        WideStackView stack;
        RayAtTriangles at;
        std::optional<Leaves> leaves;
        std::optional<One> ray;
        std::size_t place;

        static constexpr bool has_parts = false;
        [[nodiscard]] TurnKind kind() const { return static_cast<TurnKind>(ray->next() >> 31); }
        HWY_INLINE void ask() const { leaves->ask_for(ray->next()); }
        template <TurnKind kind>
        HWY_INLINE bool step(std::integral_constant<TurnKind, kind>) {
            const bool on = kind == TurnKind::node ? ray->step_node() : ray->step_leaf();
            return on || all->finish(*this);
        }
        HWY_NOINLINE bool start() { return all->start(*this); }
    };

    HWY_INLINE bool start(Turn& turn) {
        while (next_ < job_.n) {
            turn.place = job_.place(next_++);
            if (job_.order != nullptr)
                hwy::Prefetch(job_.rays + job_.order[std::min(next_ + ahead, job_.n - 1)]);
            const RayD& ray = job_.rays[turn.place];
            if (!is_valid(ray)) {
                ++job_.invalid;
            } else if ((mesh_.mask & job_.mask_of(turn.place)) != 0 &&
                       turn.at.fill(*mesh_.tree, ray)) {
                turn.leaves.emplace(*mesh_.tree, turn.at.line, turn.at.kind, turn.at.distances,
                                    turn.at.best);
                turn.ray.emplace(mesh_.tree->view, turn.at.boxes, turn.stack, counts_,
                                 &*turn.leaves);
                if (turn.ray->begin(turn.at.boxes.tmax)) return true;
            }
            job_.set(turn.place, {});
        }
        return false;
    }
    /// False.
    HWY_INLINE bool finish(Turn& turn) {
        HitD hit;
        if constexpr (any) {
            if (turn.ray->best().t < 0) hit.prim = 0;
        } else if (turn.at.best.found()) {
            hit = turn.at.hit(mesh_, 0);
        }
        job_.set(turn.place, hit);
        return false;
    }

    static constexpr std::size_t ahead = 16;
    SceneJobD& job_;
    const MeshTreeD& mesh_;
    SimdCounts counts_;
    std::size_t next_ = 0;
};

/// A valid ray alone; for any hit only prim has a meaning.
template <bool any>
HitD hit_of_scene(const SceneTreeD& scene, const RayD& ray, std::uint32_t mask,
                  const HitFilterD* filter, std::size_t place, const WideStackView& stack) {
    if (filter != nullptr) {
        SceneRayD<any ? Wanted::any_accepted : Wanted::closest_accepted> one(ray, mask, stack);
        one.filter_by(*filter, place, ray);
        one.trace(scene, ray);
        return one.best();
    }
    SceneRayD<any ? Wanted::any : Wanted::closest> one(ray, mask, stack);
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
    if (job.way == SceneJobD::Way::packets)
        MeshPacketsD<any>(job).trace([&](std::size_t k) { trace_alone<any>(job, k); });
    else if (job.way == SceneJobD::Way::turns)
        MeshTurnsD<any>(job).trace();
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
            SceneRayD<Wanted::all>(ray, job.mask_of(k), job.stack.view(), job.found)
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
