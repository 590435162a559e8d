// Indices over points: one class for each scalar and number of coordinates.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <raydix/points.h>

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "arrays.h"
#include "batch.h"
#include "bindings.h"
#include "lists.h"

namespace raydix::python {
namespace {

template <class Index>
struct PointCalls {
    using Scalar = typename Index::Scalar;
    using Point = typename Index::Point;
    using Box = typename Index::Box;
    static constexpr int dimension = Index::dimension;
    using PointRows = In<Scalar, nb::shape<-1, dimension>>;
    using BoxRows = In<Scalar, nb::shape<-1, 2 * dimension>>;
    using Values = In<Scalar, nb::ndim<1>>;
    using Lists = PointLists<Scalar>;

    static void make(Index* self, const PointRows& points, const std::string& tree, bool strict,
                     int threads) {
        const PointsOptions options{
            .tree = points_tree_from_name(tree), .strict = strict, .threads = threads_for(threads)};
        const auto given = rows<Point>(points);
        const nb::gil_scoped_release unlocked;
        new (self) Index(build_points(given, options));
    }

    static PointQueryOptions query_options(int threads, std::uint64_t max_result_bytes = 0,
                                           bool sort = false) {
        return {
            .threads = threads_for(threads), .sort = sort, .max_result_bytes = max_result_bytes};
    }

    static std::pair<std::uint64_t, std::uint64_t> nearest(
        const Index& index, const PointRows& queries,
        const Out<std::uint32_t, nb::ndim<2>>& indices, const Out<Scalar, nb::ndim<2>>& distances,
        int threads) {
        const auto asked = rows<Point>(queries);
        const std::size_t k = indices.shape(1);
        if (indices.shape(0) != asked.size() || distances.shape(0) != asked.size() ||
            distances.shape(1) != k)
            throw nb::value_error("results have another shape than (queries, k)");
        std::pair<std::uint64_t, std::uint64_t> counts{0, 0};
        in_pieces(asked.size(), [&](std::size_t begin, std::size_t end) {
            const std::size_t first = begin * k, length = (end - begin) * k;
            const std::span ids(indices.data() + first, length);
            const std::span far(distances.data() + first, length);
            if (asked.size() == 1) {  // on the caller's thread: no set-up
                counts.first += knn(index, asked[0], ids, far);
                return;
            }
            const PointQueryCounts met =
                knn(index, asked.subspan(begin, end - begin), static_cast<std::uint32_t>(k), ids,
                    far, query_options(threads));
            counts.first += met.found;
            counts.second += met.invalid_queries;
        });
        return counts;
    }

    /// search(options, begin, end) -> lists of these queries.
    template <class Search>
    static nb::tuple lists_in_pieces(const char* what, std::size_t queries,
                                     PointQueryOptions options, const Search& search) {
        PieceLimit limit(what, options.max_result_bytes);
        std::vector<Lists> pieces;
        in_pieces(queries, [&](std::size_t begin, std::size_t end) {
            pieces.push_back(limit.next([&](std::uint64_t bytes) {
                options.max_result_bytes = bytes;
                return search(options, begin, end);
            }));
            limit.hold(
                piece_bytes(pieces.back(), &Lists::offsets, &Lists::indices, &Lists::distances));
        });
        require_room_to_join(limit, pieces, &Lists::offsets, &Lists::indices, &Lists::distances);
        return lists_of(pieces);
    }

    static nb::tuple lists_of(std::vector<Lists>& pieces) {
        auto offsets = join_offsets(pieces);
        auto indices = hand_over(join_column(pieces, &Lists::indices));
        return nb::make_tuple(offsets, indices, hand_over(join_column(pieces, &Lists::distances)));
    }

    /// One radius for all, or one for each.
    static nb::tuple radius(const Index& index, const PointRows& queries, const Values& radii,
                            bool sort, std::uint64_t max_result_bytes, int threads) {
        const auto asked = rows<Point>(queries);
        const std::span all(radii.data(), radii.shape(0));
        if (all.size() != 1 && all.size() != asked.size())
            throw nb::value_error("radii have another length than the queries");
        return lists_in_pieces(
            "radius", asked.size(), query_options(threads, max_result_bytes, sort),
            [&](const PointQueryOptions& options, std::size_t begin, std::size_t end) {
                const auto part = asked.subspan(begin, end - begin);
                return all.size() == 1
                           ? radius_search(index, part, all[0], options)
                           : radius_search(index, part, all.subspan(begin, end - begin), options);
            });
    }

    static void count(const Index& index, const PointRows& queries, Scalar radius,
                      const Out<std::uint32_t, nb::ndim<1>>& out, int threads) {
        const auto asked = rows<Point>(queries);
        const std::span counts(out.data(), out.shape(0));
        if (counts.size() != asked.size())
            throw nb::value_error("counts have another length than the queries");
        in_pieces(asked.size(), [&](std::size_t begin, std::size_t end) {
            radius_count(index, asked.subspan(begin, end - begin), radius,
                         counts.subspan(begin, end - begin), query_options(threads));
        });
    }

    static nb::tuple box(const Index& index, const BoxRows& boxes, std::uint64_t max_result_bytes,
                         int threads) {
        const auto asked = rows<Box>(boxes);
        return lists_in_pieces(
            "box", asked.size(), query_options(threads, max_result_bytes),
            [&](const PointQueryOptions& options, std::size_t begin, std::size_t end) {
                return box_search(index, asked.subspan(begin, end - begin), options);
            });
    }

    static nb::tuple neighbours(const Index& index, Scalar radius, bool full,
                                std::uint64_t max_result_bytes, int threads) {
        std::vector<Lists> pieces;
        {
            const nb::gil_scoped_release unlocked;
            pieces.push_back(neighbour_lists(index, radius, full ? PairRows::full : PairRows::half,
                                             query_options(threads, max_result_bytes)));
        }
        return lists_of(pieces);
    }

    static nb::dict stats(const Index& index) {
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
        nb::class_<Index>(module, name, "An index over points; raydix.Points is what to use.")
            .def("__init__", &make, nb::arg("points").noconvert(), nb::arg("tree"),
                 nb::arg("strict"), nb::arg("threads"))
            .def("knn", &nearest, nb::arg("queries").noconvert(), nb::arg("indices").noconvert(),
                 nb::arg("distances").noconvert(), nb::arg("threads") = 0)
            .def("radius", &radius, nb::arg("queries").noconvert(), nb::arg("radii").noconvert(),
                 nb::arg("sort") = false, nb::arg("max_result_bytes") = 0, nb::arg("threads") = 0)
            .def("count", &count, nb::arg("queries").noconvert(), nb::arg("radius"),
                 nb::arg("counts").noconvert(), nb::arg("threads") = 0)
            .def("box", &box, nb::arg("boxes").noconvert(), nb::arg("max_result_bytes") = 0,
                 nb::arg("threads") = 0)
            .def("neighbours", &neighbours, nb::arg("radius"), nb::arg("full"),
                 nb::arg("max_result_bytes") = 0, nb::arg("threads") = 0)
            .def("order", [](const Index& index) { return hand_over(index.order()); })
            .def("points",
                 [](const Index& index) { return hand_over_rows<Scalar>(index.points()); })
            .def("stats", &stats)
            .def("__len__", [](const Index& index) { return index.size(); });
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
