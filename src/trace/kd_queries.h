// Nearest points and points within a radius of one query in a k-d tree, as work of one thread:
// queries [n] -> rows in the caller's memory, with the bits of points.h.
#pragma once

#include <raydix/kdtree.h>

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "base/atomic.h"
#include "base/distance.h"
#include "base/heap_row.h"
#include "trace/kd_outward.h"

namespace raydix {

/// More than the depth of any k-d tree: 63 bits of code and 31 of the position (Karras 2012,
/// section 4: a level for each bit of the keys at most).
inline constexpr int kd_stack_entries = 96;

/// Queries of a launch.
struct PointQueries {
    KdTreeView tree;
    const Vec3* points;      // [references], in leaf order
    const Vec3* queries;     // [n]
    std::uint32_t* invalid;  // null, or [1]: queries that are not finite are added

    /// Query i if it may find something.
    [[nodiscard]] RAYDIX_HD bool take(std::uint32_t i, Vec3& query) const {
        query = queries[i];
        if (is_finite(query)) return !tree.empty;
        if (invalid != nullptr) claim(*invalid, 1);
        return false;
    }
    /// offer(d2, id) gets all points of leaves that may hold one before `worst()`.
    template <class Offer, class Worst>
    RAYDIX_HD void walk(Vec3 query, const Offer& offer, const Worst& worst) const {
        struct NoCounts {
        } none;
        KdDistancePart entries[kd_stack_entries];
        KdLocalStack stack(entries);
        const auto leaf = [&](const KdNode& node) {
            for (std::uint32_t k = node.first; k < node.first + node.count(); ++k)
                offer(squared_distance(points[k], query), tree.order[k]);
        };
        walk_kd_tree_outward(tree, query, stack, none, leaf, worst);
    }
};

struct FindNearest {
    PointQueries from;
    std::uint32_t k;
    std::uint32_t* indices;  // [n * k], out
    float* distances;        // [n * k], out
    RAYDIX_HD void operator()(std::uint32_t i) const {
        const std::size_t row = std::size_t{i} * k;
        HeapRow<float> nearest(k, indices + row, distances + row);
        Vec3 query;
        if (from.take(i, query))
            from.walk(
                query, [&](float d2, std::uint32_t id) { nearest.offer(d2, id); },
                [&] {
                    return KdNeighbor{nearest.worst_d2(), nearest.worst_id()};
                });
        nearest.finish(nullptr, nullptr);
    }
};

/// Rows are as long as there are points with d2 <= r2; the scan comes behind.
struct CountWithin {
    PointQueries from;
    std::uint32_t n;
    float r2;
    std::uint64_t* offsets;  // [n + 1], out: lengths, and 0
    RAYDIX_HD void operator()(std::uint32_t i) const {
        std::uint64_t count = 0;
        Vec3 query;
        if (i < n && from.take(i, query))
            from.walk(
                query, [&](float d2, std::uint32_t) { count += d2 <= r2; },
                [&] {
                    return KdNeighbor{r2, no_primitive};
                });
        offsets[i] = count;
    }
};

/// A row of points that were found.
struct FoundRow {
    std::uint32_t* ids;
    float* d2;
    bool by_distance;

    [[nodiscard]] RAYDIX_HD bool before(std::uint32_t a, std::uint32_t b) const {
        if (by_distance && d2[a] != d2[b]) return d2[a] < d2[b];
        return ids[a] < ids[b];
    }
    RAYDIX_HD void swap(std::uint32_t a, std::uint32_t b) const {
        const std::uint32_t id = ids[a];
        const float off = d2[a];
        ids[a] = ids[b];
        d2[a] = d2[b];
        ids[b] = id;
        d2[b] = off;
    }
};

/// Writes what CountWithin counted. A row that would reach past the room stays as it is.
struct FillWithin {
    PointQueries from;
    float r2;
    bool by_distance;
    const std::uint64_t* offsets;  // [n + 1]
    std::uint64_t room;            // elements of the two arrays
    std::uint32_t* indices;        // out
    float* distances;              // out
    RAYDIX_HD void operator()(std::uint32_t i) const {
        const std::uint64_t begin = offsets[i], end = offsets[i + 1];
        if (begin >= end || end > room) return;
        const auto length = static_cast<std::uint32_t>(end - begin);
        const FoundRow row{indices + begin, distances + begin, by_distance};
        std::uint32_t found = 0;
        const auto keep = [&](float d2, std::uint32_t id) {
            if (!(d2 <= r2) || found == length) return;  // the latter only if queries changed
            row.ids[found] = id;
            row.d2[found++] = d2;
        };
        Vec3 query;
        if (from.take(i, query))
            from.walk(query, keep, [&] { return KdNeighbor{r2, no_primitive}; });
        heap_sort(row, found);
        for (std::uint32_t k = 0; k < found; ++k) row.d2[k] = std::sqrt(row.d2[k]);
    }
};

}  // namespace raydix
