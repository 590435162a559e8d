#include "tree/build_hploc.h"

#include "exec/host_launcher.h"
#include "tree/hploc_launches.h"
#include "tree/lbvh_launches.h"

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
                       std::uint32_t id_limit, const BoxLanes& boxes, std::uint32_t max_leaf,
                       Buffer<ClusterNode>& nodes, Buffer<std::byte>& memory) {
    const auto n = static_cast<std::uint32_t>(keys.size());
    if (n == 1) return primitive_cluster;
    nodes.reset(id_limit);
    memory.reset(scratch_bytes<HplocScratch>(n));
    Arena arena(memory.data(), memory.size());
    const HplocScratch scratch(arena, n);
    HostLauncher<> launcher;
    launch_hploc(launcher,
                 HplocArrays<Key, LaneBoxes>{{keys.data(), n},
                                             ids.data(),
                                             {&boxes},
                                             max_leaf,
                                             scratch.lists,
                                             scratch.meeting,
                                             nodes.data(),
                                             scratch.root},
                 &n, n);
    return *scratch.root;
}

template ClusterRef build_hploc(std::span<const std::uint32_t>, std::span<const std::uint32_t>,
                                std::uint32_t, const BoxLanes&, std::uint32_t, Buffer<ClusterNode>&,
                                Buffer<std::byte>&);
template ClusterRef build_hploc(std::span<const std::uint64_t>, std::span<const std::uint32_t>,
                                std::uint32_t, const BoxLanes&, std::uint32_t, Buffer<ClusterNode>&,
                                Buffer<std::byte>&);

}  // namespace raydix
