// What batches of rays through scenes have in common, in float and in double.
#pragma once

#include <raydix/error.h>
#include <raydix/scene.h>

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "base/options.h"

namespace raydix {

struct JobCounts {
    std::uint64_t hits = 0, invalid = 0;

    void operator+=(const JobCounts& more) { hits += more.hits, invalid += more.invalid; }
};

inline TraceCounts sum_of(const std::vector<JobCounts>& parts, std::size_t rays) {
    TraceCounts sum;
    sum.rays = rays;
    for (const JobCounts& part : parts) sum.hits += part.hits, sum.invalid_rays += part.invalid;
    return sum;
}

/// Throws InputError: an option out of range, masks for another number of rays.
template <class Scalar>
void check_options(std::size_t rays, const BasicSceneTraceOptions<Scalar>& options) {
    check_enum("path", options.path, SimdPath::sorted);
    if (!options.masks.empty() && options.masks.size() != rays)
        throw InputError("trace: " + std::to_string(rays) + " rays, but " +
                         std::to_string(options.masks.size()) + " masks");
}

}  // namespace raydix
