// Batches of rays through scenes of instances, in float and in double.
#pragma once

#include <raydix/error.h>
#include <raydix/instances.h>

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "exec/parallel.h"
#include "trace/ray_frame.h"

namespace raydix {

inline constexpr std::size_t rays_per_instance_block = 512;

/// One ray after the other: find(ray, mask) -> a hit for each valid one, then one(i, hit) for all.
/// Hit: InstanceHit or InstanceHitD.
template <class Hit, class AnyRay, class Find, class One>
InstanceTraceCounts instance_batch(std::span<const AnyRay> rays,
                                   const InstanceTraceOptions& options, const Find& find,
                                   const One& one) {
    if (!options.masks.empty() && options.masks.size() != rays.size())
        throw InputError("trace: " + std::to_string(rays.size()) + " rays, but " +
                         std::to_string(options.masks.size()) + " masks");
    constexpr std::size_t block_size = rays_per_instance_block;
    std::vector<InstanceTraceCounts> parts((rays.size() + block_size - 1) / block_size);
    with_threads(options.threads, [&] {
        for_each_block(
            rays.size(), block_size, [&](std::size_t block, std::size_t begin, std::size_t end) {
                for (std::size_t i = begin; i < end; ++i) {
                    Hit hit;
                    if (!is_valid(rays[i]))
                        ++parts[block].invalid_rays;
                    else
                        hit =
                            find(rays[i], options.masks.empty() ? options.mask : options.masks[i]);
                    parts[block].hits += hit.hit.hit();
                    one(i, hit);
                }
            });
    });
    InstanceTraceCounts sum;
    sum.rays = rays.size();
    for (const InstanceTraceCounts& part : parts) {
        sum.hits += part.hits;
        sum.invalid_rays += part.invalid_rays;
    }
    return sum;
}

inline void require_instance_room(std::size_t rays, std::size_t results) {
    if (rays != results)
        throw InputError("trace: " + std::to_string(rays) + " rays, but room for " +
                         std::to_string(results) + " results");
}

}  // namespace raydix
