// A call of one ray, on the caller's thread.
#pragma once

#include <cstdint>

#include "base/float_env.h"
#include "trace/simd/simd_kernels.h"
#include "trace/simd/wide_batch.h"

namespace raydix {

/// Of this thread's calls of one ray, through whatever tree or scene.
inline constinit thread_local CallHistory call_history;

/// As one_ray, in a plain environment.
inline TreeHit one_ray_plainly(OneRay* kernel, const WideView& tree, std::size_t stack_size,
                               const Ray& ray) {
    constexpr std::size_t inside = 512;
    if (stack_size > inside) [[unlikely]] {
        StackMemory stack;
        stack.reserve_words(stack_size);
        return kernel(tree, ray, stack.view(), call_history);
    }
    std::uint32_t words[inside];
    float entries[inside];
    return kernel(tree, ray, {words, entries}, call_history);
}

/// Through a tree that is not empty. `stack_size`: wide_stack_capacity of its depth.
inline TreeHit one_ray(OneRay* kernel, const WideView& tree, std::size_t stack_size,
                       const Ray& ray) {
    if (FloatEnvironment::is_plain()) [[likely]]
        return one_ray_plainly(kernel, tree, stack_size, ray);
    const FloatEnvironment plain;
    return one_ray_plainly(kernel, tree, stack_size, ray);
}

}  // namespace raydix
