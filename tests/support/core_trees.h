// Octree and k-d tree over points from sorted codes by any launcher, in memory of that launcher:
// what the host's loops, shuffled orders and a GPU are compared by.
#pragma once

#include <raydix/kdtree.h>
#include <raydix/octree.h>

#include <cstdint>

#include "exec/arena.h"
#include "layout/leaf_copies.h"
#include "tree/kdtree.h"
#include "tree/octree.h"

namespace raydix::test {

/// Points in leaf order with their sorted codes; more than `max_leaf` of them.
template <class Key>
struct SortedPoints {
    const Key* keys;
    const Vec3* points;
    std::uint32_t n;
    Grid grid;
    std::uint32_t max_leaf;
};

/// Where the trees lie; their sizes are counts in the launcher's memory.
struct CoreTrees {
    OctreeNode* octree_nodes;
    std::uint32_t *octree_count, *level_begin, octree_capacity, level_entries;
    KdNode* kd_nodes;
    std::uint32_t *kd_inner, *kd_depth, kd_capacity;
};

struct ClearWords {
    std::uint32_t* words;
    RAYDIX_HD void operator()(std::uint32_t i) const { words[i] = 0; }
};

template <class Launcher, class Key>
CoreTrees build_core_trees(Launcher& launcher, Arena& arena, const SortedPoints<Key>& in) {
    CoreTrees out{};
    const OctreeRule rule{CodeFormat<Key>::axis_bits, in.max_leaf};
    out.octree_capacity = 8 * in.n + 64;
    out.level_entries = static_cast<std::uint32_t>(rule.max_level) + 2;
    out.octree_nodes = arena.take<OctreeNode>(out.octree_capacity);
    out.level_begin = arena.take<std::uint32_t>(out.level_entries);
    const auto radix = take_radix_chains<Key, typename Launcher::Probe>(arena, in.n, rule);
    const ChainOrder order = take_chain_order(arena, out.octree_capacity);
    out.octree_count = radix.node_count;
    launcher.launch("clear", out.level_entries, ClearWords{out.level_begin});
    count_octree(launcher, in.keys, in.n, radix);
    emit_octree(launcher, in.n, radix, order, out.octree_nodes, out.level_begin);

    out.kd_capacity = 2 * in.n + 2;
    out.kd_nodes = arena.take<KdNode>(out.kd_capacity);
    out.kd_depth = arena.take<std::uint32_t>(1);
    const KdKeys<Key> keys{in.keys, in.n, in.grid, in.max_leaf};
    const KdRanges ranges = KdRanges::take(arena, in.n);
    const KdFitScratch scratch = KdFitScratch::take(arena, in.n);
    out.kd_inner = ranges.inner;
    find_kd_ranges(launcher, keys, ranges);
    emit_kd_nodes(launcher, keys, ranges, scratch, BoxOfLeaf<Vec3>{in.points}, out.kd_nodes,
                  out.kd_depth);
    return out;
}

inline bool same(const OctreeNode& a, const OctreeNode& b) {
    return a.code == b.code && a.parent == b.parent && a.first_child == b.first_child &&
           a.first_point == b.first_point && a.point_count == b.point_count &&
           a.child_mask == b.child_mask && a.level == b.level;
}

}  // namespace raydix::test
