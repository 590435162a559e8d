// The builders whose trees are cluster trees at first: sorted order -> clusters -> nodes -> leaf
// copies. Bounds, codes and sort are those of build_bvh.cpp.
#pragma once

#include <type_traits>
#include <utility>

#include "build/bvh_builder_internals.h"
#include "exec/progress.h"
#include "layout/leaf_order.h"
#include "measure/stopwatch.h"
#include "primitives/host_box.h"
#include "primitives/zero_area.h"
#include "tree/binned.h"
#include "tree/build_hploc.h"
#include "tree/bvh_internals.h"
#include "tree/place_clusters.h"
#include "tree/ploc.h"
#include "tree/reinsert_top.h"

namespace raydix {

struct ClusterScratch {
    Buffer<std::uint32_t> ids;  // [n] in Morton order
    PlocScratch ploc;
    Buffer<std::byte> hploc;
    BinnedScratch binned;
    Buffer<std::uint8_t> flat;  // [n] in Morton order: triangles without area

    [[nodiscard]] std::size_t capacity_bytes() const {
        return ids.capacity_bytes() + flat.capacity_bytes() + ploc.capacity_bytes() +
               hploc.capacity_bytes() + binned.capacity_bytes();
    }
};

/// `keys`: the sorted codes of the valid primitives, at least one; they may lie in the memory of
/// `copies`. tree.order() holds their ids, in Morton order; on return all arrays of the tree are
/// complete, and ms.hierarchy, ms.fit and ms.layout are written. With `take` (triangles only), it
/// gets the clusters, and the arrays of the tree stay empty.
template <class Key, class Source, class Copy>
void build_clusters(const Source& source, std::span<const Key> keys, ClusterScratch& scratch,
                    TopScratch& top_scratch, const TakeClusters* take, const BvhInternals& tree,
                    Buffer<Copy>& copies, BuildMs& ms) {
    Stopwatch stage;
    std::swap(scratch.ids, tree.order());
    const std::span<const std::uint32_t> ids = scratch.ids.view();
    BoxLanes& boxes = scratch.ploc.primitives;
    boxes.reset(static_cast<std::uint32_t>(ids.size()));
    constexpr bool triangles = std::is_same_v<Source, TriangleSource>;
    const bool mark_flat = triangles && take != nullptr;
    if (mark_flat) scratch.flat.reset(ids.size());
    for_each_range(ids.size(), 4096, [&](std::size_t begin, std::size_t end) {
        constexpr std::size_t indices_ahead = 32, corners_ahead = 16;
        for (std::size_t k = begin; k < end; ++k) {
            if (k + indices_ahead < end) {
                prefetch_indices(source, ids[k + indices_ahead]);
                prefetch_corners(source, ids[k + corners_ahead]);
            }
            Box3 box;
            host_box(source, ids[k], box);
            boxes.set(static_cast<std::uint32_t>(k), box.box());
            if constexpr (triangles)
                if (mark_flat)
                    scratch.flat[k] = has_zero_area(copy_primitive(source, ids[k])) ? 1 : 0;
        }
    });
    progress_at(0.1);
    const auto max_leaf = static_cast<std::uint32_t>(tree.options().max_leaf);
    Buffer<ClusterNode>& nodes = scratch.ploc.nodes;
    ClusterRef root = [&] {
        const ProgressStage growing(0.1, 0.55);
        switch (tree.options().builder) {
            case Builder::hploc:
                return build_hploc(keys, ids, static_cast<std::uint32_t>(tree.input_count()), boxes,
                                   max_leaf, nodes, scratch.hploc);
            case Builder::binned:
                return build_binned(keys, ids, boxes, max_leaf, nodes, scratch.binned);
            default:
                // The keys have done their work, and leaf copies are written last.
                return build_ploc(ids, max_leaf, scratch.ploc,
                                  std::as_writable_bytes(copies.span()));
        }
    }();
    progress_at(0.55);
    if (const int rounds = tree.options().reinsertion_rounds; rounds > 0) {
        const ProgressStage reinsertion(0.55, 0.65);
        root = reinsert_clusters({nodes.data(), root, boxes, ids}, nodes.data(), max_leaf,
                                 top_options(rounds), top_scratch);
    }
    ms.hierarchy = stage.lap();
    const ProgressStage rest(0.65, 1);
    progress_at(0);

    const ClusterTree clusters{scratch.ploc.nodes.data(), root, boxes, ids};
    if constexpr (triangles)
        if (take != nullptr) {
            (*take)(clusters, source, scratch.flat.data());
            ms.fit = stage.lap();
            tree.make_empty();
            return;
        }
    tree.inner_count() = place_clusters(clusters, tree.nodes(), tree.order(), tree.max_depth());
    ms.fit = stage.lap();
    progress_at(0.5);
    copy_to_leaf_order(source, tree.order().view(), copies);
    ms.layout = stage.lap();
}

}  // namespace raydix
