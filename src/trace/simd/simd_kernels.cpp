// Compiles the kernels once per instruction set (Highway's foreach_target) and lists those that
// this processor can run.
#include "trace/simd/simd_kernels.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "trace/simd/simd_kernels.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "base/baseline_isa.h"
#include "trace/simd/packet.h"
#include "trace/simd/packets.h"
#include "trace/simd/scale_rays.h"
#include "trace/simd/single_calls.h"
#include "trace/simd/turns.h"

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

SimdKernels kernels(std::string_view isa) {
    return {isa, one<false>, one<true>, single, packets, streams, scale_rays};
}

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace raydix {

std::span<const SimdKernels> simd_kernels() {
    static const std::vector<SimdKernels> all = [] {
        std::vector<SimdKernels> found;
        [[maybe_unused]] const std::int64_t here = hwy::SupportedTargets();
#if RAYDIX_CHOOSES_AVX512
        if (here & HWY_AVX3) found.push_back(N_AVX3::kernels("avx512"));
#endif
#if RAYDIX_CHOOSES_AVX2
        if (here & HWY_AVX2) found.push_back(N_AVX2::kernels("avx2"));
#endif
        found.push_back(HWY_STATIC_DISPATCH(kernels)(runnable_baseline(here)));
        return found;
    }();
    return all;
}

}  // namespace raydix
#endif
