// What all kernels do with a batch: its size is checked, counts of its blocks are added up.
#pragma once

#include <raydix/error.h>
#include <raydix/trace.h>

#include <cstddef>
#include <cstdint>
#include <string>
#include <type_traits>

#include "base/options.h"

namespace raydix {

/// Throws InputError if they differ.
inline void check_sizes(std::size_t rays, std::size_t results) {
    if (rays != results)
        throw InputError("trace: " + std::to_string(rays) + " rays, but room for " +
                         std::to_string(results) + " results");
}

/// Throws InputError for what no caller can have meant. `threads` is with_threads' matter.
inline void check_options(const TraceOptions& options) {
    check_enum("path", options.path, SimdPath::sorted);
}

/// AnyHit: Hit or HitD.
template <class AnyHit, class Scalar>
AnyHit hit_in_tree(Scalar t, std::uint32_t prim, Scalar u, Scalar v) {
    if constexpr (std::is_same_v<AnyHit, Hit>)
        return hit_of_tree({t, prim, u, v});
    else
        return hit_of_tree(TreeHitD{t, prim, u, v});
}

inline void add(TraceCounts& sum, const TraceCounts& part) {
    sum.rays += part.rays;
    sum.hits += part.hits;
    sum.invalid_rays += part.invalid_rays;
    sum.node_visits += part.node_visits;
    sum.triangle_tests += part.triangle_tests;
}

}  // namespace raydix
