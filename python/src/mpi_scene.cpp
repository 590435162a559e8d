// Scenes over ranks: one class for each scalar. Every call is collective. Hits and closest points
// come as bytes of the library's structs, one row each.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/variant.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "arrays.h"
#include "mpi_bindings.h"
#include "ray_parts.h"
#include "scene_handle.h"

namespace raydix::python {
namespace {

template <class T>
struct SceneCalls {
    /// With what the meshes of placed scenes lie in.
    struct Scene : mpi::BasicDistributedScene<T> {
        using mpi::BasicDistributedScene<T>::BasicDistributedScene;
        std::vector<std::shared_ptr<const void>> arrays;
    };
    using Geometry = typename Scene::Geometry;
    using Point = typename Scene::Point;
    using PointRows = In<T, nb::shape<-1, 3>>;
    using ShapeRows = In<T, nb::ndim<2>>;
    using TransformRow = In<T, nb::shape<1, 12>>;
    using Masks = std::optional<In<std::uint32_t, nb::ndim<1>>>;

    /// Arrays that geometries point into, as long as they are needed.
    struct Given {
        std::vector<Geometry> geometries;
        std::vector<PointRows> vertices;
        std::vector<FacesIn> faces;
        std::vector<ShapeRows> shapes;
        std::vector<std::pair<std::size_t, LendScene<T>>> placed;  // of which geometry

        /// What it is, the mask, and: vertices and faces; what lend() of a scene's core gave and a
        /// transform; rows of spheres or capsules.
        void add(const nb::tuple& one) {
            const auto kind = nb::cast<std::string>(one[0]);
            Geometry& geometry = geometries.emplace_back();
            geometry.mask = nb::cast<std::uint32_t>(one[1]);
            if (kind == "instance") {
                placed.emplace_back(geometries.size() - 1,
                                    *static_cast<const LendScene<T>*>(
                                        nb::cast<nb::capsule>(one[2]).data(scene_name<T>)));
                geometry.transform = rows<BasicTransform<T>>(nb::cast<TransformRow>(one[3]))[0];
            } else if (kind == "mesh") {
                vertices.push_back(nb::cast<PointRows>(one[2]));
                faces.push_back(nb::cast<FacesIn>(one[3]));
                geometry.mesh = {rows<Point>(vertices.back()), rows<Triangle>(faces.back())};
            } else {
                shapes.push_back(nb::cast<ShapeRows>(one[2]));
                if (kind == "capsules")
                    geometry.capsules = shapes_of<BasicCapsule<T>>(shapes.back());
                else
                    geometry.spheres = shapes_of<BasicSphere<T>>(shapes.back());
            }
        }
        /// Without the interpreter's lock: placed scenes, as long as the result lives.
        [[nodiscard]] std::vector<LentScene<T>> borrow() {
            std::vector<LentScene<T>> lent;
            for (const auto& [at, lend] : placed)
                geometries[at].scene = lent.emplace_back(lend()).scene;
            return lent;
        }
        template <class Shape>
        static std::span<const Shape> shapes_of(const ShapeRows& given) {
            if (given.shape(1) * sizeof(T) != sizeof(Shape))
                throw nb::value_error("a row has another length than the shape");
            return rows<Shape>(given);
        }
    };

    static void make(Scene* self, int comm, const nb::list& geometries, const OptionValues& values,
                     bool one_geometry, int quality) {
        mpi::SceneOptions options;
        set_options(options, values);
        options.one_geometry = one_geometry;
        options.quality = static_cast<Quality>(quality);
        Given given;
        for (const nb::handle one : geometries) given.add(nb::cast<nb::tuple>(one));
        const nb::gil_scoped_release released;
        const std::vector<LentScene<T>> lent = given.borrow();
        std::vector<std::shared_ptr<const void>> arrays;
        for (const LentScene<T>& one : lent) arrays.push_back(one.arrays);
        new (self)
            Scene(communicator_of(comm), std::span<const Geometry>(given.geometries), options);
        self->arrays = std::move(arrays);
    }

    static mpi::BasicTraceOptions<T> trace_options(std::uint32_t mask, const Masks& masks) {
        mpi::BasicTraceOptions<T> options{.mask = mask};
        if (masks) options.masks = {masks->data(), masks->shape(0)};
        return options;
    }

    template <class Rays>
    static nb::tuple trace(const Scene& scene, Rays& rays, std::uint32_t mask, const Masks& masks) {
        auto found = unlocked(
            [&] { return scene.trace(rays.piece(0, rays.size()), trace_options(mask, masks)); });
        return nb::make_tuple(hand_over_rows<std::uint8_t>(std::move(found.values)),
                              figures_of(found.report));
    }
    template <class Rays>
    static nb::tuple trace_any(const Scene& scene, Rays& rays, std::uint32_t mask,
                               const Masks& masks) {
        auto found = unlocked([&] {
            return scene.trace_any(rays.piece(0, rays.size()), trace_options(mask, masks));
        });
        return nb::make_tuple(hand_over(std::move(found.values)), figures_of(found.report));
    }
    template <class Rays>
    static nb::tuple trace_all(const Scene& scene, Rays& rays, std::uint32_t mask,
                               const Masks& masks, std::uint64_t max_result_bytes) {
        mpi::BasicTraceOptions<T> options = trace_options(mask, masks);
        options.max_result_bytes = max_result_bytes;
        auto found = unlocked([&] { return scene.trace_all(rays.piece(0, rays.size()), options); });
        return nb::make_tuple(hand_over(std::move(found.offsets)),
                              hand_over_rows<std::uint8_t>(std::move(found.hits)),
                              figures_of(found.report));
    }
    static nb::tuple closest(const Scene& scene, const PointRows& points, T max_distance,
                             std::uint32_t mask) {
        auto found =
            unlocked([&] { return scene.closest_points(rows<Point>(points), max_distance, mask); });
        return nb::make_tuple(hand_over_rows<std::uint8_t>(std::move(found.values)),
                              figures_of(found.report));
    }
    static nb::tuple inside(const Scene& scene, const PointRows& points) {
        auto found = unlocked([&] { return scene.contains(rows<Point>(points)); });
        return nb::make_tuple(hand_over(std::move(found.values)), figures_of(found.report));
    }

    static void bind(nb::module_& module, const char* name) {
        using Ray = typename Scene::Ray;
        nb::class_<Scene> scene(module, name,
                                "A scene over ranks; raydix.mpi.DistributedScene is it.");
        scene
            .def("__init__", &make, nb::arg("comm"), nb::arg("geometries"), nb::arg("options"),
                 nb::arg("one_geometry"), nb::arg("quality"))
            .def("holding", [](const Scene& self) { return figures_of(self.holding()); })
            .def("closest_points", &closest, nb::arg("points").noconvert(), nb::arg("max_distance"),
                 nb::arg("mask"))
            .def("contains", &inside, nb::arg("points").noconvert());
        const auto mask = nb::arg("mask");
        const auto masks = nb::arg("masks").noconvert().none();
        def_for_rays<Ray>(
            scene, "trace",
            [](const Scene& self, auto& rays, std::uint32_t all, const Masks& each) {
                return trace(self, rays, all, each);
            },
            MoreArguments<std::uint32_t, const Masks&>(), mask, masks);
        def_for_rays<Ray>(
            scene, "trace_any",
            [](const Scene& self, auto& rays, std::uint32_t all, const Masks& each) {
                return trace_any(self, rays, all, each);
            },
            MoreArguments<std::uint32_t, const Masks&>(), mask, masks);
        def_for_rays<Ray>(
            scene, "trace_all",
            [](const Scene& self, auto& rays, std::uint32_t all, const Masks& each,
               std::uint64_t max_result_bytes) {
                return trace_all(self, rays, all, each, max_result_bytes);
            },
            MoreArguments<std::uint32_t, const Masks&, std::uint64_t>(), mask, masks,
            nb::arg("max_result_bytes"));
    }
};

}  // namespace

void bind_distributed_scene(nb::module_& module) {
    SceneCalls<float>::bind(module, "DistributedSceneF");
    SceneCalls<double>::bind(module, "DistributedSceneD");
}

}  // namespace raydix::python
