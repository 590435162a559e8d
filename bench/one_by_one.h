// Single calls in a loop over blocks: the one that Embree's rays go through.
#pragma once

#include <cstddef>

#include "exec/parallel.h"

namespace raydix::bench {

inline constexpr std::size_t rays_of_a_block = 1024;

/// one(i) for all of [0, n), on the threads of the calling context.
template <class One>
void one_by_one(std::size_t n, const One& one) {
    for_each_block(n, rays_of_a_block, [&](std::size_t, std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) one(i);
    });
}
template <class One>
void one_by_one(std::size_t n, int threads, const One& one) {
    with_threads(threads, [&] { one_by_one(n, one); });
}

}  // namespace raydix::bench
