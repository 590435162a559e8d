// Indices over points: one class for each scalar and number of coordinates.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <raydix/points.h>

#include <cstdint>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "arrays.h"
#include "asking.h"
#include "batch.h"
#include "bindings.h"
#include "lists.h"
#include "locks.h"

namespace raydix::python {
namespace {

/// An index that any number of threads ask and one changes.
template <class Index>
class SharedIndex {
public:
    explicit SharedIndex(Index index) : index_(std::move(index)) {}

    /// Held while the index is asked; changes wait for those who hold it, and let no new ones past.
    [[nodiscard]] Reading read() const { return Reading::in_turn("points", locks_); }
    /// While reading.
    [[nodiscard]] const Index& index() const { return index_; }
    /// call(index) alone, without the interpreter's lock. Throws InputError as Writing does.
    template <class Call>
    auto change(const char* name, const Call& call) {
        const nb::gil_scoped_release unlocked;
        const Writing lock(name, locks_);
        return call(index_);
    }

private:
    Index index_;
    mutable Locks locks_;
};

template <class Index>
struct PointCalls {
    using Shared = SharedIndex<Index>;
    using Scalar = typename Index::Scalar;
    using Point = typename Index::Point;
    using Box = typename Index::Box;
    static constexpr int dimension = Index::dimension;
    using PointRows = In<Scalar, nb::shape<-1, dimension>>;
    using BoxRows = In<Scalar, nb::shape<-1, 2 * dimension>>;
    using Values = In<Scalar, nb::ndim<1>>;
    using Lists = PointLists<Scalar>;

    static void make(Shared* self, const PointRows& points, const std::string& tree, bool strict,
                     int threads) {
        const PointsOptions options{
            .tree = points_tree_from_name(tree), .strict = strict, .threads = threads_for(threads)};
        const auto given = rows<Point>(points);
        const nb::gil_scoped_release unlocked;
        new (self) Shared(build_points(given, options));
    }

    static PointQueryOptions query_options(int threads, std::uint64_t max_result_bytes = 0,
                                           bool sort = false) {
        return {
            .threads = threads_for(threads), .sort = sort, .max_result_bytes = max_result_bytes};
    }

    static std::pair<std::uint64_t, std::uint64_t> nearest(
        const Shared& shared, const PointRows& queries,
        const Out<std::uint32_t, nb::ndim<2>>& indices, const Out<Scalar, nb::ndim<2>>& distances,
        double max_distance, int threads) {
        PointQueryOptions options = query_options(threads);
        options.max_distance = max_distance;
        const auto asked = rows<Point>(queries);
        const std::size_t k = indices.shape(1);
        if (indices.shape(0) != asked.size() || distances.shape(0) != asked.size() ||
            distances.shape(1) != k)
            throw nb::value_error("results have another shape than (queries, k)");
        std::pair<std::uint64_t, std::uint64_t> counts{0, 0};
        const Index& index = shared.index();
        read_in_pieces(shared, asked.size(), [&](std::size_t begin, std::size_t end) {
            const std::size_t first = begin * k, length = (end - begin) * k;
            const std::span ids(indices.data() + first, length);
            const std::span far(distances.data() + first, length);
            if (asked.size() == 1) {  // here, without set-up
                counts.first += knn(index, asked[0], ids, far, max_distance);
                return;
            }
            const QueryCounts met = knn(index, asked.subspan(begin, end - begin),
                                        static_cast<std::uint32_t>(k), ids, far, options);
            counts.first += met.found;
            counts.second += met.invalid_queries;
        });
        return counts;
    }

    /// search(options, begin, end) -> lists of these queries.
    template <class Search>
    static nb::tuple lists_in_pieces(const Shared& shared, const char* what, std::size_t queries,
                                     PointQueryOptions options, const Search& search) {
        PieceLimit limit(what, options.max_result_bytes);
        std::vector<Lists> pieces;
        const auto ask = [&](std::size_t begin, std::size_t end) {
            pieces.push_back(limit.next([&](std::uint64_t bytes) {
                options.max_result_bytes = bytes;
                return search(options, begin, end);
            }));
            limit.hold(
                piece_bytes(pieces.back(), &Lists::offsets, &Lists::indices, &Lists::distances));
        };
        read_in_pieces(shared, queries, ask, piece_size);  // one piece is not copied
        require_room_to_join(limit, pieces, &Lists::offsets, &Lists::indices, &Lists::distances);
        return lists_of(pieces);
    }

    static nb::tuple lists_of(std::vector<Lists>& pieces) {
        auto offsets = join_offsets(pieces);
        auto indices = hand_over(join_column(pieces, &Lists::indices));
        return nb::make_tuple(offsets, indices, hand_over(join_column(pieces, &Lists::distances)));
    }

    /// One radius for all, or one for each.
    static nb::tuple radius(const Shared& shared, const PointRows& queries, const Values& radii,
                            bool sort, std::uint64_t max_result_bytes, int threads) {
        const auto asked = rows<Point>(queries);
        const std::span all(radii.data(), radii.shape(0));
        if (all.size() != 1 && all.size() != asked.size())
            throw nb::value_error("radii have another length than the queries");
        const Index& index = shared.index();
        return lists_in_pieces(
            shared, "radius", asked.size(), query_options(threads, max_result_bytes, sort),
            [&](const PointQueryOptions& options, std::size_t begin, std::size_t end) {
                const auto part = asked.subspan(begin, end - begin);
                return all.size() == 1
                           ? radius_search(index, part, all[0], options)
                           : radius_search(index, part, all.subspan(begin, end - begin), options);
            });
    }

    static void count(const Shared& shared, const PointRows& queries, Scalar radius,
                      const Out<std::uint32_t, nb::ndim<1>>& out, int threads) {
        const auto asked = rows<Point>(queries);
        const std::span counts(out.data(), out.shape(0));
        if (counts.size() != asked.size())
            throw nb::value_error("counts have another length than the queries");
        read_in_pieces(shared, asked.size(), [&](std::size_t begin, std::size_t end) {
            radius_count(shared.index(), asked.subspan(begin, end - begin), radius,
                         counts.subspan(begin, end - begin), query_options(threads));
        });
    }

    static nb::tuple box(const Shared& shared, const BoxRows& boxes, std::uint64_t max_result_bytes,
                         int threads) {
        const auto asked = rows<Box>(boxes);
        const Index& index = shared.index();
        return lists_in_pieces(
            shared, "box", asked.size(), query_options(threads, max_result_bytes),
            [&](const PointQueryOptions& options, std::size_t begin, std::size_t end) {
                return box_search(index, asked.subspan(begin, end - begin), options);
            });
    }

    static nb::tuple neighbours(const Shared& shared, Scalar radius, bool full,
                                std::uint64_t max_result_bytes, int threads) {
        std::vector<Lists> pieces;
        {
            const nb::gil_scoped_release unlocked;
            const Reading lock = shared.read();
            pieces.push_back(neighbour_lists(shared.index(), radius,
                                             full ? PairRows::full : PairRows::half,
                                             query_options(threads, max_result_bytes)));
        }
        return lists_of(pieces);
    }

    static std::uint32_t insert(Shared& shared, const PointRows& points) {
        const auto given = rows<Point>(points);
        return shared.change("add", [&](Index& index) { return index.insert(given); });
    }

    static std::uint32_t remove(Shared& shared, const In<std::uint32_t, nb::ndim<1>>& ids) {
        const std::span given(ids.data(), ids.shape(0));
        return shared.change("remove", [&](Index& index) { return index.remove(given); });
    }

    /// What ask(index) gives, while it does not change.
    template <class Ask>
    static auto of_index(const Shared& shared, const Ask& ask) {
        const nb::gil_scoped_release unlocked;
        const Reading lock = shared.read();
        return ask(shared.index());
    }

    /// How many points were given, the numbers of those that are there, and these.
    static nb::tuple snapshot(const Shared& shared) {
        auto [given, order, points] = of_index(shared, [](const Index& index) {
            return std::tuple(index.input_count(), index.order(), index.points());
        });
        return nb::make_tuple(given, hand_over(std::move(order)),
                              hand_over_rows<Scalar>(std::move(points)));
    }

    static nb::dict stats(const Shared& shared) {
        Reading lock;
        {
            const nb::gil_scoped_release unlocked;
            lock = shared.read();
        }
        const Index& index = shared.index();
        nb::dict fields;
        fields["points"] = index.size();
        fields["left_out"] = index.left_out();
        fields["tree"] = std::string(points_tree_name(index.tree()));
        fields["leaves"] = index.leaf_count();
        fields["nodes"] = index.node_count();
        fields["depth"] = index.depth();
        fields["bytes"] = index.bytes();
        fields["peak_bytes"] = index.peak_bytes();
        const PointsBuildMs& ms = index.build_ms();
        nb::dict stages;
        stages["bounds"] = ms.bounds;
        stages["sort"] = ms.sort;
        stages["nodes"] = ms.nodes;
        stages["leaves"] = ms.leaves;
        stages["boxes"] = ms.boxes;
        stages["total"] = ms.total;
        fields["ms"] = stages;
        return fields;
    }

    static void bind(nb::module_& module, const char* name) {
        nb::class_<Shared>(module, name, "An index over points; raydix.Points is what to use.")
            .def("__init__", &make, nb::arg("points").noconvert(), nb::arg("tree"),
                 nb::arg("strict"), nb::arg("threads"))
            .def("knn", &nearest, nb::arg("queries").noconvert(), nb::arg("indices").noconvert(),
                 nb::arg("distances").noconvert(), nb::arg("max_distance"), nb::arg("threads") = 0)
            .def("radius", &radius, nb::arg("queries").noconvert(), nb::arg("radii").noconvert(),
                 nb::arg("sort") = false, nb::arg("max_result_bytes") = 0, nb::arg("threads") = 0)
            .def("count", &count, nb::arg("queries").noconvert(), nb::arg("radius"),
                 nb::arg("counts").noconvert(), nb::arg("threads") = 0)
            .def("box", &box, nb::arg("boxes").noconvert(), nb::arg("max_result_bytes") = 0,
                 nb::arg("threads") = 0)
            .def("neighbours", &neighbours, nb::arg("radius"), nb::arg("full"),
                 nb::arg("max_result_bytes") = 0, nb::arg("threads") = 0)
            .def("snapshot", &snapshot)
            .def("order",
                 [](const Shared& shared) {
                     return hand_over(of_index(shared, [](const Index& i) { return i.order(); }));
                 })
            .def("insert", &insert, nb::arg("points").noconvert())
            .def("remove", &remove, nb::arg("ids").noconvert())
            .def("stats", &stats)
            .def("__len__", [](const Shared& shared) {
                return of_index(shared, [](const Index& i) { return i.size(); });
            });
    }
};

}  // namespace

void bind_points(nb::module_& module) {
    PointCalls<Points>::bind(module, "PointIndex3f");
    PointCalls<Points2>::bind(module, "PointIndex2f");
    PointCalls<PointsD>::bind(module, "PointIndex3d");
    PointCalls<Points2D>::bind(module, "PointIndex2d");
}

}  // namespace raydix::python
