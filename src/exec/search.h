// The first element of a range that has some property, found in parallel.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>

#include "exec/parallel.h"

namespace raydix {

/// The least i in [0, n) with found(i), or n: the same for every thread count.
template <class Found>
[[nodiscard]] std::size_t first_index_where(std::size_t n, const Found& found) {
    constexpr std::size_t grain = 16384;
    std::atomic<std::size_t> first{n};
    for_each_range(n, grain, [&](std::size_t begin, std::size_t end) {
        end = std::min(end, first.load(std::memory_order_relaxed));
        for (std::size_t i = begin; i < end; ++i) {
            if (!found(i)) continue;
            std::size_t seen = first.load(std::memory_order_relaxed);
            while (i < seen && !first.compare_exchange_weak(seen, i, std::memory_order_relaxed)) {
            }
            return;
        }
    });
    return first.load(std::memory_order_relaxed);
}

}  // namespace raydix
