// The doors to the queries that are compiled once per instruction set.
#pragma once

#include <raydix/points.h>

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "points/found_point.h"
#include "points/point_tree.h"

namespace raydix {

/// Queries of a batch: point `order[k]`, or `k` without an order. Results go to the same places.
template <class T, int Dim>
struct PointJob {
    PointTreeView<T, Dim> tree;
    const T* queries;            // points, or boxes: lo then hi
    const std::uint32_t* order;  // may be null
    std::size_t n;

    [[nodiscard]] std::size_t place(std::size_t k) const { return order == nullptr ? k : order[k]; }
};

template <class T, int Dim>
struct NearestJob : PointJob<T, Dim> {
    std::uint32_t k;
    T limit_d2;              // beyond which no point counts
    const T* most_d2;        // the same for each query; null: limit_d2
    bool squared;            // d2 instead of distances
    std::uint32_t* indices;  // [queries * k]
    T* distances;            // [queries * k]
};

/// Which of the points found are kept: all, all but the query itself, or only later ones.
enum class KeepPoints : std::uint32_t { all, others, later };

template <class T, int Dim>
struct WithinJob : PointJob<T, Dim> {
    const T* radii;  // one of each query; null: `radius` for all
    T radius;
    bool by_distance;
    bool squared;                 // d2 instead of distances
    KeepPoints keep;              // else queries must be points of the index in its order, and
    const std::uint32_t* itself;  // their ids are here: [n]
    std::uint32_t* counts;        // [queries], out of a count, and what it gave for a fill
    std::size_t most_collected;   // points in a chunk, beyond which queries are left out
    ResultBudget* budget;         // of the memory that rows take while they are found
    // Out of a fill: the row of query k begins at offsets[row_of[k]], or offsets[k] without row_of.
    const std::uint32_t* row_of;
    const std::uint64_t* offsets;
    std::uint32_t* indices;
    T* distances;

    [[nodiscard]] T radius_of(std::size_t place) const {
        return radii == nullptr ? radius : radii[place];
    }
    [[nodiscard]] std::uint64_t offset_of(std::size_t place) const {
        return offsets[row_of == nullptr ? place : row_of[place]];
    }
};

struct PointJobCounts {
    std::uint64_t invalid = 0, found = 0;
};

/// Called for each point within a radius; false stops.
template <class T>
struct PointVisitor {
    bool (*call)(void* data, std::uint32_t id, T distance);
    void* data;
};

template <class T, int Dim>
struct PointKernels {
    std::string_view isa;
    void (*nearest)(const NearestJob<T, Dim>& job, PointJobCounts& counts);
    /// How many points are within, to job.counts.
    void (*count_ball)(const WithinJob<T, Dim>& job, PointJobCounts& counts);
    void (*count_box)(const WithinJob<T, Dim>& job, PointJobCounts& counts);
    /// Counts, and the rows behind one another in the order of the job. Stops short, and its counts
    /// mean nothing, if rows.size > job.most_collected after it. Throws ResultTooLarge.
    void (*collect_ball)(const WithinJob<T, Dim>& job, PointJobCounts& counts, RowChunk<T>& rows);
    void (*collect_box)(const WithinJob<T, Dim>& job, PointJobCounts& counts, RowChunk<T>& rows);
    /// The rows themselves, sorted, with true distances, where they belong. Throws ResultTooLarge.
    void (*fill_ball)(const WithinJob<T, Dim>& job);
    void (*fill_box)(const WithinJob<T, Dim>& job);
    bool (*visit_ball)(const PointTreeView<T, Dim>& tree, const T* query, T radius,
                       const PointVisitor<T>& visitor);
};

/// Best first; those this processor can run.
template <class T, int Dim>
[[nodiscard]] std::span<const PointKernels<T, Dim>> point_kernels();

}  // namespace raydix
