// Closest points of a mesh and overlapping pairs over trees in which each primitive is in one leaf,
// as work of one thread: a query, or a primitive against a whole tree. The answers are those of
// closest.h and pairs.h.
#pragma once

#include <raydix/closest.h>
#include <raydix/pairs.h>

#include <cmath>
#include <cstdint>

#include "base/atomic.h"
#include "base/distance.h"
#include "base/heap_row.h"
#include "primitives/exact_overlap.h"
#include "proximity/closest_walk.h"

namespace raydix {

/// Radix trees are at most 94 levels deep: 63 bits of code and 31 of the position. Deeper ones,
/// which only clusters make, are refused.
inline constexpr int device_walk_depth = 96;

struct FindClosest {
    TriangleTree tree;
    const Vec3* queries;     // [n]
    float limit;             // of d2
    ClosestPoint* results;   // [n], out
    std::uint32_t* invalid;  // null, or [1]: queries that are not finite are added
    RAYDIX_HD void operator()(std::uint32_t i) const {
        const Vec3 query = queries[i];
        ClosestPoint result;
        if (!is_finite(query)) {
            if (invalid != nullptr) claim(*invalid, 1);
        } else if (!tree.empty) {
            LocalWalkStack<device_walk_depth> stack;
            const ClosestTriangle best = find_closest_triangle(tree, DeviceBoxDistances{query},
                                                               query, limit, no_primitive, stack);
            if (best.prim != no_primitive)
                result = {best.point.position, std::sqrt(best.point.d2), best.prim, best.point.u,
                          best.point.v};
        }
        results[i] = result;
    }
};

/// A tree as pairs are found in it.
struct PairSet {
    const BvhNode* nodes = nullptr;
    const std::uint32_t* order = nullptr;     // [references]
    const LeafTriangle* triangles = nullptr;  // one of the three, [references]
    const Aabb* boxes = nullptr;
    const Vec3* points = nullptr;
    std::uint32_t references = 0;

    [[nodiscard]] RAYDIX_HD Aabb box(std::uint32_t position) const {
        if (triangles != nullptr) {
            const LeafTriangle& t = triangles[position];
            return box_of(t.v0, t.v1, t.v2);
        }
        return boxes != nullptr ? boxes[position] : Aabb{points[position], points[position]};
    }
};

/// All partners of the primitive at one position of `a`. `same`: b is a, and partners have a higher
/// id, so that each pair is met once.
template <bool same, bool narrow>
struct PartnerWalk {
    PairSet a, b;

    /// partner(id) for each, in the order of b's tree.
    template <class Partner>
    RAYDIX_HD void operator()(std::uint32_t position, const Partner& partner) const {
        const Aabb box = a.box(position);
        const std::uint32_t id = a.order[position];
        std::uint32_t stack[device_walk_depth];
        int top = 0;
        std::uint32_t slot = 0;
        for (;;) {
            const BvhNode& node = b.nodes[slot];
            if (node.is_leaf()) {
                for (std::uint32_t k = node.first; k < node.first + node.count; ++k)
                    if (is_pair(position, id, box, k)) partner(b.order[k]);
            } else {
                const std::uint32_t first = node.first;
                const NodeBoxes children = load_boxes(&b.nodes[first]);
                const bool meets_a = boxes_touch(box, children.a),
                           meets_b = boxes_touch(box, children.b);
                if (meets_a && meets_b) {
                    RAYDIX_CHECK(top, <, device_walk_depth);
                    stack[top++] = first + 1;
                }
                if (meets_a || meets_b) {
                    slot = first + (meets_a ? 0u : 1u);
                    continue;
                }
            }
            if (top == 0) return;
            slot = stack[--top];
        }
    }

private:
    [[nodiscard]] RAYDIX_HD bool is_pair(std::uint32_t position, std::uint32_t id, const Aabb& box,
                                         std::uint32_t k) const {
        if (same && b.order[k] <= id) return false;
        if (!boxes_touch(box, b.box(k))) return false;
        if (same && a.triangles != nullptr && share_a_corner(a.triangles[position], b.triangles[k]))
            return false;
        return !narrow || triangles_touch(a.triangles[position], b.triangles[k]);
    }
};

struct ClearOffset {
    std::uint64_t* offsets;  // out
    RAYDIX_HD void operator()(std::uint32_t i) const { offsets[i] = 0; }
};

/// Rows by the id of the first; those of primitives that are not in the tree keep their 0.
template <bool same, bool narrow>
struct CountPartners {
    PartnerWalk<same, narrow> walk;
    std::uint64_t* offsets;  // [ids + 1], in and out
    RAYDIX_HD void operator()(std::uint32_t position) const {
        std::uint64_t count = 0;
        walk(position, [&](std::uint32_t) { ++count; });
        offsets[walk.a.order[position]] = count;
    }
};

/// Pairs of one row, by the second.
struct PairRow {
    PrimitivePair* pairs;

    [[nodiscard]] RAYDIX_HD bool before(std::uint32_t a, std::uint32_t b) const {
        return pairs[a].second < pairs[b].second;
    }
    RAYDIX_HD void swap(std::uint32_t a, std::uint32_t b) const {
        const std::uint32_t second = pairs[a].second;
        pairs[a].second = pairs[b].second;
        pairs[b].second = second;
    }
};

/// Writes what CountPartners counted. A row that would reach past the room stays as it is.
template <bool same, bool narrow>
struct FillPartners {
    PartnerWalk<same, narrow> walk;
    const std::uint64_t* offsets;  // [ids + 1]
    std::uint64_t room;
    PrimitivePair* pairs;  // [room], out
    RAYDIX_HD void operator()(std::uint32_t position) const {
        const std::uint32_t id = walk.a.order[position];
        const std::uint64_t begin = offsets[id], end = offsets[id + 1];
        if (begin >= end || end > room) return;
        const auto length = static_cast<std::uint32_t>(end - begin);
        const PairRow row{pairs + begin};
        std::uint32_t found = 0;
        walk(position, [&](std::uint32_t partner) {
            if (found < length) row.pairs[found++] = {id, partner};
        });
        heap_sort(row, found);
    }
};

}  // namespace raydix
