// Primitives -> the box around all valid ones and how many are not. primitives [n] -> one Bounds.
#pragma once

#include <algorithm>
#include <mutex>

#include "exec/parallel.h"
#include "primitives/host_box.h"

namespace raydix {

struct Bounds {
    Aabb box = empty_box();
    std::uint64_t left_out = 0;
    std::uint64_t flat = 0;                       // valid triangles without area, if somebody tells
    std::uint32_t first_left_out = no_primitive;  // the lowest id among them
    std::uint32_t first_unreadable =
        no_primitive;  // the lowest id that refers to a vertex that is not there

    void merge(const Bounds& other) {
        box = unite(box, other.box);
        left_out += other.left_out;
        flat += other.flat;
        first_left_out = std::min(first_left_out, other.first_left_out);
        first_unreadable = std::min(first_unreadable, other.first_unreadable);
    }
};

/// Nobody wants to see the boxes.
struct NoVisitor {
    static bool valid(std::uint32_t, const Box3&) { return false; }
    static void left_out(std::uint32_t) {}
};

/// Tells `visitor` of each primitive, on any thread: of a valid one, of which it returns whether it
/// is flat, or that it is left out. Minima and maxima do not depend on the order, so neither does
/// the result.
template <class Source, class Visitor = NoVisitor>
Bounds scene_bounds(const Source& source, std::uint32_t n, const Visitor& visitor = {}) {
    Bounds all;
    std::mutex merging;
    for_each_range(n, 16384, [&](std::size_t begin, std::size_t end) {
        Bounds part;
        Box3 around = Box3::load(part.box);
        for (std::size_t k = begin; k < end; ++k) {
            const auto i = static_cast<std::uint32_t>(k);
            Box3 box;
            if (!source.readable(i)) {
                part.first_unreadable = std::min(part.first_unreadable, i);
            } else if (host_box(source, i, box)) {
                around = unite(around, box);
                part.flat += visitor.valid(i, box) ? 1 : 0;
            } else {
                visitor.left_out(i);
                ++part.left_out;
                part.first_left_out = std::min(part.first_left_out, i);
            }
        }
        part.box = around.box();
        const std::scoped_lock lock(merging);
        all.merge(part);
    });
    return all;
}

}  // namespace raydix
