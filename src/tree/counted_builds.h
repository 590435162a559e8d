// The work of a builder, launch by launch, as it really ran: for the model of larger machines
// (Karras 2012, section 5).
#pragma once

#include <raydix/bvh.h>
#include <raydix/hierarchy_study.h>

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "base/math.h"
#include "exec/host_launcher.h"
#include "tree/apetrei_cpu.h"
#include "tree/hierarchy.h"

namespace raydix {

struct BuildWay {
    Builder builder = Builder::karras;
    Fit fit = Fit::as_published;
    StudyForm form = StudyForm::launches;  // published: karras, garanzha; tuned: karras, apetrei
};

/// The box of the leaf over keys first to first + count - 1, from boxes in their order.
template <class Probe>
struct LeafBoxOfBoxes {
    const Aabb* boxes;
    Aabb operator()(std::uint32_t first, std::uint32_t count) const {
        Aabb box = boxes[first];
        for (std::uint32_t k = first + 1; k < first + count; ++k) box = unite(box, boxes[k]);
        Probe::bytes(std::uint64_t{count} * sizeof(Aabb));
        Probe::step();
        return box;
    }
};

/// Kept from one build to the next, so that no build pays for new pages.
struct CountedMemory {
    Buffer<BvhNode> nodes;
    Buffer<std::uint32_t> ranks;
    HierarchyScratch scratch;
    ClimbScratch climb;
};

/// What a build did or how long it took, and of its tree the root's box, the depth, and a hash of
/// links, boxes and leaves in preorder, in which the numbers of nodes do not enter.
struct CountedBuild {
    std::vector<LaunchRecord> launches;
    std::uint32_t inner_count = 0, max_depth = 0;
    Aabb bounds{};
    std::string digest;                          // of a counted build
    std::vector<std::uint64_t> inner_per_level;  // of a counted build: inner nodes by depth
};

/// Builds a tree over sorted keys [n], n > 0, and boxes [n] in the same order, and returns its
/// launches: items, bytes read and written, and the longest chain of accesses that wait for each
/// other. A climb from leaf to root counts as one chain, whichever items took part in it. `fit`
/// as_published is what the builder's source does; apetrei fits boxes in its own pass unless `fit`
/// is levels. Throws InputError for builders outside the LBVH family, and for those that have no
/// such form.
template <class Key>
[[nodiscard]] CountedBuild count_build(const BuildWay& way, std::span<const Key> keys,
                                       std::span<const Aabb> leaf_boxes, int max_leaf,
                                       CountedMemory& memory);

/// The same launches without counting: each with the milliseconds it took here.
template <class Key>
[[nodiscard]] CountedBuild time_build(const BuildWay& way, std::span<const Key> keys,
                                      std::span<const Aabb> leaf_boxes, int max_leaf,
                                      CountedMemory& memory);

extern template CountedBuild count_build(const BuildWay&, std::span<const std::uint32_t>,
                                         std::span<const Aabb>, int, CountedMemory&);
extern template CountedBuild count_build(const BuildWay&, std::span<const std::uint64_t>,
                                         std::span<const Aabb>, int, CountedMemory&);
extern template CountedBuild time_build(const BuildWay&, std::span<const std::uint32_t>,
                                        std::span<const Aabb>, int, CountedMemory&);
extern template CountedBuild time_build(const BuildWay&, std::span<const std::uint64_t>,
                                        std::span<const Aabb>, int, CountedMemory&);

}  // namespace raydix
