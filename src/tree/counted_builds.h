// The work of a builder, launch by launch, as it really ran: for the model of larger machines
// (Karras 2012, section 5).
#pragma once

#include <raydix/bvh.h>

#include <cstdint>
#include <span>
#include <vector>

#include "exec/host_launcher.h"

namespace raydix {

/// What a build did, and of its tree the root's box and the depth.
struct CountedBuild {
    std::vector<LaunchRecord> launches;
    std::uint32_t inner_count = 0, max_depth = 0;
    Aabb bounds{};
};

/// Builds a tree over sorted keys [n], n > 0, and boxes [n] in the same order, and returns its
/// launches: items, bytes read and written, and the longest chain of accesses that wait for each
/// other. A climb from leaf to root counts as one chain, whichever items took part in it. `fit`
/// as_published is what the builder's source does; apetrei fits boxes in its own pass unless `fit`
/// is levels. Throws InputError for builders outside the LBVH family.
template <class Key>
[[nodiscard]] CountedBuild count_build(Builder builder, Fit fit, std::span<const Key> keys,
                                       std::span<const Aabb> leaf_boxes, int max_leaf);

extern template CountedBuild count_build(Builder, Fit, std::span<const std::uint32_t>,
                                         std::span<const Aabb>, int);
extern template CountedBuild count_build(Builder, Fit, std::span<const std::uint64_t>,
                                         std::span<const Aabb>, int);

}  // namespace raydix
