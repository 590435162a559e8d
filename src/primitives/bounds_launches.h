// Primitives -> the box around all valid ones and how many are not, as launches for any backend:
// what scene_bounds (bounds.h) does in one loop. primitives [n] -> 8192 parts at most -> 64 -> one,
// a warp for each.
#pragma once

#include <raydix/types.h>

#include <algorithm>
#include <cstdint>

#include "base/hd.h"
#include "base/math.h"
#include "exec/arena.h"
#include "exec/warp.h"
#include "exec/warp_boxes.h"
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

/// Parts of 32 lanes -> one part that every lane has.
template <class Warp>
struct WarpBounds {
    template <class T>
    using Var = typename Warp::template Var<T>;

    WarpBoxes<Warp> boxes;
    Var<std::uint32_t> valid, left_out, first_left_out, unreadable, first_unreadable;

    RAYDIX_HD BoundsPart get(std::uint32_t lane) const {
        return {boxes.get(lane),      valid[lane],      left_out[lane],
                first_left_out[lane], unreadable[lane], first_unreadable[lane]};
    }
    RAYDIX_HD void set(std::uint32_t lane, const BoundsPart& part) {
        boxes.set(lane, part.box);
        valid[lane] = part.valid;
        left_out[lane] = part.left_out;
        first_left_out[lane] = part.first_left_out;
        unreadable[lane] = part.unreadable;
        first_unreadable[lane] = part.first_unreadable;
    }
    RAYDIX_HD void merge(const Warp& warp) {
        for (std::uint32_t step = warp_lanes / 2; step != 0; step /= 2) {
            const auto partner = [&](std::uint32_t lane) { return lane ^ step; };
            WarpBounds other;
            other.boxes = boxes.taken_from(warp, partner);
            other.valid = warp.shuffle(valid, partner);
            other.left_out = warp.shuffle(left_out, partner);
            other.first_left_out = warp.shuffle(first_left_out, partner);
            other.unreadable = warp.shuffle(unreadable, partner);
            other.first_unreadable = warp.shuffle(first_unreadable, partner);
            warp.each([&](std::uint32_t lane) {
                BoundsPart part = get(lane);
                part.merge(other.get(lane));
                set(lane, part);
            });
        }
    }
};

/// Writes the part that `part_of(place)` makes for each place of tile t.
template <class Warp, class PartOf>
RAYDIX_HD void write_part(const Warp& warp, std::uint32_t t, BoundsPart* parts,
                          const PartOf& part_of) {
    WarpBounds<Warp> lanes;
    warp.each([&](std::uint32_t lane) { lanes.set(lane, part_of(t * warp_lanes + lane)); });
    lanes.merge(warp);
    warp.each([&](std::uint32_t lane) {
        if (lane == 0) parts[t] = lanes.get(lane);
    });
}

/// A lane takes primitives k, k + 32 tiles, ...: neighbouring lanes read neighbours.
template <class Source>
struct BoundPrimitives {
    Source source;
    std::uint32_t n, tiles;
    BoundsPart* parts;  // [tiles], out

    template <class Warp>
    RAYDIX_HD void operator()(const Warp& warp, std::uint32_t t) const {
        write_part(warp, t, parts, [&](std::uint32_t place) {
            BoundsPart part = BoundsPart::empty();
            for (std::uint64_t k = place; k < n; k += tiles * warp_lanes)
                add(part, static_cast<std::uint32_t>(k));
            return part;
        });
    }
    RAYDIX_HD void add(BoundsPart& part, std::uint32_t i) const {
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
};

struct MergeParts {
    const BoundsPart* in;  // [in_count]
    std::uint32_t in_count, tiles;
    BoundsPart* out;  // [tiles]

    template <class Warp>
    RAYDIX_HD void operator()(const Warp& warp, std::uint32_t t) const {
        write_part(warp, t, out, [&](std::uint32_t place) {
            BoundsPart part = BoundsPart::empty();
            for (std::uint32_t k = place; k < in_count; k += tiles * warp_lanes) part.merge(in[k]);
            return part;
        });
    }
};

struct BoundsScratch {
    /// Tiles of the first launch: as many threads as a GPU of today has in flight.
    static constexpr std::uint32_t first_parts = 8192, second_parts = 64;
    BoundsPart *first, *second;
    explicit BoundsScratch(Arena& arena)
        : first(arena.take<BoundsPart>(first_parts)),
          second(arena.take<BoundsPart>(second_parts)) {}
};

/// `bounds` [1], in the launcher's memory.
template <class Launcher, class Source>
void launch_bounds(Launcher& launcher, const Source& source, std::uint32_t n,
                   const BoundsScratch& scratch, BoundsPart* bounds) {
    const std::uint32_t first = std::clamp(warps_for(n), 1u, BoundsScratch::first_parts);
    const std::uint32_t second = std::min(warps_for(first), BoundsScratch::second_parts);
    launcher.launch_tiles("bounds.primitives", first,
                          BoundPrimitives<Source>{source, n, first, scratch.first});
    launcher.launch_tiles("bounds.parts", second,
                          MergeParts{scratch.first, first, second, scratch.second});
    launcher.launch_tiles("bounds.all", 1, MergeParts{scratch.second, second, 1, bounds});
}

}  // namespace raydix
