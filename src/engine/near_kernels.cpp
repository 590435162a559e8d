// Compiles queries of distance and overlap on scenes once per instruction set.
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#include "engine/near_job.h"
#include "engine/near_shapes.h"
#include "primitives/exact_overlap.h"
#include "proximity/sweep_walk.h"
#include "proximity/touch_walk.h"
#include "trace/simd/simd_kernels.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/near_kernels.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "engine/near_walk.h"

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

NearKernels near_kernels(std::string_view isa) {
    return {isa, closest_in_scene, sphere_touches_scene, segment_touches_scene, sweep_scene};
}

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace raydix {

const NearKernels& near_kernels_for(std::string_view isa) {
    static const std::vector<NearKernels> all = [] {
        std::vector<NearKernels> found;
        for (const SimdKernels& known : simd_kernels()) {
#if HWY_TARGETS & HWY_AVX3
            if (known.isa == "avx512") {
                found.push_back(N_AVX3::near_kernels(known.isa));
                continue;
            }
#endif
#if HWY_TARGETS & HWY_AVX2
            if (known.isa == "avx2") {
                found.push_back(N_AVX2::near_kernels(known.isa));
                continue;
            }
#endif
            found.push_back(HWY_STATIC_DISPATCH(near_kernels)(known.isa));
        }
        return found;
    }();
    const auto at = std::ranges::find(all, isa, &NearKernels::isa);
    return at == all.end() ? all.front() : *at;
}

}  // namespace raydix
#endif
