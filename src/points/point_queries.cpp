// The public queries of an index of points: their arguments are checked, then batches go over the
// threads in blocks.
#include <raydix/error.h>
#include <raydix/points.h>

#include "base/float_env.h"
#include "base/options.h"
#include "points/point_rows.h"
#include "points/squared_queries.h"

namespace raydix {
namespace {

template <class Scalar, class Value>
const Scalar* values_of(std::span<const Value> values) {
    return reinterpret_cast<const Scalar*>(values.data());
}

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
    check_enum("order", options.order, QueryOrder::sorted);
    PointLists<typename Index::Scalar> result;
    with_threads(options.threads, [&] {
        ResultBudget budget(what, options.max_result_bytes);
        result = RowBatch<Index>(index, job, values, boxes, options).lists(job.n, nullptr, budget);
    });
    return result;
}

template <class Index>
using Nearest = NearestJob<typename Index::Scalar, Index::dimension>;

/// Without the limit.
template <class Index>
Nearest<Index> nearest_job(const Index& index, PointsOf<Index> queries, std::uint32_t k,
                           std::span<std::uint32_t> indices, ScalarsOf<Index> distances) {
    Nearest<Index> job{};
    job.tree = index.arrays().tree;
    job.queries = values_of<typename Index::Scalar>(queries);
    job.n = queries.size();
    job.k = k;
    job.indices = indices.data();
    job.distances = distances.data();
    return job;
}

/// In a plain float environment: both may be denormal. Not inlined: a compiler may move arithmetic
/// to before the environment is set.
template <class Scalar>
[[gnu::noinline]] Scalar square_limit_of(double max_distance) {
    const auto limit = static_cast<Scalar>(max_distance);
    return limit * limit;
}

/// order(queries) -> the order in which to take them.
template <class Index, class Order>
QueryCounts nearest(Nearest<Index> job, const PointQueryOptions& options, const Order& order_of) {
    const KernelsOf<Index>& kernels = kernels_for<Index>(options.isa);
    std::vector<PointJobCounts> parts(blocks_of(job.n));
    with_threads(options.threads, [&] {
        job.limit_d2 = square_limit_of<typename Index::Scalar>(options.max_distance);
        const std::vector<std::uint32_t> order = order_of(job.queries);
        for_each_block(job.n, queries_per_block,
                       [&](std::size_t b, std::size_t begin, std::size_t end) {
                           auto part = part_of(job, order, begin, end, Index::dimension);
                           if (order.empty()) {
                               part.indices += begin * job.k;
                               part.distances += begin * job.k;
                               if (job.most_d2 != nullptr) part.most_d2 += begin;
                           }
                           kernels.nearest(part, parts[b]);
                       });
    });
    return sum_of(parts, job.n);
}

void require_neighbours(std::uint32_t k) {
    if (k == 0) throw InputError("knn: k is 0; it must be at least 1");
}

}  // namespace

std::vector<std::string> point_instruction_sets() {
    std::vector<std::string> names;
    for (const auto& kernels : point_kernels<float, 3>()) names.emplace_back(kernels.isa);
    return names;
}

template <class Index>
QueryCounts knn(const Index& index, PointsOf<Index> queries, std::uint32_t k,
                std::span<std::uint32_t> indices, ScalarsOf<Index> distances,
                const PointQueryOptions& options) {
    check_enum("order", options.order, QueryOrder::sorted);
    require_neighbours(k);
    check_not_negative("max_distance", options.max_distance);
    for (const std::size_t room : {indices.size(), distances.size()})
        if (room / k != queries.size() || room % k != 0)
            throw InputError("knn: " + std::to_string(queries.size()) + " queries for " +
                             std::to_string(k) + " each, but room for " + std::to_string(room) +
                             " results");
    return nearest<Index>(nearest_job(index, queries, k, indices, distances), options,
                          [&](const typename Index::Scalar* first) {
                              return order_for(index, first, queries.size(), Index::dimension,
                                               options.order);
                          });
}

template <class Index>
NearestPoints<typename Index::Scalar> knn(const Index& index, PointsOf<Index> queries,
                                          std::uint32_t k, const PointQueryOptions& options) {
    using Scalar = typename Index::Scalar;
    check_enum("order", options.order, QueryOrder::sorted);
    require_neighbours(k);
    check_not_negative("max_distance", options.max_distance);
    ResultBudget budget("knn", options.max_result_bytes);
    budget.take_last(
        saturating_product(queries.size(), k * (sizeof(std::uint32_t) + sizeof(Scalar))));
    NearestPoints<Scalar> result;
    result.indices.reset(queries.size() * k);
    result.distances.reset(queries.size() * k);
    result.counts = nearest<Index>(
        nearest_job(index, queries, k, result.indices.span(), result.distances.span()), options,
        [&](const Scalar* first) {
            return order_within(budget, index, first, queries.size(), Index::dimension,
                                options.order);
        });
    return result;
}

template <class Index>
std::uint32_t knn(const Index& index, const typename Index::Point& query,
                  std::span<std::uint32_t> indices, ScalarsOf<Index> distances,
                  double max_distance) {
    using Scalar = typename Index::Scalar;
    if (indices.empty()) throw InputError("knn: k is 0; it must be at least 1");
    if (indices.size() != distances.size() || indices.size() > no_primitive)
        throw InputError("knn: room for " + std::to_string(indices.size()) + " indices and " +
                         std::to_string(distances.size()) + " distances");
    check_not_negative("max_distance", max_distance);
    const FloatEnvironment plain;
    Nearest<Index> job =
        nearest_job(index, PointsOf<Index>(&query, 1), static_cast<std::uint32_t>(indices.size()),
                    indices, distances);
    job.limit_d2 = square_limit_of<Scalar>(max_distance);
    PointJobCounts counts;
    point_kernels<Scalar, Index::dimension>().front().nearest(job, counts);
    return static_cast<std::uint32_t>(counts.found);
}

template <class Index>
PointLists<typename Index::Scalar> radius_search(const Index& index, PointsOf<Index> queries,
                                                 ScalarOf<Index> radius,
                                                 const PointQueryOptions& options) {
    check_not_negative("radius", radius);
    Within<Index> job =
        within_job(index, values_of<typename Index::Scalar>(queries), queries.size(), options);
    job.radius = radius;
    return lists_of(index, job, Index::dimension, false, "radius_search", options);
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
        if (!(radii[i] >= 0)) check_not_negative("radius " + std::to_string(i), radii[i]);
    Within<Index> job =
        within_job(index, values_of<typename Index::Scalar>(queries), queries.size(), options);
    job.radii = radii.data();
    return lists_of(index, job, Index::dimension, false, "radius_search", options);
}

template <class Index>
QueryCounts radius_count(const Index& index, PointsOf<Index> queries, ScalarOf<Index> radius,
                         std::span<std::uint32_t> counts, const PointQueryOptions& options) {
    check_enum("order", options.order, QueryOrder::sorted);
    check_not_negative("radius", radius);
    if (counts.size() != queries.size())
        throw InputError("radius count: " + std::to_string(queries.size()) +
                         " queries, but room for " + std::to_string(counts.size()) + " counts");
    Within<Index> job =
        within_job(index, values_of<typename Index::Scalar>(queries), queries.size(), options);
    job.radius = radius;
    job.counts = counts.data();
    QueryCounts sum;
    with_threads(options.threads, [&] {
        sum = RowBatch<Index>(index, job, Index::dimension, false, options).count();
    });
    return sum;
}

template <class Index>
std::uint32_t radius_count(const Index& index, const typename Index::Point& query,
                           ScalarOf<Index> radius) {
    check_not_negative("radius", radius);
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
    return lists_of(index, job, 2 * Index::dimension, true, "box_search", options);
}

template <class Index>
QueryCounts squared_nearest(const Index& index, PointsOf<Index> queries,
                            const typename Index::Scalar* most_d2, std::uint32_t k,
                            std::span<std::uint32_t> indices, ScalarsOf<Index> d2,
                            const PointQueryOptions& options) {
    Nearest<Index> job = nearest_job(index, queries, k, indices, d2);
    job.most_d2 = most_d2;
    job.squared = true;
    return nearest<Index>(job, options, [&](const typename Index::Scalar* first) {
        return order_for(index, first, queries.size(), Index::dimension, options.order);
    });
}

template <class Index>
PointLists<typename Index::Scalar> squared_radius_search(
    const Index& index, PointsOf<Index> queries,
    std::type_identity_t<std::span<const typename Index::Scalar>> radii,
    const PointQueryOptions& options) {
    Within<Index> job =
        within_job(index, values_of<typename Index::Scalar>(queries), queries.size(), options);
    job.radii = radii.data();
    job.squared = true;
    return lists_of(index, job, Index::dimension, false, "radius_search", options);
}

template <class Index>
PointLists<typename Index::Scalar> neighbour_lists(const Index& index, ScalarOf<Index> radius,
                                                   PairRows rows,
                                                   const PointQueryOptions& options) {
    using Scalar = typename Index::Scalar;
    constexpr int dim = Index::dimension;
    check_enum("rows", rows, PairRows::full);
    check_enum("order", options.order, QueryOrder::sorted);
    check_not_negative("radius", radius);
    const PointTreeView<Scalar, dim>& tree = index.arrays().tree;
    PointLists<Scalar> result;
    with_threads(options.threads, [&] {
        ResultBudget budget("neighbour_lists", options.max_result_bytes);
        budget.take(tree.points * (dim * sizeof(Scalar) + sizeof(std::uint32_t)));
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
                     .lists(index.input_count(), ids.data(), budget);
    });
    return result;
}

namespace detail {

template <class Index>
bool visit_radius(const Index& index, const typename Index::Point& query,
                  typename Index::Scalar radius,
                  bool (*call)(void*, std::uint32_t, typename Index::Scalar), void* data) {
    check_not_negative("radius", radius);
    const FloatEnvironment plain;
    return point_kernels<typename Index::Scalar, Index::dimension>().front().visit_ball(
        index.arrays().tree, &query.x, radius, {call, data});
}

}  // namespace detail

#define RAYDIX_POINT_QUERIES(Index)                                                               \
    template QueryCounts knn(const Index&, PointsOf<Index>, std::uint32_t,                        \
                             std::span<std::uint32_t>, ScalarsOf<Index>,                          \
                             const PointQueryOptions&);                                           \
    template NearestPoints<Index::Scalar> knn(const Index&, PointsOf<Index>, std::uint32_t,       \
                                              const PointQueryOptions&);                          \
    template std::uint32_t knn(const Index&, const Index::Point&, std::span<std::uint32_t>,       \
                               ScalarsOf<Index>, double);                                         \
    template PointLists<Index::Scalar> radius_search(const Index&, PointsOf<Index>,               \
                                                     ScalarOf<Index>, const PointQueryOptions&);  \
    template PointLists<Index::Scalar> radius_search(                                             \
        const Index&, PointsOf<Index>, std::span<const Index::Scalar>, const PointQueryOptions&); \
    template QueryCounts radius_count(const Index&, PointsOf<Index>, ScalarOf<Index>,             \
                                      std::span<std::uint32_t>, const PointQueryOptions&);        \
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

#define RAYDIX_SQUARED_QUERIES(Index)                                                         \
    template QueryCounts squared_nearest(const Index&, PointsOf<Index>, const Index::Scalar*, \
                                         std::uint32_t, std::span<std::uint32_t>,             \
                                         ScalarsOf<Index>, const PointQueryOptions&);         \
    template PointLists<Index::Scalar> squared_radius_search(                                 \
        const Index&, PointsOf<Index>, std::span<const Index::Scalar>, const PointQueryOptions&);
RAYDIX_SQUARED_QUERIES(Points)
RAYDIX_SQUARED_QUERIES(PointsD)
#undef RAYDIX_SQUARED_QUERIES

}  // namespace raydix
