// The instruction set of kernels that all processors run which a build is for. For files that
// <hwy/foreach_target.h> compiles.
#pragma once

#include <hwy/highway.h>
#include <raydix/error.h>

#include <cstdint>
#include <string>
#include <string_view>

// Sets beyond it, chosen at run time.
#define RAYDIX_CHOOSES_AVX512 ((HWY_TARGETS & HWY_AVX3) != 0 && HWY_STATIC_TARGET != HWY_AVX3)
#define RAYDIX_CHOOSES_AVX2 ((HWY_TARGETS & HWY_AVX2) != 0 && HWY_STATIC_TARGET != HWY_AVX2)

namespace raydix {

inline constexpr std::string_view baseline_isa = HWY_STATIC_TARGET == HWY_AVX3    ? "avx512"
                                                 : HWY_STATIC_TARGET == HWY_AVX2  ? "avx2"
                                                 : HWY_STATIC_TARGET == HWY_SSE4  ? "sse4"
                                                 : HWY_STATIC_TARGET == HWY_SSSE3 ? "ssse3"
                                                 : HWY_ARCH_ARM                   ? "neon"
                                                                                  : "scalar";

/// baseline_isa. `here`: what this processor runs. Throws BackendUnavailable if it lacks the set,
/// which happens to builds for the machine that compiled them (RAYDIX_INSTRUCTION_SETS=HOST).
inline std::string_view runnable_baseline([[maybe_unused]] std::int64_t here) {
#if HWY_STATIC_TARGET == HWY_AVX3 || HWY_STATIC_TARGET == HWY_AVX2
    if ((here & HWY_STATIC_TARGET) == 0)
        throw BackendUnavailable("this build of raydix is for processors with " +
                                 std::string(baseline_isa) +
                                 "; this one lacks it (RAYDIX_INSTRUCTION_SETS=HOST)");
#endif
    return baseline_isa;
}

}  // namespace raydix
