// The doors to the kernels that are compiled once per instruction set.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

#include "trace/simd/wide_ray.h"

namespace raydix {

struct SimdCounts {
    std::uint64_t hits = 0, invalid = 0, visits = 0, tests = 0;
};

/// Rays rays[index[k]] (or rays[k] without an index), k < n; results go to the same places: hits,
/// or occluded if hits is null.
struct SimdJob {
    WideView tree;
    const Ray* rays;
    const std::uint32_t* index;
    std::size_t n;
    Hit* hits;
    std::uint8_t* occluded;
    WideStackView stack;
    bool counting;
};

struct SimdKernels {
    std::string_view isa;
    void (*single)(const SimdJob& job, SimdCounts& counts);
};

/// Best first; those this processor can run.
[[nodiscard]] std::span<const SimdKernels> simd_kernels();

}  // namespace raydix
