// What has been compiled once per instruction set, by the names of those that this processor can
// run. For files that <hwy/foreach_target.h> compiles.
#pragma once

#include <hwy/highway.h>

#include <algorithm>
#include <string_view>
#include <vector>

#include "base/baseline_isa.h"
#include "trace/simd/simd_kernels.h"

// The functions of this name for AVX-512, for AVX2 and for the rest; null where it was not
// compiled.
#if RAYDIX_CHOOSES_AVX512
#define RAYDIX_WITH_AVX512(function) N_AVX3::function
#else
#define RAYDIX_WITH_AVX512(function) nullptr
#endif
#if RAYDIX_CHOOSES_AVX2
#define RAYDIX_WITH_AVX2(function) N_AVX2::function
#else
#define RAYDIX_WITH_AVX2(function) nullptr
#endif
#define RAYDIX_OF_EACH_SET(function) \
    RAYDIX_WITH_AVX512(function), RAYDIX_WITH_AVX2(function), HWY_STATIC_DISPATCH(function)

namespace raydix {

/// Kernels has a member `isa`. The best set comes first, as in simd_kernels().
template <class Kernels>
class KernelsBySet {
public:
    using Make = Kernels(std::string_view isa);

    KernelsBySet(Make* avx512, Make* avx2, Make* rest) {
        for (const SimdKernels& known : simd_kernels()) {
            Make* const own = known.isa == "avx512" ? avx512 : known.isa == "avx2" ? avx2 : nullptr;
            all_.push_back((own != nullptr ? own : rest)(known.isa));
        }
    }
    /// The best ones if there are none of this name.
    [[nodiscard]] const Kernels& named(std::string_view isa) const {
        const auto at = std::ranges::find(all_, isa, &Kernels::isa);
        return at == all_.end() ? all_.front() : *at;
    }

private:
    std::vector<Kernels> all_;
};

}  // namespace raydix
