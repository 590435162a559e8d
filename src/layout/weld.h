// Corners at the same place get one number.
#pragma once

#include <raydix/types.h>

#include <bit>
#include <cstdint>
#include <vector>

#include "exec/parallel.h"
#include "sort/radix_sort.h"

namespace raydix {

/// `corner(k)` for k < n, without -0 -> [n] the least k at the same place. One that is NaN is at no
/// place but its own. n <= 2^32 - 1.
template <class Corner>
std::vector<std::uint32_t> weld(std::size_t n, const Corner& corner) {
    const auto scattered = [](std::uint64_t x) {  // the last step of SplitMix64
        x = (x ^ x >> 30) * 0xBF58476D1CE4E5B9u;
        x = (x ^ x >> 27) * 0x94D049BB133111EBu;
        return x ^ x >> 31;
    };
    Buffer<std::uint64_t> keys(n);
    for_each_index(n, [&](std::size_t k) {
        const Vec3 p = corner(k);
        const auto x = std::bit_cast<std::uint32_t>(p.x), y = std::bit_cast<std::uint32_t>(p.y),
                   z = std::bit_cast<std::uint32_t>(p.z);
        keys[k] = scattered(scattered(std::uint64_t{x} << 32 | y) + z);
    });
    Buffer<std::uint32_t> order(n);
    SortScratch<std::uint64_t> scratch;
    sort_keys(keys.span(), order.span(), 64, scratch);
    std::vector<std::uint32_t> same(n), places;
    for (std::size_t begin = 0, end = 0; begin < n; begin = end) {
        places.clear();  // that share this key: nearly always one
        for (; end < n && keys[end] == keys[begin]; ++end) {
            const std::uint32_t k = order[end];
            const Vec3 p = corner(k);
            same[k] = k;
            for (const std::uint32_t at : places)
                if (const Vec3 q = corner(at); q.x == p.x && q.y == p.y && q.z == p.z) {
                    same[k] = at;
                    break;
                }
            if (same[k] == k) places.push_back(k);
        }
    }
    return same;
}

}  // namespace raydix
