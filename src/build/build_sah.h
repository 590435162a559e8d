// The builders that look at all cuts of three sorted lists: primitives -> references, in parts or
// whole -> three orders -> tree -> leaf copies.
#pragma once

#include <algorithm>
#include <bit>
#include <numeric>
#include <optional>
#include <vector>

#include "exec/progress.h"
#include "layout/leaf_order.h"
#include "measure/stopwatch.h"
#include "primitives/host_box.h"
#include "sort/radix_sort.h"
#include "tree/bvh_internals.h"
#include "tree/early_splits.h"
#include "tree/reinsert_top.h"
#include "tree/sah_build.h"
#include "tree/sbvh_build.h"

namespace raydix {

[[nodiscard]] constexpr bool sweeps(Builder builder) {
    return builder == Builder::sweep || builder == Builder::split || builder == Builder::sbvh;
}

struct SweepScratch {
    SahScratch sah;
    SbvhScratch sbvh;
    Buffer<SahReference> spare;
    Buffer<std::uint32_t> keys;
    SortScratch<std::uint32_t> sort;

    [[nodiscard]] std::size_t capacity_bytes() const {
        return sah.capacity_bytes() + sbvh.capacity_bytes() + spare.capacity_bytes() +
               keys.capacity_bytes() + sort.records.capacity_bytes() + sort.spare.capacity_bytes() +
               sort.histogram.capacity_bytes();
    }
};

inline void set_reference(SahReference& reference, const Aabb& box, std::uint32_t id) {
    reference = make_reference(box, id);
}
inline void set_reference(SplitBox& reference, const Aabb& box, std::uint32_t id) {
    reference = SplitBox::of(box, id, 1);
}

/// One reference for each primitive that is not left out, ascending by id.
/// `references` gets room for `spare` more.
template <class Source, class Reference>
void make_references(const Source& source, std::uint32_t n, std::uint32_t valid,
                     std::uint32_t spare, Buffer<Reference>& references) {
    constexpr std::size_t block = 4096;
    std::vector<std::uint32_t> before((n + block - 1) / block);
    if (valid != n) {
        for_each_block(n, block, [&](std::size_t b, std::size_t begin, std::size_t end) {
            Box3 box;
            for (std::size_t i = begin; i < end; ++i)
                before[b] += host_box(source, static_cast<std::uint32_t>(i), box) ? 1 : 0;
        });
        std::exclusive_scan(before.begin(), before.end(), before.begin(), 0u);
    } else {
        for (std::size_t b = 0; b < before.size(); ++b)
            before[b] = static_cast<std::uint32_t>(b * block);
    }
    references.reset(std::size_t{valid} + spare);
    for_each_block(n, block, [&](std::size_t b, std::size_t begin, std::size_t end) {
        Reference* out = references.data() + before[b];
        Box3 box;
        for (std::size_t i = begin; i < end; ++i)
            if (const auto id = static_cast<std::uint32_t>(i); host_box(source, id, box))
                set_reference(*out++, box.box(), id);
    });
}

/// Bits that ascend as the numbers do.
inline std::uint32_t ascending_bits(float x) {
    const auto bits = std::bit_cast<std::uint32_t>(x);
    return (bits >> 31) != 0 ? ~bits : bits | 0x80000000u;
}

/// By the centroid's coordinate, of equals by place.
inline void sort_references(std::uint32_t n, SweepScratch& scratch) {
    const SahReference* references = scratch.sah.references.data();
    scratch.keys.reset(n);
    for (std::size_t axis = 0; axis < 3; ++axis) {
        for_each_index(n, [&](std::size_t k) {
            const SahReference& r = references[k];
            scratch.keys[k] = ascending_bits((&r.lo.x)[axis] + (&r.hi.x)[axis]);
        });
        scratch.sah.orders[axis].reset(scratch.sah.references.size());
        sort_keys(scratch.keys.span(), scratch.sah.orders[axis].span().first(n), 32, scratch.sort);
    }
}

inline void sort_and_build(const SahInput& input, SweepScratch& scratch, const BvhInternals& tree,
                           BuildMs& ms, Stopwatch& stage) {
    ms.codes = stage.lap();
    sort_references(input.references, scratch);
    ms.sort = stage.lap();
    progress_at(0.3);
    tree.inner_count() =
        build_sah(input, scratch.sah, tree.nodes(), tree.order(), tree.max_depth());
    ms.hierarchy = stage.lap();
}

/// What can be cut: triangles, and `around`, those that boxes are around, if any.
inline std::optional<TriangleCorners> corners_of(const TriangleSource& source, std::uint32_t n,
                                                 const TriangleCorners*) {
    return MeshView{{source.vertices, source.vertex_count}, {source.triangles, n}};
}
inline std::optional<TriangleCorners> corners_of(const BoxSource&, std::uint32_t,
                                                 const TriangleCorners* around) {
    if (around == nullptr) return {};
    return *around;
}
inline std::optional<TriangleCorners> corners_of(const PointSource&, std::uint32_t,
                                                 const TriangleCorners*) {
    return {};
}

/// Of `n` primitives `valid` > 0 are not left out. On return all arrays of the tree are complete.
template <class Source, class Copy>
void build_by_sweeps(const Source& source, std::uint32_t n, std::uint32_t valid, const Aabb& scene,
                     const TriangleCorners* around, SweepScratch& scratch, TopScratch& top_scratch,
                     const BvhInternals& tree, Buffer<Copy>& copies, BuildMs& ms) {
    Stopwatch stage;
    const Builder builder = tree.options().builder;
    const auto max_leaf = static_cast<std::uint32_t>(tree.options().max_leaf);
    SahInput input{valid, max_leaf};
    const std::optional<TriangleCorners> corners = corners_of(source, n, around);
    if (builder == Builder::sbvh && corners) {
        const ReferenceCutter cutter(*corners);
        const SbvhInput cut_input{cutter, valid, max_leaf};
        make_references(source, n, valid, spatial_spare(valid, cut_input.options),
                        scratch.sbvh.references);
        ms.codes = stage.lap();
        const ProgressStage cutting(0.02, 0.85);
        progress_at(0);
        tree.inner_count() =
            build_sbvh(cut_input, scratch.sbvh, tree.nodes(), tree.order(), tree.max_depth());
        ms.hierarchy = stage.lap();
    } else {
        make_references(source, n, valid, 0, scratch.sah.references);
        if (builder == Builder::split && corners) {
            split_early(*corners, scene, {}, scratch.sah.references, scratch.spare);
            input.references = static_cast<std::uint32_t>(scratch.sah.references.size());
        }
        sort_and_build(input, scratch, tree, ms, stage);
    }
    progress_at(0.85);
    if (const int rounds = tree.options().reinsertion_rounds; rounds > 0) {
        const ProgressStage reinsertion(0.85, 0.95);
        reinsert_finished(tree.nodes(), tree.order(), tree.max_depth(), top_options(rounds),
                          top_scratch);
        ms.hierarchy += stage.lap();
        progress_at(1);
    }
    copy_to_leaf_order(source, tree.order().view(), copies);
    ms.layout = stage.lap();
}

}  // namespace raydix
