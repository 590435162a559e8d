// k-d tree and octree as launches for any backend, from primitives on: the builds of
// build_kdtree.cpp and build_octree.cpp, where neither the number of valid primitives nor that of
// nodes is known to the host.
#pragma once

#include <raydix/device_trees.h>

#include <cstdint>

#include "build/octree_kdtree_options.h"
#include "gpu/device_run.h"
#include "gpu/device_sorted.h"
#include "layout/leaf_copies.h"
#include "tree/kdtree.h"
#include "tree/lbvh_launches.h"
#include "tree/octree.h"

namespace raydix {

/// The grid of the codes, for those who need its planes.
struct MakeGrid {
    const BoundsPart* bounds;
    int axis_bits;
    Grid* grid;
    RAYDIX_HD void operator()(std::uint32_t) const { *grid = make_grid(bounds->box, axis_bits); }
};

/// The most inner nodes a k-d tree of n primitives can have; `options` are resolved.
[[nodiscard]] constexpr std::uint32_t inner_limit(std::uint32_t n, const KdTreeOptions& options) {
    return inner_node_limit(n, static_cast<std::uint32_t>(options.max_leaf));
}

template <class Key, class Source, class Copy>
struct DeviceKdBuild {
    Source source;
    std::uint32_t n;
    KdTreeOptions options;  // resolved
    DeviceKdArrays tree;
    Copy* copies;

    template <class Launcher, class Mark = NoMarks>
    void run(Launcher& launcher, Arena& arena, const Mark& mark = {}) const {
        DeviceCounts nowhere;  // a size query has no arrays, but its launches name places in them
        DeviceCounts* counts = tree.counts != nullptr ? tree.counts : &nowhere;
        const SortedPrimitives<Key> sorted =
            launch_sorted<Key>(launcher, arena, source, n, counts, tree.order, mark);
        if (n == 0) return;
        auto* grid = arena.take<Grid>(1);
        launcher.launch("kdtree.grid", 1,
                        MakeGrid{sorted.bounds, CodeFormat<Key>::axis_bits, grid});
        const KdKeys<Key> keys{sorted.keys, n, sorted.count, grid,
                               static_cast<std::uint32_t>(options.max_leaf)};
        KdRanges ranges = KdRanges::take(arena, n);
        ranges.inner = &counts->inner_count;
        find_kd_ranges(launcher, keys, ranges);
        mark("hierarchy");

        launch_copies(launcher, source, sorted.count, n, tree.order, copies);
        mark("layout");

        emit_kd_nodes(launcher, keys, ranges, KdFitScratch::take(arena, inner_limit(n, options)),
                      BoxOfLeaf<Copy>{copies}, tree.nodes, &counts->max_depth);
        mark("fit");
    }
};

template <class Key, class Source>
struct DeviceOctreeBuild {
    Source source;
    std::uint32_t n;
    OctreeOptions options;  // resolved
    DeviceOctreeArrays tree;

    template <class Launcher, class Mark = NoMarks>
    void run(Launcher& launcher, Arena& arena, const Mark& mark = {}) const {
        using Probe = typename Launcher::Probe;
        DeviceOctreeCounts nowhere;
        DeviceOctreeCounts* counts = tree.counts != nullptr ? tree.counts : &nowhere;
        const SortedPrimitives<Key> sorted =
            launch_sorted<Key>(launcher, arena, source, n, counts, tree.order, mark);
        if (n == 0) return;
        const OctreeRule rule{options.max_level, static_cast<std::uint32_t>(options.max_leaf)};
        RadixChains<Key, Probe> radix = take_radix_chains<Key, Probe>(arena, n, rule);
        radix.node_count = &counts->node_count;
        count_octree(launcher, sorted.keys, sorted.count, n, radix);
        emit_octree(launcher, n, radix, take_chain_order(arena, tree.node_capacity), tree.nodes,
                    counts->level_begin);
        mark("hierarchy");

        launcher.launch_counted("layout.points", sorted.count, n,
                                CenterInOrder<Source>{source, tree.order, tree.points});
        mark("layout");
    }
};

/// Calls `visit` with the DeviceKdBuild for these options and this mesh.
template <class Visit>
void with_device_kdtree(const DeviceMesh& mesh, const KdTreeOptions& options,
                        const DeviceKdArrays& tree, const Visit& visit) {
    with_source(mesh, tree, [&](const auto& source, std::uint32_t n, auto* copies) {
        using Source = std::decay_t<decltype(source)>;
        using Copy = std::remove_pointer_t<decltype(copies)>;
        const KdTreeOptions full = resolved(
            options, mesh.triangle_count == 0 ? PrimitiveKind::points : PrimitiveKind::triangles,
            n);
        check_kd_inner(inner_limit(n, full), n);
        if (full.bits == 30)
            visit(DeviceKdBuild<std::uint32_t, Source, Copy>{source, n, full, tree, copies});
        else
            visit(DeviceKdBuild<std::uint64_t, Source, Copy>{source, n, full, tree, copies});
    });
}

/// Calls `visit` with the DeviceOctreeBuild for these options and this mesh.
template <class Visit>
void with_device_octree(const DeviceMesh& mesh, const OctreeOptions& options,
                        const DeviceOctreeArrays& tree, const Visit& visit) {
    struct NoCopies {
        std::nullptr_t points = nullptr, triangles = nullptr;
    };
    with_source(mesh, NoCopies(), [&](const auto& source, std::uint32_t n, std::nullptr_t) {
        using Source = std::decay_t<decltype(source)>;
        const OctreeOptions full = resolved(options, n);
        if (full.bits == 30)
            visit(DeviceOctreeBuild<std::uint32_t, Source>{source, n, full, tree});
        else
            visit(DeviceOctreeBuild<std::uint64_t, Source>{source, n, full, tree});
    });
}

// The builds as gpu/device_run.h takes them.
inline auto build_of(const DeviceMesh& mesh, const KdTreeOptions& options,
                     const DeviceKdArrays& tree) {
    return [=](const auto& visit) { with_device_kdtree(mesh, options, tree, visit); };
}
inline auto build_of(const DeviceMesh& mesh, const OctreeOptions& options,
                     const DeviceOctreeArrays& tree) {
    return [=](const auto& visit) { with_device_octree(mesh, options, tree, visit); };
}

/// For a size: so many primitives and no arrays.
inline DeviceMesh mesh_of(PrimitiveKind kind, std::uint32_t n) {
    DeviceMesh mesh;
    (kind == PrimitiveKind::points ? mesh.vertex_count : mesh.triangle_count) = n;
    return mesh;
}
template <class Machine>
std::size_t kdtree_scratch_bytes(std::uint32_t n, PrimitiveKind kind,
                                 const KdTreeOptions& options) {
    return scratch_size<Machine>(build_of(mesh_of(kind, n), options, DeviceKdArrays())).all;
}
template <class Machine>
std::size_t octree_scratch_bytes(std::uint32_t n, std::uint32_t node_capacity,
                                 const OctreeOptions& options) {
    DeviceOctreeArrays tree;
    tree.node_capacity = node_capacity;
    return scratch_size<Machine>(build_of(mesh_of(PrimitiveKind::points, n), options, tree)).all;
}

}  // namespace raydix
