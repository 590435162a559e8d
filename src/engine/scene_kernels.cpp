// Compiles the walk through scenes once per instruction set.
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#include "engine/hit_order.h"
#include "engine/scene_job.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/scene_kernels.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "engine/scene_calls.h"
#include "engine/scene_walk.h"

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

SceneKernels scene_kernels(std::string_view isa) {
    return {isa,
            trace_scene,
            all_scene_hits,
            count_scene_steps,
            hit_of_scene<false>,
            hit_of_scene<true>};
}

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace raydix {

const SceneKernels& scene_kernels_for(std::string_view isa) {
    static const std::vector<SceneKernels> all = [] {
        std::vector<SceneKernels> found;
        for (const SimdKernels& known : simd_kernels()) {
#if HWY_TARGETS & HWY_AVX3
            if (known.isa == "avx512") {
                found.push_back(N_AVX3::scene_kernels(known.isa));
                continue;
            }
#endif
#if HWY_TARGETS & HWY_AVX2
            if (known.isa == "avx2") {
                found.push_back(N_AVX2::scene_kernels(known.isa));
                continue;
            }
#endif
            found.push_back(HWY_STATIC_DISPATCH(scene_kernels)(known.isa));
        }
        return found;
    }();
    const auto at = std::ranges::find(all, isa, &SceneKernels::isa);
    return at == all.end() ? all.front() : *at;
}

}  // namespace raydix
#endif
