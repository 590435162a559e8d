// Points spread over ranks: partition, an index of raydix on each rank, a tree over the boxes of
// all; then queries in rounds.
#include <raydix/error.h>
#include <raydix/mpi.h>
#include <raydix/points.h>
#include <raydix/result_limit.h>

#include <cmath>
#include <optional>
#include <string>

#include "base/float_env.h"
#include "base/options.h"
#include "exec/result_memory.h"
#include "mpi/agree.h"
#include "mpi/call.h"
#include "mpi/curve.h"
#include "mpi/point_queries.h"
#include "points/point_arrays.h"

namespace raydix::mpi {
namespace {

/// As an index of points has it (contract.md 1).
template <class Point>
bool is_taken(const Point& p) {
    const auto within = [](auto x) { return std::fabs(x) <= decltype(x)(1e12); };
    return within(p.x) && within(p.y) && within(p.z);
}

template <class T, class Point>
RankBox<T> box_of_points(std::span<const Point> points) {
    RankBox<T> box = RankBox<T>::empty();
    for (const Point& p : points)
        if (is_taken(p)) box.unite({{p.x, p.y, p.z}, {p.x, p.y, p.z}});
    return box;
}

/// The boxes of nodes from the root down, the one with the longest side divided first.
template <class T>
std::vector<RankBox<T>> top_boxes(const PointTreeView<T, 3>& tree, std::size_t most) {
    struct Child {
        RankBox<T> box;
        const PointNode<T, 3>* node;  // null: a group
    };
    const auto add_children = [&](const PointNode<T, 3>& node, std::vector<Child>& list) {
        for (std::uint32_t c = 0; c < node.children; ++c) {
            Child child;
            for (int d = 0; d < 3; ++d) {
                child.box.lo[d] = node.lo[d][c];
                child.box.hi[d] = node.hi[d][c];
            }
            child.node = node.is_bottom != 0 ? nullptr : &tree.nodes[node.below + c];
            list.push_back(child);
        }
    };
    std::vector<Child> open;
    if (!tree.empty()) add_children(tree.nodes[0], open);
    const auto side = [](const Child& child) { return child.box.extent(child.box.longest_axis()); };
    for (;;) {
        const auto largest =
            std::max_element(open.begin(), open.end(), [&](const Child& a, const Child& b) {
                return (a.node == nullptr ? T(-1) : side(a)) <
                       (b.node == nullptr ? T(-1) : side(b));
            });
        if (largest == open.end() || largest->node == nullptr ||
            open.size() - 1 + largest->node->children > most)
            break;
        const PointNode<T, 3>* node = largest->node;
        open.erase(largest);
        add_children(*node, open);
    }
    std::vector<RankBox<T>> boxes;
    for (const Child& child : open) boxes.push_back(child.box);
    return boxes;
}

}  // namespace

template <class Scalar>
struct BasicDistributedPoints<Scalar>::State {
    struct Record {
        Point at;
        std::uint64_t id;
    };

    State(MPI_Comm given, const Options& chosen) : comm(given), options(chosen) {}

    /// The points that this rank is to hold; their numbers, ascending, to `ids`.
    std::vector<Point> move_along_curve(std::span<const Point> points, std::uint64_t first,
                                        ComputeClock& clock) {
        std::exception_ptr error;
        RankBox<Scalar> mine;
        keep_error(error, [&] { clock.run([&] { mine = box_of_points<Scalar>(points); }); });
        const GlobalGrid grid(comm, mine);
        std::vector<Record> records;
        std::vector<CurveKey> keys;
        keep_error(error, [&] {
            clock.run([&] {
                for (std::size_t i = 0; i < points.size(); ++i) {
                    if (!is_taken(points[i])) continue;
                    records.push_back({points[i], first + i});
                    keys.push_back({grid.code(&points[i].x), first + i});
                }
            });
        });
        agree(comm, error);
        records = partition_by_curve(comm, std::move(records), keys, options.message_bytes);
        std::vector<Point> held;
        std::vector<std::uint64_t> numbers;
        keep_error(error, [&] {
            clock.run([&] {
                std::sort(records.begin(), records.end(),
                          [](const Record& a, const Record& b) { return a.id < b.id; });
                for (const Record& record : records) {
                    held.push_back(record.at);
                    numbers.push_back(record.id);
                }
            });
        });
        agree(comm, error);
        ids = GlobalIds(std::move(numbers));
        return held;
    }

    void build(std::span<const Point> points) {
        ComputeClock clock(options.compute_gate);
        std::exception_ptr error;
        PointsOptions of_index;
        of_index.threads = options.threads;
        keep_error(error, [&] { check_points(points); });
        agree_on(comm, "DistributedPoints, " + describe<Scalar>(options), error);
        holding.first = comm.sum_before(points.size());
        std::vector<Point> moved;
        if (options.partition == Partition::curve)
            moved = move_along_curve(points, holding.first, clock);
        else
            ids = GlobalIds(holding.first);
        std::vector<RankBox<Scalar>> boxes;
        keep_error(error, [&] {
            clock.run([&] {
                const bool is_moved = options.partition == Partition::curve;
                index = build_points(is_moved ? std::span<const Point>(moved) : points, of_index);
                boxes = top_boxes<Scalar>(index.arrays().tree, options.boxes_per_rank);
            });
        });
        agree(comm, error);
        tree = RankTree<Scalar>(comm, boxes);
        std::uint64_t sums[2] = {points.size(), left_out};
        comm.reduce(sums, 2, MPI_SUM);
        holding.size = sums[0];
        holding.left_out = sums[1];
        holding.local = index.size();
        holding.replicated_bytes = tree.bytes();
        holding.bytes = index.bytes() + ids.bytes() + tree.bytes();
        holding.report.traffic = comm.traffic();
        holding.report.compute_seconds = clock.seconds();
    }

    /// Counts what is left out; throws for what is refused.
    void check_points(std::span<const Point> points) {
        check_options(options);
        check_threads(options.threads);
        if (points.size() > std::size_t(std::numeric_limits<std::int32_t>::max()))
            throw InputError(std::to_string(points.size()) +
                             " points; a rank holds fewer than 2^31");
        for (std::size_t i = 0; i < points.size(); ++i) {
            if (is_taken(points[i])) continue;
            ++left_out;
            if (options.strict)
                throw InputError("point " + std::to_string(i) +
                                 " of this rank: not finite or out of range");
        }
    }

    [[nodiscard]] PointsView<Scalar> view() const { return {index, ids, tree, options.threads}; }

    template <class Region>
    PointRows<Scalar> within(const char* what, const std::string& call, const Region& region,
                             std::span<const typename Region::Query> queries, bool by_distance,
                             const QueryOptions& query_options) const;

    Communicator comm;
    Options options;
    PointIndex<Scalar, 3> index;
    GlobalIds ids;
    RankTree<Scalar> tree;
    std::uint64_t left_out = 0;
    Holding holding;
};

template <class Scalar>
BasicDistributedPoints<Scalar>::BasicDistributedPoints(MPI_Comm comm, std::span<const Point> points,
                                                       const Options& options)
    : state_(std::make_unique<State>(comm, options)) {
    const FloatEnvironment plain;
    state_->build(points);
}

template <class Scalar>
BasicDistributedPoints<Scalar>::~BasicDistributedPoints() = default;
template <class Scalar>
BasicDistributedPoints<Scalar>::BasicDistributedPoints(BasicDistributedPoints&&) noexcept = default;
template <class Scalar>
BasicDistributedPoints<Scalar>& BasicDistributedPoints<Scalar>::operator=(
    BasicDistributedPoints&&) noexcept = default;

template <class Scalar>
const Holding& BasicDistributedPoints<Scalar>::holding() const {
    return state_->holding;
}

template <class Scalar>
NearestRows<Scalar> BasicDistributedPoints<Scalar>::knn(std::span<const Point> queries,
                                                        std::uint32_t k,
                                                        const QueryOptions& options) const {
    const State& s = *state_;
    NearestRows<Scalar> rows;
    std::optional<NearestKind<Scalar>> kind;
    Call call(s.comm, s.options);
    call.begin<NearestKind<Scalar>>("knn, k " + std::to_string(k), [&] {
        if (k == 0) throw InputError("knn: k is 0; it must be at least 1");
        require_result_bytes("knn",
                             saturating_product(saturating_product(queries.size(), k),
                                                sizeof(std::uint64_t) + sizeof(Scalar)),
                             options.max_result_bytes);
        kind.emplace(s.view(), queries, k, rows);
        kind->clear();
    });
    call.run(*kind);
    call.finish([&] { kind->finish(); });
    rows.report = call.report();
    return rows;
}

namespace {

template <class Scalar>
struct PlaceRows {
    PointRows<Scalar>& rows;

    void make_room(std::uint64_t count) const {
        rows.indices.reset(count);
        rows.distances.reset(count);
        rows.counts.found = count;
    }
    void operator()(std::uint64_t place, const FoundGlobal<Scalar>& found) const {
        rows.indices[place] = found.id;
        rows.distances[place] = std::sqrt(found.d2);
    }
};

}  // namespace

template <class Scalar>
template <class Region>
PointRows<Scalar> BasicDistributedPoints<Scalar>::State::within(
    const char* what, const std::string& name, const Region& region,
    std::span<const typename Region::Query> queries, bool by_distance,
    const QueryOptions& query_options) const {
    using Found = FoundGlobal<Scalar>;
    using Kind = WithinKind<Scalar, Region>;
    PointRows<Scalar> rows;
    RowStore<Found> store(what, queries.size(), query_options.max_result_bytes);
    Kind kind(view(), region, queries, store);
    Call call(comm, options);
    call.begin<Kind>(name, [&] { check_not_negative("radius", region.least()); });
    call.run(kind);
    call.finish([&] {
        store.finish(
            rows.offsets, sizeof(std::uint64_t) + sizeof(Scalar),
            [by_distance](const Found& a, const Found& b) {
                if (by_distance && a.d2 != b.d2) return a.d2 < b.d2;
                return a.id < b.id;
            },
            PlaceRows<Scalar>{rows});
        rows.counts.queries = queries.size();
        for (const auto& query : queries) rows.counts.invalid_queries += !Region::is_valid(query);
    });
    rows.report = call.report();
    return rows;
}

template <class Scalar>
PointRows<Scalar> BasicDistributedPoints<Scalar>::radius(std::span<const Point> queries,
                                                         Scalar radius,
                                                         const QueryOptions& options) const {
    return state_->within("radius",
                          "radius, " + exact_text(radius) + (options.sort ? ", sorted" : ""),
                          BallRegion<Scalar>{radius}, queries, options.sort, options);
}

template <class Scalar>
PointRows<Scalar> BasicDistributedPoints<Scalar>::box(std::span<const Box> boxes,
                                                      const QueryOptions& options) const {
    return state_->within("box", "box", BoxRegion<Scalar>{}, boxes, false, options);
}

template class BasicDistributedPoints<float>;
template class BasicDistributedPoints<double>;

}  // namespace raydix::mpi
