// The builders that look at all cuts of three sorted lists: primitives -> references, in parts or
// whole -> three orders -> tree -> leaf copies.
#pragma once

#include <bit>
#include <numeric>
#include <type_traits>
#include <vector>

#include "layout/leaf_order.h"
#include "measure/stopwatch.h"
#include "primitives/host_box.h"
#include "sort/radix_sort.h"
#include "tree/bvh_access.h"
#include "tree/early_splits.h"
#include "tree/sah_build.h"

namespace raydix {

[[nodiscard]] constexpr bool sweeps(Builder builder) {
    return builder == Builder::sweep || builder == Builder::split || builder == Builder::sbvh;
}

struct SweepScratch {
    SahScratch sah;
    Buffer<SahReference> spare;
    Buffer<std::uint32_t> keys;
    SortScratch<std::uint32_t> sort;

    [[nodiscard]] std::size_t capacity_bytes() const {
        return sah.capacity_bytes() + spare.capacity_bytes() + keys.capacity_bytes() +
               sort.records.capacity_bytes() + sort.spare.capacity_bytes() +
               sort.histogram.capacity_bytes();
    }
};

/// One reference for each primitive that is not left out, ascending by id.
template <class Source>
void make_references(const Source& source, std::uint32_t n, std::uint32_t valid,
                     Buffer<SahReference>& references) {
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
    references.reset(valid);
    for_each_block(n, block, [&](std::size_t b, std::size_t begin, std::size_t end) {
        SahReference* out = references.data() + before[b];
        Box3 box;
        for (std::size_t i = begin; i < end; ++i)
            if (const auto id = static_cast<std::uint32_t>(i); host_box(source, id, box))
                *out++ = make_reference(box.box(), id);
    });
}

/// Bits that ascend as the numbers do.
inline std::uint32_t ascending_bits(float x) {
    const auto bits = std::bit_cast<std::uint32_t>(x);
    return (bits >> 31) != 0 ? ~bits : bits | 0x80000000u;
}

/// By the centroid's coordinate, of equals by place.
inline void sort_references(SweepScratch& scratch) {
    const std::span<const SahReference> references = scratch.sah.references.view();
    for (std::size_t axis = 0; axis < 3; ++axis) {
        scratch.keys.reset(references.size());
        for_each_index(references.size(), [&](std::size_t k) {
            const SahReference& r = references[k];
            scratch.keys[k] = ascending_bits((&r.lo.x)[axis] + (&r.hi.x)[axis]);
        });
        scratch.sah.orders[axis].reset(references.size());
        sort_keys(scratch.keys.span(), scratch.sah.orders[axis].span(), 32, scratch.sort);
    }
}

/// Of `n` primitives `valid` > 0 are not left out. On return all arrays of the tree are complete.
template <class Source, class Copy>
void build_by_sweeps(const Source& source, std::uint32_t n, std::uint32_t valid, const Aabb& scene,
                     SweepScratch& scratch, const BvhAccess& tree, Buffer<Copy>& copies,
                     BuildMs& ms) {
    Stopwatch stage;
    make_references(source, n, valid, scratch.sah.references);
    if constexpr (std::is_same_v<Source, TriangleSource>) {
        if (tree.options().builder == Builder::split)
            split_early({{source.vertices, source.vertex_count}, {source.triangles, n}}, scene, {},
                        scratch.sah.references, scratch.spare);
    }
    ms.codes = stage.lap();
    sort_references(scratch);
    ms.sort = stage.lap();
    const auto max_leaf = static_cast<std::uint32_t>(tree.options().max_leaf);
    tree.inner_count() =
        build_sah(scratch.sah, max_leaf, tree.nodes(), tree.order(), tree.max_depth());
    ms.hierarchy = stage.lap();
    copy_to_leaf_order(source, tree.order().view(), copies);
    ms.layout = stage.lap();
}

}  // namespace raydix
