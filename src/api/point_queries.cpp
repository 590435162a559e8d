// Batches of queries over an index of points: argument checks, order, blocks over threads, and rows
// of any length put together.
#include <raydix/error.h>
#include <raydix/points.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>

#include "api/result_memory.h"
#include "base/float_env.h"
#include "exec/parallel.h"
#include "points/point_arrays.h"
#include "points/point_kernels.h"
#include "points/query_order.h"

namespace raydix {
namespace {

constexpr std::size_t queries_per_block = 512;

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

template <class Scalar, class Value>
const Scalar* values_of(std::span<const Value> values) {
    return reinterpret_cast<const Scalar*>(values.data());
}

template <class Index>
std::vector<std::uint32_t> order_for(const Index& index, const typename Index::Scalar* queries,
                                     std::size_t n, std::size_t stride, QueryOrder wanted) {
    if (index.empty()) return {};
    const typename Index::Box bounds = index.bounds();
    return order_of_queries<typename Index::Scalar, Index::dimension>(
        queries, n, stride, &bounds.lo.x, &bounds.hi.x, wanted);
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

PointQueryCounts sum_of(const std::vector<PointJobCounts>& parts, std::size_t queries) {
    PointQueryCounts sum;
    sum.queries = queries;
    for (const PointJobCounts& part : parts) {
        sum.invalid_queries += part.invalid;
        sum.found += part.found;
    }
    return sum;
}

template <class Scalar>
void check_radius(Scalar radius, const std::string& whose) {
    if (!(radius >= 0))
        throw InputError("radius" + whose + " is " + std::to_string(radius) +
                         "; it must be 0 or more");
}

std::uint64_t saturating_product(std::uint64_t a, std::uint64_t b) {
    constexpr auto most = std::numeric_limits<std::uint64_t>::max();
    return b != 0 && a > most / b ? most : a * b;
}

std::size_t blocks_of(std::size_t n) { return (n + queries_per_block - 1) / queries_per_block; }

/// Queries of one kind over a whole batch: counted, and then filled into rows of that length.
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

    PointQueryCounts count() {
        order();
        count_all("", std::numeric_limits<std::uint64_t>::max());
        return sum_of(parts_, job_.n);
    }

    /// `rows`: of the result; row_of[k] is that of query k, or null: k.
    PointLists<Scalar> lists(std::size_t rows, const std::uint32_t* row_of, const char* what) {
        order();
        Buffer<std::uint32_t> counts(job_.n);
        job_.counts = counts.data();
        const std::uint64_t most =
            saturating_product(saturating_product(job_.n, job_.tree.points), bytes_each);
        const std::uint64_t limit = memory_limit(options_.max_bytes, most);
        count_all(what, limit);
        PointLists<Scalar> result;
        result.counts = sum_of(parts_, job_.n);
        const std::uint64_t total = result.counts.found + 2 * (std::uint64_t{rows} + 1);
        check_result_fits(what, total, bytes_each, limit);
        set_offsets(rows, row_of, result);
        result.indices.reset(result.counts.found);
        result.distances.reset(result.counts.found);
        job_.row_of = row_of;
        job_.offsets = result.offsets.data();
        job_.indices = result.indices.data();
        job_.distances = result.distances.data();
        for_each_block(job_.n, queries_per_block,
                       [&](std::size_t, std::size_t begin, std::size_t end) {
                           (boxes_ ? kernels_.fill_box : kernels_.fill_ball)(block(begin, end));
                       });
        return result;
    }

private:
    static constexpr std::uint64_t bytes_each = sizeof(std::uint32_t) + sizeof(Scalar);

    void order() {
        order_ = order_for(index_, job_.queries, job_.n, values_, options_.order);
        parts_.assign(blocks_of(job_.n), {});
    }

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

    /// Stops as soon as the rows so far do not fit: a result that is far too large is known early.
    void count_all(const char* what, std::uint64_t limit) {
        std::atomic<std::uint64_t> total{0};
        for_each_block(
            job_.n, queries_per_block, [&](std::size_t b, std::size_t begin, std::size_t end) {
                (boxes_ ? kernels_.count_box : kernels_.count_ball)(block(begin, end), parts_[b]);
                const std::uint64_t found = parts_[b].found;
                check_result_fits(what, total.fetch_add(found, std::memory_order_relaxed) + found,
                                  bytes_each, limit);
            });
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
};

template <class Index>
Within<Index> within_job(const Index& index, const typename Index::Scalar* queries, std::size_t n,
                         const PointQueryOptions& options) {
    Within<Index> job{};
    job.tree = index.arrays().tree;
    job.queries = queries;
    job.n = n;
    job.by_distance = options.sort;
    job.keep = KeepPoints::all;
    return job;
}

template <class Index>
PointLists<typename Index::Scalar> lists_of(const Index& index, const Within<Index>& job,
                                            std::size_t values, bool boxes, const char* what,
                                            const PointQueryOptions& options) {
    PointLists<typename Index::Scalar> result;
    with_threads(options.threads, [&] {
        result = RowBatch<Index>(index, job, values, boxes, options).lists(job.n, nullptr, what);
    });
    return result;
}

}  // namespace

std::vector<std::string> point_instruction_sets() {
    std::vector<std::string> names;
    for (const auto& kernels : point_kernels<float, 3>()) names.emplace_back(kernels.isa);
    return names;
}

template <class Index>
PointQueryCounts knn(const Index& index, PointsOf<Index> queries, std::uint32_t k,
                     std::span<std::uint32_t> indices, ScalarsOf<Index> distances,
                     const PointQueryOptions& options) {
    using Scalar = typename Index::Scalar;
    if (k == 0) throw InputError("knn: k is 0; it must be at least 1");
    for (const std::size_t room : {indices.size(), distances.size()})
        if (room / k != queries.size() || room % k != 0)
            throw InputError("knn: " + std::to_string(queries.size()) + " queries for " +
                             std::to_string(k) + " each, but room for " + std::to_string(room) +
                             " results");
    const KernelsOf<Index>& kernels = kernels_for<Index>(options.isa);
    NearestJob<Scalar, Index::dimension> job{};
    job.tree = index.arrays().tree;
    job.queries = values_of<Scalar>(queries);
    job.n = queries.size();
    job.k = k;
    job.indices = indices.data();
    job.distances = distances.data();
    std::vector<PointJobCounts> parts(blocks_of(job.n));
    with_threads(options.threads, [&] {
        const auto order = order_for(index, job.queries, job.n, Index::dimension, options.order);
        for_each_block(job.n, queries_per_block,
                       [&](std::size_t b, std::size_t begin, std::size_t end) {
                           auto part = part_of(job, order, begin, end, Index::dimension);
                           if (order.empty()) {
                               part.indices += begin * k;
                               part.distances += begin * k;
                           }
                           kernels.nearest(part, parts[b]);
                       });
    });
    return sum_of(parts, job.n);
}

template <class Index>
NearestPoints<typename Index::Scalar> knn(const Index& index, PointsOf<Index> queries,
                                          std::uint32_t k, const PointQueryOptions& options) {
    using Scalar = typename Index::Scalar;
    const std::uint64_t row_bytes = std::uint64_t{k} * (sizeof(std::uint32_t) + sizeof(Scalar));
    if (k != 0)
        check_result_fits(
            "knn", queries.size(), row_bytes,
            memory_limit(options.max_bytes, saturating_product(queries.size(), row_bytes)));
    NearestPoints<Scalar> result;
    result.indices.reset(queries.size() * k);
    result.distances.reset(queries.size() * k);
    result.counts = knn(index, queries, k, result.indices.span(), result.distances.span(), options);
    return result;
}

template <class Index>
std::uint32_t knn(const Index& index, const typename Index::Point& query,
                  std::span<std::uint32_t> indices, ScalarsOf<Index> distances) {
    if (indices.empty()) throw InputError("knn: k is 0; it must be at least 1");
    if (indices.size() != distances.size() || indices.size() > no_primitive)
        throw InputError("knn: room for " + std::to_string(indices.size()) + " indices and " +
                         std::to_string(distances.size()) + " distances");
    const FloatEnvironment plain;
    NearestJob<typename Index::Scalar, Index::dimension> job{};
    job.tree = index.arrays().tree;
    job.queries = &query.x;
    job.n = 1;
    job.k = static_cast<std::uint32_t>(indices.size());
    job.indices = indices.data();
    job.distances = distances.data();
    PointJobCounts counts;
    point_kernels<typename Index::Scalar, Index::dimension>().front().nearest(job, counts);
    return static_cast<std::uint32_t>(counts.found);
}

template <class Index>
PointLists<typename Index::Scalar> radius_search(const Index& index, PointsOf<Index> queries,
                                                 ScalarOf<Index> radius,
                                                 const PointQueryOptions& options) {
    check_radius(radius, "");
    Within<Index> job =
        within_job(index, values_of<typename Index::Scalar>(queries), queries.size(), options);
    job.radius = radius;
    return lists_of(index, job, Index::dimension, false, "radius search", options);
}

template <class Index>
PointLists<typename Index::Scalar> radius_search(
    const Index& index, PointsOf<Index> queries,
    std::type_identity_t<std::span<const typename Index::Scalar>> radii,
    const PointQueryOptions& options) {
    if (radii.size() != queries.size())
        throw InputError("radius search: " + std::to_string(queries.size()) + " queries, but " +
                         std::to_string(radii.size()) + " radii");
    for (std::size_t i = 0; i < radii.size(); ++i)
        if (!(radii[i] >= 0)) check_radius(radii[i], std::string(" ").append(std::to_string(i)));
    Within<Index> job =
        within_job(index, values_of<typename Index::Scalar>(queries), queries.size(), options);
    job.radii = radii.data();
    return lists_of(index, job, Index::dimension, false, "radius search", options);
}

template <class Index>
PointQueryCounts radius_count(const Index& index, PointsOf<Index> queries, ScalarOf<Index> radius,
                              std::span<std::uint32_t> counts, const PointQueryOptions& options) {
    check_radius(radius, "");
    if (counts.size() != queries.size())
        throw InputError("radius count: " + std::to_string(queries.size()) +
                         " queries, but room for " + std::to_string(counts.size()) + " counts");
    Within<Index> job =
        within_job(index, values_of<typename Index::Scalar>(queries), queries.size(), options);
    job.radius = radius;
    job.counts = counts.data();
    PointQueryCounts sum;
    with_threads(options.threads, [&] {
        sum = RowBatch<Index>(index, job, Index::dimension, false, options).count();
    });
    return sum;
}

template <class Index>
std::uint32_t radius_count(const Index& index, const typename Index::Point& query,
                           ScalarOf<Index> radius) {
    check_radius(radius, "");
    const FloatEnvironment plain;
    std::uint32_t count = 0;
    Within<Index> job = within_job(index, &query.x, 1, {});
    job.radius = radius;
    job.counts = &count;
    PointJobCounts counts;
    point_kernels<typename Index::Scalar, Index::dimension>().front().count_ball(job, counts);
    return count;
}

template <class Index>
PointLists<typename Index::Scalar> box_search(
    const Index& index, std::type_identity_t<std::span<const typename Index::Box>> boxes,
    const PointQueryOptions& options) {
    const Within<Index> job =
        within_job(index, values_of<typename Index::Scalar>(boxes), boxes.size(), options);
    return lists_of(index, job, 2 * Index::dimension, true, "box search", options);
}

template <class Index>
PointLists<typename Index::Scalar> neighbour_lists(const Index& index, ScalarOf<Index> radius,
                                                   PairRows rows,
                                                   const PointQueryOptions& options) {
    using Scalar = typename Index::Scalar;
    constexpr int dim = Index::dimension;
    check_radius(radius, "");
    const PointTreeView<Scalar, dim>& tree = index.arrays().tree;
    PointLists<Scalar> result;
    with_threads(options.threads, [&] {
        Buffer<Scalar> queries(std::size_t{tree.points} * dim);
        Buffer<std::uint32_t> ids(tree.points);
        std::size_t at = 0;
        for (std::uint32_t leaf = 0; leaf < tree.leaf_count; ++leaf)
            for (std::uint32_t i = 0; i < points_per_leaf; ++i) {
                if (tree.leaves[leaf].id[i] == no_primitive) break;
                for (int d = 0; d < dim; ++d) queries[at * dim + d] = tree.leaves[leaf].at[d][i];
                ids[at++] = tree.leaves[leaf].id[i];
            }
        Within<Index> job = within_job(index, queries.data(), tree.points, options);
        job.radius = radius;
        job.keep = rows == PairRows::half ? KeepPoints::later : KeepPoints::others;
        job.itself = ids.data();
        PointQueryOptions as_given = options;
        as_given.order = QueryOrder::as_given;  // the index's own order
        result = RowBatch<Index>(index, job, dim, false, as_given)
                     .lists(index.input_count(), ids.data(), "neighbour lists");
    });
    return result;
}

namespace detail {

template <class Index>
bool visit_radius(const Index& index, const typename Index::Point& query,
                  typename Index::Scalar radius,
                  bool (*call)(void*, std::uint32_t, typename Index::Scalar), void* data) {
    check_radius(radius, "");
    const FloatEnvironment plain;
    return point_kernels<typename Index::Scalar, Index::dimension>().front().visit_ball(
        index.arrays().tree, &query.x, radius, {call, data});
}

}  // namespace detail

#define RAYDIX_POINT_QUERIES(Index)                                                               \
    template PointQueryCounts knn(const Index&, PointsOf<Index>, std::uint32_t,                   \
                                  std::span<std::uint32_t>, ScalarsOf<Index>,                     \
                                  const PointQueryOptions&);                                      \
    template NearestPoints<Index::Scalar> knn(const Index&, PointsOf<Index>, std::uint32_t,       \
                                              const PointQueryOptions&);                          \
    template std::uint32_t knn(const Index&, const Index::Point&, std::span<std::uint32_t>,       \
                               ScalarsOf<Index>);                                                 \
    template PointLists<Index::Scalar> radius_search(const Index&, PointsOf<Index>,               \
                                                     ScalarOf<Index>, const PointQueryOptions&);  \
    template PointLists<Index::Scalar> radius_search(                                             \
        const Index&, PointsOf<Index>, std::span<const Index::Scalar>, const PointQueryOptions&); \
    template PointQueryCounts radius_count(const Index&, PointsOf<Index>, ScalarOf<Index>,        \
                                           std::span<std::uint32_t>, const PointQueryOptions&);   \
    template std::uint32_t radius_count(const Index&, const Index::Point&, ScalarOf<Index>);      \
    template PointLists<Index::Scalar> box_search(const Index&, std::span<const Index::Box>,      \
                                                  const PointQueryOptions&);                      \
    template PointLists<Index::Scalar> neighbour_lists(const Index&, ScalarOf<Index>, PairRows,   \
                                                       const PointQueryOptions&);                 \
    template bool detail::visit_radius(const Index&, const Index::Point&, Index::Scalar,          \
                                       bool (*)(void*, std::uint32_t, Index::Scalar), void*);
RAYDIX_POINT_QUERIES(Points)
RAYDIX_POINT_QUERIES(Points2)
RAYDIX_POINT_QUERIES(PointsD)
RAYDIX_POINT_QUERIES(Points2D)
#undef RAYDIX_POINT_QUERIES

}  // namespace raydix
