// hploc as launches for any backend: sorted keys [n], ids [n] and boxes [n] -> cluster nodes and
// the root. The pass itself is hploc.h.
#pragma once

#include <cstdint>

#include "exec/arena.h"
#include "tree/hploc.h"

namespace raydix {

/// Boxes of primitives in Morton order, as an array of structs.
struct BoxArray {
    const Aabb* boxes;
    [[nodiscard]] RAYDIX_HD Aabb get(std::uint32_t place) const { return boxes[place]; }
};

/// What the pass needs before it starts, for one primitive.
template <class Key, class Boxes>
struct StartHploc {
    HplocArrays<Key, Boxes> arrays;
    RAYDIX_HD void operator()(std::uint32_t place) const {
        arrays.lists[place] = primitive_cluster | place;
        arrays.meeting[place] = 0;
        if (place == 0) *arrays.root = primitive_cluster;
    }
};

/// One warp's part of the pass.
template <class Key, class Boxes>
struct MergeClusters {
    HplocArrays<Key, Boxes> arrays;
    const std::uint32_t* count;
    template <class Warp>
    RAYDIX_HD void operator()(const Warp&, std::uint32_t warp_index) const {
        HplocArrays<Key, Boxes> mine = arrays;
        mine.keys.count = *count;
        HplocWarp<Warp, Key, Boxes>(mine).run(warp_index);
    }
};

/// Scratch for n primitives; lists and nodes are read by what comes after.
struct HplocScratch {
    ClusterRef* lists;
    std::uint32_t* meeting;
    ClusterRef* root;
    HplocScratch(Arena& arena, std::uint32_t n)
        : lists(arena.take<ClusterRef>(n)),
          meeting(arena.take<std::uint32_t>(n)),
          root(arena.take<ClusterRef>(1)) {}
};

/// The first *count <= n places. Without any nothing is written; with one the root is a primitive.
template <class Launcher, class Key, class Boxes>
void launch_hploc(Launcher& launcher, const HplocArrays<Key, Boxes>& arrays,
                  const std::uint32_t* count, std::uint32_t n) {
    launcher.launch_counted("hploc.start", count, n, StartHploc<Key, Boxes>{arrays});
    launcher.launch_warps("hploc.merge", count, n, MergeClusters<Key, Boxes>{arrays, count});
}

}  // namespace raydix
