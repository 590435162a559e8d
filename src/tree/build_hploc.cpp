#include "tree/build_hploc.h"

#include "exec/parallel.h"
#include "tree/hploc.h"

namespace raydix {
namespace {

/// BoxLanes by pointer, as a kernel's arguments are.
struct LaneBoxes {
    const BoxLanes* lanes;
    [[nodiscard]] Aabb get(std::uint32_t place) const { return lanes->get(place); }
};

}  // namespace

template <class Key>
ClusterRef build_hploc(std::span<const Key> keys, std::span<const std::uint32_t> ids,
                       const BoxLanes& boxes, std::uint32_t max_leaf, Buffer<ClusterNode>& nodes,
                       HplocScratch& scratch) {
    const auto n = static_cast<std::uint32_t>(keys.size());
    if (n == 1) return primitive_cluster;
    nodes.reset(n - 1);
    scratch.lists.reset(n);
    scratch.meeting.reset(n - 1);
    for_each_range(n, 1u << 14, [&](std::size_t begin, std::size_t end) {
        for (std::size_t k = begin; k < end; ++k) {
            scratch.lists[k] = primitive_cluster | static_cast<std::uint32_t>(k);
            if (k < n - 1) scratch.meeting[k] = 0;
        }
    });
    std::uint32_t claimed = 0;
    ClusterRef root = 0;
    const HplocArrays<Key, LaneBoxes> arrays{
        {keys.data(), n},       ids.data(),   {&boxes}, max_leaf, scratch.lists.data(),
        scratch.meeting.data(), nodes.data(), &claimed, &root};
    const std::uint32_t warps = (n + warp_lanes - 1) / warp_lanes;
    for_each_index(
        warps,
        [&](std::size_t w) {
            HplocWarp<HostWarp, Key, LaneBoxes>(arrays).run(static_cast<std::uint32_t>(w));
        },
        64);
    return root;
}

template ClusterRef build_hploc(std::span<const std::uint32_t>, std::span<const std::uint32_t>,
                                const BoxLanes&, std::uint32_t, Buffer<ClusterNode>&,
                                HplocScratch&);
template ClusterRef build_hploc(std::span<const std::uint64_t>, std::span<const std::uint32_t>,
                                const BoxLanes&, std::uint32_t, Buffer<ClusterNode>&,
                                HplocScratch&);

}  // namespace raydix
