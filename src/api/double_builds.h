// What builds in double over triangles and over boxes share: boxes in double -> bounds -> center ->
// float boxes around it. Source: TriangleSourceD or BoxSourceD; Access: the way into the tree, with
// `local(box)`, the float box where its nodes are.
#pragma once

#include <raydix/buffer.h>
#include <raydix/error.h>
#include <raydix/refit.h>
#include <raydix/types.h>

#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include "exec/parallel.h"
#include "exec/search.h"
#include "primitives/double_sources.h"
#include "tree/median_center.h"

namespace raydix {

struct BoundsD {
    AabbD box{{infinity, infinity, infinity}, {-infinity, -infinity, -infinity}};
    std::uint64_t left_out = 0;
    std::uint32_t first_left_out = no_primitive;
    std::uint32_t first_unreadable = no_primitive;

    void add(const BoundsD& other) {
        box = {min_of(box.lo, other.box.lo), max_of(box.hi, other.box.hi)};
        left_out += other.left_out;
        first_left_out = std::min(first_left_out, other.first_left_out);
        first_unreadable = std::min(first_unreadable, other.first_unreadable);
    }
};

template <class Source>
BoundsD bounds_of_range(const Source& source, std::size_t begin, std::size_t end) {
    BoundsD sum;
    for (std::size_t at = begin; at < end; ++at) {
        const auto i = static_cast<std::uint32_t>(at);
        AabbD box;
        if (!source.readable(i)) {
            sum.first_unreadable = std::min(sum.first_unreadable, i);
        } else if (source.box(i, box)) {
            sum.box = {min_of(sum.box.lo, box.lo), max_of(sum.box.hi, box.hi)};
        } else {
            ++sum.left_out;
            sum.first_left_out = std::min(sum.first_left_out, i);
        }
    }
    return sum;
}

template <class Source>
BoundsD bounds_of(const Source& source, std::size_t n) {
    constexpr std::size_t block_size = 4096;
    std::vector<BoundsD> parts((n + block_size - 1) / block_size);
    for_each_block(n, block_size, [&](std::size_t block, std::size_t begin, std::size_t end) {
        parts[block] = bounds_of_range(source, begin, end);
    });
    BoundsD sum;
    for (const BoundsD& part : parts) sum.add(part);
    return sum;
}

template <class Source>
Vec3d center_of(const Source& source, std::size_t n, const AabbD& bounds) {
    return median_center(
        n,
        [&](std::size_t i, AabbD& box) { return source.box(static_cast<std::uint32_t>(i), box); },
        bounds);
}

/// Into `boxes`. Primitives that are left out get a box that float builders leave out.
template <class Source, class Access>
std::span<const Aabb> local_boxes(const Source& source, std::size_t n, const Access& tree,
                                  Buffer<Aabb>& boxes) {
    boxes.reset(n);
    for_each_index(n, [&](std::size_t i) {
        AabbD box;
        const bool valid = source.box(static_cast<std::uint32_t>(i), box);
        boxes[i] = valid ? tree.local(box) : empty_box();
    });
    return boxes.view();
}

inline void require_size(std::size_t n) {
    if (n >= std::size_t{1} << 31)
        throw InputError(std::to_string(n) + " primitives; a tree takes fewer than 2147483648");
}

template <class Tree>
void require_same_count(const Tree& bvh, std::size_t n, const std::string& kinds) {
    if (n != bvh.input_count())
        throw InputError("refit: " + std::to_string(n) + ' ' + kinds +
                         ", but the tree was built from " + std::to_string(bvh.input_count()));
}

/// Each primitive of the tree is still valid, and no other one is: what the float tree over boxes
/// would find too, but could not name.
template <class Tree, class Source>
void require_same_valid(const Tree& bvh, const Source& source, std::uint64_t left_out,
                        const std::string& kind) {
    if (left_out == 0 && bvh.left_out() == 0) return;
    const auto valid = [&](std::uint32_t i) {
        AabbD box;
        return source.box(i, box);
    };
    const std::size_t n = bvh.order().size();
    const std::size_t bad =
        first_index_where(n, [&](std::size_t k) { return !valid(bvh.order()[k]); });
    if (bad != n) {
        std::uint32_t first = bvh.order()[bad];
        for (const std::uint32_t i : bvh.order())
            if (i < first && !valid(i)) first = i;
        throw InputError("refit: " + kind + ' ' + std::to_string(first) +
                         " is not finite or out of range now");
    }
    if (left_out != bvh.left_out())
        throw InputError("refit: " + std::to_string(bvh.left_out() - left_out) + ' ' + kind +
                         "(s) were left out when the tree was built, but are valid now");
}

/// The hierarchy kept, boxes around the center that the primitives have now. `bounds` are theirs.
/// On an error the tree is as it was.
template <class Access, class Tree, class Source>
RefitQuality refit_around_center(Tree& bvh, const Source& source, const BoundsD& bounds,
                                 const std::string& kind, int threads) {
    const std::size_t n = bvh.input_count();
    Tree moved;
    const Access to{moved}, tree{bvh};
    const Vec3d center = center_of(source, n, bounds.box);
    to.place(bounds.box, center);
    require_same_valid(bvh, source, bounds.left_out, kind);
    Buffer<Aabb> boxes;
    const RefitQuality quality = refit(tree.tree(), local_boxes(source, n, to, boxes), threads);
    tree.place(bounds.box, center);
    return quality;
}

}  // namespace raydix
