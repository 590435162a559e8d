// A job of rays in double through a scene: what it is asked, what it answers, and the memory that
// it works in. The work is in scene_walk_double.h, compiled once per instruction set.
#pragma once

#include <raydix/scene.h>

#include <cstdint>
#include <string_view>

#include "engine/scene_tree_double.h"
#include "exec/result_budget.h"
#include "trace/simd/simd_kernels.h"
#include "trace/simd/wide_batch.h"

namespace raydix {

/// Memory is kept from job to job. Not for two threads at once.
struct SceneJobD {
    // At most max_job_rays rays, rays[order[k]], or rays[k] without an order. Answers go to the
    // same places.
    const SceneTreeD* tree = nullptr;
    const RayD* rays = nullptr;
    const std::uint32_t* order = nullptr;
    std::size_t n = 0;
    std::size_t first = 0;  // the place of rays[0] among the caller's
    std::uint32_t mask = 0;
    const std::uint32_t* masks = nullptr;  // [rays] instead; or null
    const HitFilterD* filter = nullptr;    // or null
    HitD* hits = nullptr;                  // or else
    std::uint8_t* occluded = nullptr;
    /// In packets: through one mesh that is not empty, which all rays see. With a filter: alone.
    PathWay way = PathWay::alone;  // not streams

    // Of all hits: those of each ray behind those of the one before, sorted; how many [n].
    BudgetVector<HitD>* found = nullptr;
    std::uint64_t* hit_counts = nullptr;
    std::uint64_t invalid = 0, hit_count = 0;

    StackMemory stack;

    [[nodiscard]] std::size_t place(std::size_t k) const { return order == nullptr ? k : order[k]; }
    [[nodiscard]] std::uint32_t mask_of(std::size_t place) const {
        return masks == nullptr ? mask : masks[place];
    }
    void set(std::size_t place, const HitD& hit) {
        hit_count += hit.hit();
        if (hits != nullptr)
            hits[place] = hit;
        else
            occluded[place] = hit.hit();
    }
};

struct SceneKernelsD {
    std::string_view isa;
    void (*trace)(SceneJobD& job);
    void (*all_hits)(SceneJobD& job);
    /// A valid ray; `place`: among the caller's; `filter` may be null; `stack` has room for
    /// SceneTreeD::stack_size. For any hit only prim has a meaning.
    using OneRayOfScene = HitD(const SceneTreeD& scene, const RayD& ray, std::uint32_t mask,
                               const HitFilterD* filter, std::size_t place,
                               const WideStackView& stack);
    OneRayOfScene* closest;
    OneRayOfScene* any;
};

/// Empty: the best. The names are those of simd_kernels().
[[nodiscard]] const SceneKernelsD& scene_kernels_double_for(std::string_view isa);

}  // namespace raydix
