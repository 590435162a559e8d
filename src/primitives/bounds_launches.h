// Primitives -> the box around all valid ones and how many are not, as launches for any backend:
// what scene_bounds (bounds.h) does in one loop. primitives [n] -> 65536 parts at most -> 256 ->
// one.
#pragma once

#include <raydix/types.h>

#include <algorithm>
#include <cstdint>

#include "base/hd.h"
#include "base/math.h"
#include "exec/arena.h"
#include "primitives/sources.h"

namespace raydix {

/// Bounds of some of the primitives. Merging does not depend on the order.
struct BoundsPart {
    Aabb box;
    std::uint32_t valid, left_out, first_left_out, unreadable, first_unreadable;

    RAYDIX_HD static BoundsPart empty() {
        return {empty_box(), 0, 0, no_primitive, 0, no_primitive};
    }
    RAYDIX_HD void add_left_out(std::uint32_t i) {
        ++left_out;
        first_left_out = first_left_out < i ? first_left_out : i;
    }
    RAYDIX_HD void add_unreadable(std::uint32_t i) {
        ++unreadable;
        first_unreadable = first_unreadable < i ? first_unreadable : i;
    }
    RAYDIX_HD void merge(const BoundsPart& o) {
        box = unite(box, o.box);
        valid += o.valid;
        left_out += o.left_out;
        unreadable += o.unreadable;
        first_left_out = first_left_out < o.first_left_out ? first_left_out : o.first_left_out;
        first_unreadable =
            first_unreadable < o.first_unreadable ? first_unreadable : o.first_unreadable;
    }
};

/// Part p is made of primitives p, p + part_count, ...: neighbouring threads read neighbours.
template <class Source>
struct BoundPrimitives {
    Source source;
    std::uint32_t n, part_count;
    BoundsPart* parts;  // [part_count], out

    RAYDIX_HD void operator()(std::uint32_t p) const {
        BoundsPart part = BoundsPart::empty();
        for (std::uint64_t k = p; k < n; k += part_count) {
            const auto i = static_cast<std::uint32_t>(k);
            Aabb box;
            if (!source.readable(i)) {
                part.add_unreadable(i);
            } else if (source.box(i, box)) {
                part.box = unite(part.box, box);
                ++part.valid;
            } else {
                part.add_left_out(i);
            }
        }
        parts[p] = part;
    }
};

struct MergeParts {
    const BoundsPart* in;  // [in_count]
    std::uint32_t in_count, out_count;
    BoundsPart* out;  // [out_count]

    RAYDIX_HD void operator()(std::uint32_t p) const {
        BoundsPart part = BoundsPart::empty();
        for (std::uint32_t k = p; k < in_count; k += out_count) part.merge(in[k]);
        out[p] = part;
    }
};

struct BoundsScratch {
    static constexpr std::uint32_t first_parts = 65536, second_parts = 256;
    BoundsPart *first, *second;
    explicit BoundsScratch(Arena& arena)
        : first(arena.take<BoundsPart>(first_parts)),
          second(arena.take<BoundsPart>(second_parts)) {}
};

/// `bounds` [1], in the launcher's memory.
template <class Launcher, class Source>
void launch_bounds(Launcher& launcher, const Source& source, std::uint32_t n,
                   const BoundsScratch& scratch, BoundsPart* bounds) {
    const std::uint32_t first = std::min(n, BoundsScratch::first_parts);
    const std::uint32_t second = std::min(first, BoundsScratch::second_parts);
    launcher.launch("bounds.primitives", first,
                    BoundPrimitives<Source>{source, n, first, scratch.first});
    launcher.launch("bounds.parts", second,
                    MergeParts{scratch.first, first, second, scratch.second});
    launcher.launch("bounds.all", 1, MergeParts{scratch.second, second, 1, bounds});
}

}  // namespace raydix
