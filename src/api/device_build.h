// The build of build_bvh.cpp as launches for any backend: bounds -> codes -> sort -> leaf copies ->
// hierarchy -> boxes
// -> node pairs, one line each in run. What the data decides is never asked for by the host.
#pragma once

#include <raydix/device.h>
#include <raydix/error.h>

#include <cstdint>
#include <limits>
#include <string>

#include "exec/arena.h"
#include "keys/encode_launches.h"
#include "layout/leaf_copies.h"
#include "layout/pair64.h"
#include "primitives/bounds_launches.h"
#include "tree/tree_launches.h"

namespace raydix {

/// Throws the InputError of build_bvh for options out of range.
void check_device_options(const BuildOptions& options, std::uint64_t n);

/// Stands in for memory while sizes are added up: an arena that hands out addresses nobody reads.
inline Arena sizing_arena() {
    return {reinterpret_cast<void*>(Arena::alignment), std::numeric_limits<std::size_t>::max() / 2};
}

struct PublishCounts {
    const BoundsPart* bounds;
    std::uint32_t input_count;
    DeviceCounts* counts;
    RAYDIX_HD void operator()(std::uint32_t) const {
        *counts = {bounds->box,
                   input_count,
                   bounds->valid,
                   bounds->left_out,
                   bounds->first_left_out,
                   bounds->unreadable,
                   bounds->first_unreadable,
                   0,
                   0};
    }
};

/// Between the stages a caller may look at the time.
struct NoMarks {
    void operator()(const char*) const {}
};

/// One build: a source of primitives, the copies its leaves hold, and the key type.
template <class Key, class Source, class Copy>
struct DeviceBuild {
    Source source;
    std::uint32_t n;
    BuildOptions options;
    DeviceTree tree;
    Copy* copies;

    /// `mark(stage)` is called behind the launches of each stage.
    template <class Launcher, class Mark = NoMarks>
    void run(Launcher& launcher, Arena& arena, const Mark& mark = {}) const {
        auto* bounds = arena.take<BoundsPart>(1);
        const BoundsScratch bounds_scratch(arena);
        launch_bounds(launcher, source, n, bounds_scratch, bounds);
        DeviceCounts nowhere;  // a size query has no arrays, but its launches name places in them
        DeviceCounts* counts = tree.counts != nullptr ? tree.counts : &nowhere;
        launcher.launch("bounds.publish", 1, PublishCounts{bounds, n, counts});
        mark("bounds");
        if (n == 0) return;

        auto* keys = arena.take<Key>(n);
        auto* sorted_keys = arena.take<Key>(n);
        auto* ids = arena.take<std::uint32_t>(n);
        launch_encode(launcher, source, n, bounds, keys, ids);
        mark("codes");

        // All bits: what is left out has the highest key of all and goes to the end.
        launcher.sort_pairs("sort", SortArrays<Key>{keys, ids, sorted_keys, tree.order}, n, nullptr,
                            static_cast<int>(8 * sizeof(Key)));
        mark("sort");

        const std::uint32_t* valid = &counts->references;
        launch_copies(launcher, source, valid, n, tree.order, copies);
        mark("layout");

        const TreeScratch scratch(arena, n, options);
        const BoxOfLeaf<Copy> leaf_box{copies};
        const TreeRun<Key> tree_run{sorted_keys,
                                    n,
                                    valid,
                                    options,
                                    {tree.nodes, scratch.parent_slot, &counts->inner_count},
                                    &counts->max_depth};
        launch_hierarchy(launcher, tree_run, scratch, arena, leaf_box);
        mark("hierarchy");

        launch_fit(launcher, tree_run, scratch, leaf_box);
        mark("fit");

        if (tree.pairs == nullptr) return;
        launch_pairs(
            launcher,
            EmitNodePair{tree.nodes, &counts->inner_count, tree.order, tree.pairs, tree.pair_ids},
            valid, inner_node_limit(n, static_cast<std::uint32_t>(options.max_leaf)),
            arena.take<std::uint32_t>(1));
        mark("pairs");
    }
};

/// Calls `visit` with the DeviceBuild for these options and this input.
template <class Visit>
void with_device_build(const DeviceMesh& mesh, const BuildOptions& options, const DeviceTree& tree,
                       const Visit& visit) {
    const auto visit_source = [&](const auto& source, std::uint32_t n, auto* copies) {
        using Source = std::decay_t<decltype(source)>;
        using Copy = std::remove_pointer_t<decltype(copies)>;
        check_device_options(options, n);
        if (options.bits == 30)
            visit(DeviceBuild<std::uint32_t, Source, Copy>{source, n, options, tree, copies});
        else
            visit(DeviceBuild<std::uint64_t, Source, Copy>{source, n, options, tree, copies});
    };
    if (mesh.triangle_count == 0)
        visit_source(PointSource{mesh.vertices}, mesh.vertex_count, tree.points);
    else
        visit_source(TriangleSource{mesh.vertices, mesh.triangles, mesh.vertex_count},
                     mesh.triangle_count, tree.triangles);
}
template <class Visit>
void with_device_build(const DeviceBoxList& boxes, const BuildOptions& options,
                       const DeviceTree& tree, const Visit& visit) {
    check_device_options(options, boxes.count);
    const BoxSource source{boxes.boxes};
    if (options.bits == 30)
        visit(DeviceBuild<std::uint32_t, BoxSource, Aabb>{source, boxes.count, options, tree,
                                                          tree.boxes});
    else
        visit(DeviceBuild<std::uint64_t, BoxSource, Aabb>{source, boxes.count, options, tree,
                                                          tree.boxes});
}

}  // namespace raydix
