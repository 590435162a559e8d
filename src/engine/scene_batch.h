// What batches of rays through scenes have in common, in float and in double.
#pragma once

#include <raydix/error.h>
#include <raydix/scene.h>

#include <cstddef>
#include <cstdint>
#include <span>
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

/// Rays and where their answers go: hits, or else occluded.
template <class Scalar>
struct BasicSceneBatch {
    using Hit = BasicHit<Scalar>;

    std::span<const BasicRay<Scalar>> rays;
    Hit* hits;
    std::uint8_t* occluded;
    const BasicSceneTraceOptions<Scalar>& options;

    [[nodiscard]] std::uint32_t mask(std::size_t i) const {
        return options.masks.empty() ? options.mask : options.masks[i];
    }
    /// Null: all hits count.
    [[nodiscard]] const auto* filter() const { return options.filter ? &options.filter : nullptr; }
    void set(std::size_t i, const Hit& hit) const {
        if (hits != nullptr)
            hits[i] = hit;
        else
            occluded[i] = hit.hit();
    }
    /// Rays first to last - 1, of a batch without masks, or all.
    [[nodiscard]] BasicSceneBatch part(std::size_t first, std::size_t last) const {
        return {rays.subspan(first, last - first), hits == nullptr ? nullptr : hits + first,
                occluded == nullptr ? nullptr : occluded + first, options};
    }
};

/// Throws InputError: an option out of range, masks for another number of rays.
template <class Scalar>
void check_options(std::size_t rays, const BasicSceneTraceOptions<Scalar>& options) {
    check_enum("path", options.path, SimdPath::sorted);
    if (!options.masks.empty() && options.masks.size() != rays)
        throw InputError("trace: " + std::to_string(rays) + " rays, but " +
                         std::to_string(options.masks.size()) + " masks");
}

}  // namespace raydix
