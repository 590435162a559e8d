// The meeting point of bottom-up passes, where the second child to arrive goes on, and counters
// that hand out places.
#pragma once

#include <cstdint>

#include "base/hd.h"

#if defined(__CUDACC__)
#include <cuda/atomic>
#else
#include <atomic>
#endif

namespace raydix {

/// Leaves `value` (not 0) at `meeting` and returns what lay there: 0 for the first to come, who
/// stops. The second gets the first one's value. Acquire-release on both sides: the second sees all
/// that the first wrote before.
RAYDIX_HD inline std::uint8_t arrive(std::uint8_t& meeting, std::uint8_t value) {
#if defined(__CUDA_ARCH__)
    // There is no byte exchange on the device: the byte's word is updated by compare-exchange.
    const auto address = reinterpret_cast<std::uintptr_t>(&meeting);
    auto* word = reinterpret_cast<std::uint32_t*>(address & ~std::uintptr_t{3});
    const unsigned shift = static_cast<unsigned>(address & 3) * 8;
    cuda::atomic_ref<std::uint32_t, cuda::thread_scope_device> shared(*word);
    std::uint32_t old = shared.load(cuda::memory_order_relaxed);
    while (!shared.compare_exchange_weak(
        old, (old & ~(0xFFu << shift)) | (std::uint32_t{value} << shift),
        cuda::memory_order_acq_rel)) {
    }
    return static_cast<std::uint8_t>(old >> shift);
#elif defined(__CUDACC__)
    return cuda::atomic_ref<std::uint8_t, cuda::thread_scope_system>(meeting).exchange(
        value, cuda::memory_order_acq_rel);
#else
    return std::atomic_ref<std::uint8_t>(meeting).exchange(value, std::memory_order_acq_rel);
#endif
}

/// The same for a word: returns what lay there before.
RAYDIX_HD inline std::uint32_t arrive(std::uint32_t& meeting, std::uint32_t value) {
#if defined(__CUDACC__)
    return cuda::atomic_ref<std::uint32_t, cuda::thread_scope_device>(meeting).exchange(
        value, cuda::memory_order_acq_rel);
#else
    return std::atomic_ref<std::uint32_t>(meeting).exchange(value, std::memory_order_acq_rel);
#endif
}

/// Takes `count` places of a list whose length is `counter`; returns the first. Order is nobody's
/// promise.
RAYDIX_HD inline std::uint32_t claim(std::uint32_t& counter, std::uint32_t count) {
#if defined(__CUDACC__)
    return cuda::atomic_ref<std::uint32_t, cuda::thread_scope_device>(counter).fetch_add(
        count, cuda::memory_order_relaxed);
#else
    return std::atomic_ref<std::uint32_t>(counter).fetch_add(count, std::memory_order_relaxed);
#endif
}

}  // namespace raydix
