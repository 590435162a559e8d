// What batches of queries over points share: kernels by name, the order they are worked off in,
// their blocks; and rows of any length, counted and then filled.
#pragma once

#include <raydix/error.h>
#include <raydix/points.h>

#include <algorithm>
#include <atomic>
#include <limits>
#include <numeric>
#include <string>
#include <vector>

#include "exec/parallel.h"
#include "exec/result_budget.h"
#include "points/point_arrays.h"
#include "points/point_kernels.h"
#include "points/query_order.h"

namespace raydix {

inline constexpr std::size_t queries_per_block = 512;

template <class Index>
using KernelsOf = PointKernels<typename Index::Scalar, Index::dimension>;
template <class Index>
using Within = WithinJob<typename Index::Scalar, Index::dimension>;

template <class Index>
const KernelsOf<Index>& kernels_for(const std::string& isa) {
    const auto all = point_kernels<typename Index::Scalar, Index::dimension>();
    if (isa.empty()) return all.front();
    std::string known;
    for (const auto& kernels : all) {
        if (kernels.isa == isa) return kernels;
        known += (known.empty() ? "" : ", ") + std::string(kernels.isa);
    }
    throw InputError("instruction set " + isa + ": this processor and build have " + known);
}

template <class Index>
std::vector<std::uint32_t> order_for(const Index& index, const typename Index::Scalar* queries,
                                     std::size_t n, std::size_t stride, QueryOrder wanted) {
    if (index.empty()) return {};
    const typename Index::Box bounds = index.bounds();
    return order_of_queries<typename Index::Scalar, Index::dimension>(
        queries, n, stride, &bounds.lo.x, &bounds.hi.x, wanted);
}

/// The same for a call whose memory has a limit: without room to put them in order, queries are
/// taken as they come.
template <class Index>
std::vector<std::uint32_t> order_within(ResultBudget& budget, const Index& index,
                                        const typename Index::Scalar* queries, std::size_t n,
                                        std::size_t stride, QueryOrder wanted) {
    const std::uint64_t bytes = n * 6 * sizeof(std::uint32_t);  // keys, order, what a sort holds
    if (!budget.try_take(bytes)) return {};
    auto order = order_for(index, queries, n, stride, wanted);
    budget.give_back(bytes - order.size() * sizeof(std::uint32_t));
    return order;
}

/// The part of a batch that is block [begin, end).
template <class Job>
Job part_of(Job job, const std::vector<std::uint32_t>& order, std::size_t begin, std::size_t end,
            std::size_t values) {
    job.n = end - begin;
    if (order.empty()) {
        job.queries += begin * values;
        return job;
    }
    job.order = order.data() + begin;
    return job;
}

inline QueryCounts sum_of(const std::vector<PointJobCounts>& parts, std::size_t queries) {
    QueryCounts sum;
    sum.queries = queries;
    for (const PointJobCounts& part : parts) {
        sum.invalid_queries += part.invalid;
        sum.found += part.found;
    }
    return sum;
}

inline std::size_t blocks_of(std::size_t n) {
    return (n + queries_per_block - 1) / queries_per_block;
}

/// Queries of one kind over a whole batch. Rows are found in one walk a query and kept by blocks
/// until their places are known. What would take too much memory beside the result is only counted,
/// and filled in by a second walk.
template <class Index>
class RowBatch {
    using Scalar = typename Index::Scalar;

public:
    RowBatch(const Index& index, const Within<Index>& job, std::size_t values, bool boxes,
             const PointQueryOptions& options)
        : index_(index),
          job_(job),
          values_(values),
          boxes_(boxes),
          options_(options),
          kernels_(kernels_for<Index>(options.isa)) {}

    QueryCounts count() {
        order_ = order_for(index_, job_.queries, job_.n, values_, options_.order);
        parts_.assign(blocks_of(job_.n), {});
        for_each_block(job_.n, queries_per_block,
                       [&](std::size_t b, std::size_t begin, std::size_t end) {
                           count_block(b, block(begin, end));
                       });
        return sum_of(parts_, job_.n);
    }

    /// `rows`: of the result; row_of[k] is that of query k, or null: k.
    PointLists<Scalar> lists(std::size_t rows, const std::uint32_t* row_of, ResultBudget& budget) {
        budget.take(job_.n * sizeof(std::uint32_t) + (rows + 1) * sizeof(std::uint64_t) +
                    blocks_of(job_.n) * block_bytes);
        order_ = order_within(budget, index_, job_.queries, job_.n, values_, options_.order);
        parts_.assign(blocks_of(job_.n), {});
        Buffer<std::uint32_t> counts(job_.n);
        job_.counts = counts.data();
        job_.most_collected = most_collected;
        // Rows are kept beside the result: each takes its place there too.
        ResultBudget kept(budget, 2);
        std::vector<RowChunk<Scalar>> chunks;
        collect_all(budget, kept, chunks);
        PointLists<Scalar> result;
        result.counts = sum_of(parts_, job_.n);
        kept.count_once();
        make_room(result.counts.found * bytes_each, budget, chunks);
        set_offsets(rows, row_of, result);
        result.indices.reset(result.counts.found);
        result.distances.reset(result.counts.found);
        job_.row_of = row_of;
        job_.offsets = result.offsets.data();
        job_.indices = result.indices.data();
        job_.distances = result.distances.data();
        job_.budget = &budget;
        for_each_block(job_.n, queries_per_block,
                       [&](std::size_t b, std::size_t begin, std::size_t end) {
                           budget.go_on();
                           place_block(b, block(begin, end), chunks[b]);
                       });
        return result;
    }

private:
    static constexpr std::uint64_t bytes_each = sizeof(std::uint32_t) + sizeof(Scalar);
    /// Points of a block: a block of more is counted without entering what lies inside entirely.
    static constexpr std::size_t most_collected = 2048 * queries_per_block;

    static constexpr std::uint64_t block_bytes =
        sizeof(PointJobCounts) + sizeof(RowChunk<Scalar>) + sizeof(std::uint8_t);

    Within<Index> block(std::size_t begin, std::size_t end) const {
        Within<Index> job = part_of(job_, order_, begin, end, values_);
        if (!order_.empty()) return job;
        if (job.radii != nullptr) job.radii += begin;
        if (job.itself != nullptr) job.itself += begin;
        job.counts += begin;
        if (job.row_of != nullptr)
            job.row_of += begin;
        else if (job.offsets != nullptr)
            job.offsets += begin;
        return job;
    }

    void count_block(std::size_t b, const Within<Index>& job) {
        parts_[b] = {};
        (boxes_ ? kernels_.count_box : kernels_.count_ball)(job, parts_[b]);
    }

    /// False, and nothing kept, if there is too much of it.
    bool collect_block(std::size_t b, const Within<Index>& job, RowChunk<Scalar>& chunk) {
        try {
            chunk.reserve(16 * job.n);  // memory that is not written to costs little time
            (boxes_ ? kernels_.collect_box : kernels_.collect_ball)(job, parts_[b], chunk);
        } catch (const ResultTooLarge&) {  // only for rows that are kept
            chunk.clear();
            return false;
        }
        if (chunk.size > most_collected) {
            chunk.clear();
            return false;
        }
        is_kept_[b] = 1;
        return true;
    }

    /// Stops as soon as the rows so far do not fit: a result that is far too large is known early.
    void collect_all(ResultBudget& budget, ResultBudget& kept,
                     std::vector<RowChunk<Scalar>>& chunks) {
        chunks.reserve(parts_.size());
        for (std::size_t b = 0; b < parts_.size(); ++b) chunks.emplace_back(&kept);
        is_kept_.assign(parts_.size(), 0);
        job_.budget = &kept;
        const std::uint64_t others = budget.held();
        std::atomic<std::uint64_t> total{0};
        std::atomic<bool> collects{true};
        for_each_block(job_.n, queries_per_block,
                       [&](std::size_t b, std::size_t begin, std::size_t end) {
                           const Within<Index> job = block(begin, end);
                           if (!collects || !collect_block(b, job, chunks[b])) {
                               collects = false;
                               count_block(b, job);
                           }
                           const std::uint64_t found = parts_[b].found;
                           const std::uint64_t so_far =
                               total.fetch_add(found, std::memory_order_relaxed) + found;
                           budget.expect(others + saturating_product(so_far, bytes_each));
                       });
    }

    /// Takes what the result needs; without room for kept rows beside it they are forgotten.
    void make_room(std::uint64_t bytes, ResultBudget& budget,
                   std::vector<RowChunk<Scalar>>& chunks) {
        if (budget.try_take(bytes)) return;
        for (RowChunk<Scalar>& chunk : chunks) chunk.clear();
        is_kept_.assign(parts_.size(), 0);
        budget.take_last(bytes);
    }

    /// The rows of a block to where they belong.
    void place_block(std::size_t b, const Within<Index>& job, RowChunk<Scalar>& rows) {
        if (is_kept_[b] == 0) return (boxes_ ? kernels_.fill_box : kernels_.fill_ball)(job);
        const RowChunk<Scalar> chunk = std::move(rows);  // its memory goes back at once
        std::size_t at = 0;
        for (std::size_t k = 0; k < job.n; ++k) {
            const std::size_t place = job.place(k), n = job.counts[place];
            const std::uint64_t to = job.offset_of(place);
            std::copy_n(chunk.ids.data() + at, n, job.indices + to);
            std::copy_n(chunk.distances.data() + at, n, job.distances + to);
            at += n;
        }
    }

    void set_offsets(std::size_t rows, const std::uint32_t* row_of, PointLists<Scalar>& result) {
        result.offsets.reset(rows + 1);
        std::uint64_t* offsets = result.offsets.data();
        std::fill_n(offsets, rows + 1, std::uint64_t{0});
        for (std::size_t k = 0; k < job_.n; ++k)
            offsets[(row_of == nullptr ? k : row_of[k]) + 1] = job_.counts[k];
        std::inclusive_scan(offsets, offsets + rows + 1, offsets);
    }

    const Index& index_;
    Within<Index> job_;
    std::size_t values_;
    bool boxes_;
    const PointQueryOptions& options_;
    const KernelsOf<Index>& kernels_;
    std::vector<std::uint32_t> order_;
    std::vector<PointJobCounts> parts_;
    std::vector<std::uint8_t> is_kept_;  // of a block, 1: its rows are in its chunk
};

}  // namespace raydix
