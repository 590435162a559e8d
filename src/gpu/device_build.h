// The build of build_bvh.cpp as launches for any backend: bounds -> codes -> sort -> leaf copies ->
// hierarchy -> boxes -> node pairs, one line each in run.
#pragma once

#include <raydix/device.h>

#include <cstdint>

#include "gpu/device_run.h"
#include "gpu/device_sorted.h"
#include "layout/leaf_copies.h"
#include "layout/pair64.h"
#include "tree/hploc_launches.h"
#include "tree/place_launches.h"
#include "tree/tree_launches.h"

namespace raydix {

/// Throws the InputError of build_bvh for options out of range.
void check_device_options(const BuildOptions& options, std::uint64_t n);

/// The most inner nodes that a tree over n primitives can have.
[[nodiscard]] constexpr std::uint32_t inner_limit(std::uint32_t n, const BuildOptions& options) {
    // Where leaves are a matter of cost, each primitive may have its own.
    return inner_node_limit(
        n, options.builder == Builder::hploc ? 1 : static_cast<std::uint32_t>(options.max_leaf));
}

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
        DeviceCounts nowhere;  // a size query has no arrays, but its launches name places in them
        DeviceCounts* counts = tree.counts != nullptr ? tree.counts : &nowhere;
        if (options.builder == Builder::hploc)
            run_hploc(launcher, arena, counts, mark);
        else
            run_lbvh(launcher, arena, counts, mark);
        if (n == 0 || tree.pairs == nullptr) return;
        launch_pairs(
            launcher,
            EmitNodePair{tree.nodes, &counts->inner_count, tree.order, tree.pairs, tree.pair_ids},
            &counts->references, inner_limit(n, options), arena.take<std::uint32_t>(1));
        mark("pairs");
    }

private:
    template <class Launcher, class Mark>
    void run_lbvh(Launcher& launcher, Arena& arena, DeviceCounts* counts, const Mark& mark) const {
        const SortedPrimitives<Key> sorted =
            launch_sorted<Key>(launcher, arena, source, n, counts, tree.order, mark);
        if (n == 0) return;
        launch_copies(launcher, source, sorted.count, n, tree.order, copies);
        mark("layout");

        const TreeScratch scratch(arena, n, options);
        const BoxOfLeaf<Copy> leaf_box{copies};
        const TreeRun<Key> tree_run{sorted.keys,
                                    n,
                                    sorted.count,
                                    options,
                                    {tree.nodes, scratch.parent_slot, &counts->inner_count},
                                    &counts->max_depth};
        launch_hierarchy(launcher, tree_run, scratch, arena, leaf_box);
        mark("hierarchy");

        launch_fit(launcher, tree_run, scratch, leaf_box);
        mark("fit");
    }

    /// Clusters come in Morton order and leave in another: leaf copies are made last.
    template <class Launcher, class Mark>
    void run_hploc(Launcher& launcher, Arena& arena, DeviceCounts* counts, const Mark& mark) const {
        auto* ids = arena.take<std::uint32_t>(n);
        const SortedPrimitives<Key> sorted =
            launch_sorted<Key>(launcher, arena, source, n, counts, ids, mark);
        if (n == 0) return;
        auto* boxes = arena.take<Aabb>(n);
        auto* clusters = arena.take<ClusterNode>(n);
        const HplocScratch scratch(arena, n);
        const PlaceScratch places(arena, n);
        const auto max_leaf = static_cast<std::uint32_t>(options.max_leaf);
        launcher.launch_counted("layout.boxes", sorted.count, n,
                                BoxInOrder<Source>{source, ids, boxes});
        launch_hploc(launcher,
                     HplocArrays<Key, BoxArray>{{sorted.keys, n},
                                                ids,
                                                {boxes},
                                                max_leaf,
                                                scratch.lists,
                                                scratch.meeting,
                                                clusters,
                                                scratch.root},
                     sorted.count, n);
        mark("hierarchy");

        launch_placing(launcher,
                       ClusterPlacing<BoxArray>{clusters,
                                                scratch.root,
                                                sorted.count,
                                                ids,
                                                {boxes},
                                                max_leaf,
                                                places.even,
                                                places.odd,
                                                places.rounds,
                                                tree.nodes,
                                                tree.order,
                                                &counts->inner_count,
                                                &counts->max_depth},
                       n);
        mark("fit");

        launch_copies(launcher, source, sorted.count, n, tree.order, copies);
        mark("layout");
    }
};

/// Calls `visit` with the DeviceBuild for these options and this input.
template <class Visit>
void with_device_build(const DeviceMesh& mesh, const BuildOptions& options, const DeviceTree& tree,
                       const Visit& visit) {
    with_source(mesh, tree, [&](const auto& source, std::uint32_t n, auto* copies) {
        using Source = std::decay_t<decltype(source)>;
        using Copy = std::remove_pointer_t<decltype(copies)>;
        check_device_options(options, n);
        if (options.bits == 30)
            visit(DeviceBuild<std::uint32_t, Source, Copy>{source, n, options, tree, copies});
        else
            visit(DeviceBuild<std::uint64_t, Source, Copy>{source, n, options, tree, copies});
    });
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

/// The build as gpu/device_run.h takes it.
template <class Input>
auto build_of(const Input& input, const BuildOptions& options, const DeviceTree& tree) {
    return [=](const auto& visit) { with_device_build(input, options, tree, visit); };
}

/// Bytes of scratch on a machine, whatever the primitives: they differ in their copies, which are
/// the caller's.
template <class Machine>
std::size_t bvh_scratch_bytes(std::uint32_t n, const BuildOptions& options) {
    DeviceTree tree;
    tree.pairs = reinterpret_cast<NodePair*>(Arena::alignment);  // the larger case
    return scratch_size<Machine>(build_of(DeviceBoxList{nullptr, n}, options, tree)).all;
}

}  // namespace raydix
