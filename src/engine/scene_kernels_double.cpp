// Compiles the walk of rays in double through scenes once per instruction set.
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#include "engine/hit_order.h"
#include "engine/scene_job_double.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/scene_kernels_double.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "engine/scene_walk_double.h"

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

SceneKernelsD scene_kernels_double(std::string_view isa) {
    return {isa, trace_scene, all_scene_hits, hit_of_scene<false>, hit_of_scene<true>};
}

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace raydix {

const SceneKernelsD& scene_kernels_double_for(std::string_view isa) {
    static const std::vector<SceneKernelsD> all = [] {
        std::vector<SceneKernelsD> found;
        for (const SimdKernels& known : simd_kernels()) {
#if HWY_TARGETS & HWY_AVX3
            if (known.isa == "avx512") {
                found.push_back(N_AVX3::scene_kernels_double(known.isa));
                continue;
            }
#endif
#if HWY_TARGETS & HWY_AVX2
            if (known.isa == "avx2") {
                found.push_back(N_AVX2::scene_kernels_double(known.isa));
                continue;
            }
#endif
            found.push_back(HWY_STATIC_DISPATCH(scene_kernels_double)(known.isa));
        }
        return found;
    }();
    const auto at = std::ranges::find(all, isa, &SceneKernelsD::isa);
    return at == all.end() ? all.front() : *at;
}

}  // namespace raydix
#endif
