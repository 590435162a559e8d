// Points over ranks: one class for each scalar. Every call is collective.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <cstdint>
#include <utility>

#include "arrays.h"
#include "mpi_bindings.h"

namespace raydix::python {
namespace {

template <class T>
struct PointCalls {
    using Points = mpi::BasicDistributedPoints<T>;
    using Point = typename Points::Point;
    using Box = typename Points::Box;
    using PointRows = In<T, nb::shape<-1, 3>>;
    using BoxRows = In<T, nb::shape<-1, 6>>;

    static void make(Points* self, int comm, const PointRows& points, const OptionValues& values) {
        mpi::Options options;
        set_options(options, values);
        const nb::gil_scoped_release unlocked;
        new (self) Points(communicator_of(comm), rows<Point>(points), options);
    }

    /// Numbers, distances, figures.
    static nb::tuple nearest(const Points& points, const PointRows& queries, std::uint32_t k,
                             std::uint64_t max_result_bytes) {
        auto found = unlocked([&] {
            return points.knn(rows<Point>(queries), k, {.max_result_bytes = max_result_bytes});
        });
        return nb::make_tuple(hand_over(std::move(found.indices)),
                              hand_over(std::move(found.distances)), figures_of(found.report));
    }
    static nb::tuple radius(const Points& points, const PointRows& queries, T radius, bool sort,
                            std::uint64_t max_result_bytes) {
        return lists_of(unlocked([&] {
            return points.radius(rows<Point>(queries), radius,
                                 {.sort = sort, .max_result_bytes = max_result_bytes});
        }));
    }
    static nb::tuple box(const Points& points, const BoxRows& boxes,
                         std::uint64_t max_result_bytes) {
        return lists_of(unlocked(
            [&] { return points.box(rows<Box>(boxes), {.max_result_bytes = max_result_bytes}); }));
    }

    static void bind(nb::module_& module, const char* name) {
        nb::class_<Points>(module, name, "Points over ranks; raydix.mpi.DistributedPoints is it.")
            .def("__init__", &make, nb::arg("comm"), nb::arg("points").noconvert(),
                 nb::arg("options"))
            .def("holding", [](const Points& points) { return figures_of(points.holding()); })
            .def("knn", &nearest, nb::arg("queries").noconvert(), nb::arg("k"),
                 nb::arg("max_result_bytes"))
            .def("radius", &radius, nb::arg("queries").noconvert(), nb::arg("radius"),
                 nb::arg("sort"), nb::arg("max_result_bytes"))
            .def("box", &box, nb::arg("boxes").noconvert(), nb::arg("max_result_bytes"));
    }

private:
    /// Offsets, numbers, distances, figures.
    static nb::tuple lists_of(mpi::PointRows<T> lists) {
        return nb::make_tuple(hand_over(std::move(lists.offsets)),
                              hand_over(std::move(lists.indices)),
                              hand_over(std::move(lists.distances)), figures_of(lists.report));
    }
};

}  // namespace

void bind_distributed_points(nb::module_& module) {
    PointCalls<float>::bind(module, "DistributedPointsF");
    PointCalls<double>::bind(module, "DistributedPointsD");
}

}  // namespace raydix::python
