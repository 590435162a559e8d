// Hits of single rays -> one array in the order of the rays (AllHits, AllHitsD).
#pragma once

#include <raydix/trace.h>

#include <algorithm>
#include <cstddef>
#include <vector>

#include "exec/parallel.h"

namespace raydix {

/// Sorts what one ray hit, hits[before] on, by (t, prim). A triangle that is in several leaves was
/// found more than once, with the same t: the others go.
template <class AnyHit>
inline void finish_ray(std::vector<AnyHit>& hits, std::size_t before) {
    const auto first = hits.begin() + static_cast<std::ptrdiff_t>(before);
    std::sort(first, hits.end(), [](const AnyHit& a, const AnyHit& b) {
        return a.t != b.t ? a.t < b.t : a.prim < b.prim;
    });
    hits.erase(std::unique(first, hits.end(),
                           [](const AnyHit& a, const AnyHit& b) { return a.prim == b.prim; }),
               hits.end());
}

/// found[b]: hits of the rays b * rays_per_block on; all.offsets[i + 1]: how many ray i has.
/// Completes all.offsets and all.hits.
template <class AnyHit, class All>
inline void join_blocks(std::vector<std::vector<AnyHit>>& found, std::size_t rays_per_block,
                        All& all) {
    for (std::size_t i = 0; i + 1 < all.offsets.size(); ++i) all.offsets[i + 1] += all.offsets[i];
    all.hits.resize(all.offsets.back());
    for_each_index(
        found.size(),
        [&](std::size_t b) {
            const std::uint64_t at = all.offsets[b * rays_per_block];
            std::copy(found[b].begin(), found[b].end(),
                      all.hits.begin() + static_cast<std::ptrdiff_t>(at));
            std::vector<AnyHit>().swap(found[b]);
        },
        1);
}

}  // namespace raydix
