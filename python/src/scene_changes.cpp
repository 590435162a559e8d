// Scenes made, changed and committed.
#include "scene_changes.h"

#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>
#include <raydix/camera.h>
#include <raydix/error.h>
#include <raydix/model.h>
#include <raydix/rdx.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "arrays.h"
#include "asking.h"
#include "batch.h"
#include "bindings.h"
#include "figures.h"

namespace raydix::python {
namespace {

using Ids = In<std::uint32_t, nb::ndim<1>>;
template <class Scene>
using TransformRows = In<typename Scene::Types::Scalar, nb::shape<-1, 12>>;
static_assert(sizeof(Transform) == 12 * sizeof(float));
static_assert(sizeof(TransformD) == 12 * sizeof(double));

BuildOptions build_options(const std::string& builder, int reinsertion_rounds, int bits,
                           int max_leaf, bool strict, int threads) {
    return {.builder = builder_from_name(builder),
            .bits = bits,
            .max_leaf = max_leaf,
            .strict = strict,
            .threads = threads,
            .reinsertion_rounds = reinsertion_rounds};
}

template <class Value, std::size_t count>
Value value_of(const char* what, const std::string& name,
               const std::pair<const char*, Value> (&known)[count]) {
    std::string all;
    for (const auto& [known_name, value] : known) {
        if (name == known_name) return value;
        all += (all.empty() ? "" : ", ") + std::string(known_name);
    }
    throw InputError(std::string(what) + ": expected one of " + all + ", given \"" + name + "\"");
}

Quality quality_of(const std::string& name) {
    return value_of<Quality>(
        "quality", name,
        {{"fast", Quality::fast}, {"balanced", Quality::balanced}, {"high", Quality::high}});
}

Usage usage_of(const std::string& name) {
    return value_of<Usage>("usage", name, {{"fixed", Usage::fixed}, {"moving", Usage::moving}});
}

SceneOptions scene_options(const std::string& quality, const std::string& usage, bool compact,
                           bool strict, int threads) {
    return {.quality = quality_of(quality),
            .usage = usage_of(usage),
            .compact = compact,
            .strict = strict,
            .threads = threads};
}

/// The caller's arrays, copied.
template <class Names, class Points>
MeshArrays<Names> copy_of(const Points& vertices, const FacesIn& faces) {
    using Arrays = MeshArrays<Names>;
    const auto corners = rows<typename Names::Point>(vertices);
    const auto triangles = rows<Triangle>(faces);
    return {std::make_shared<const typename Arrays::Vertices>(corners.begin(), corners.end()),
            std::make_shared<const typename Arrays::Triangles>(triangles.begin(), triangles.end())};
}

/// call() without the interpreter's lock, while the scene stays as it is.
template <class Scene, class Call>
auto while_reading(Scene& scene, const Call& call) {
    const nb::gil_scoped_release unlocked;
    const Reading lock = scene.read();
    return call();
}

/// Of the last commit, by the names that Python gives them.
template <class Scene>
nb::dict commit_options(Scene& scene) {
    const SceneOptions options = while_reading(scene, [&] { return scene.commit_options(); });
    nb::dict fields;
    fields["quality"] = options.quality == Quality::fast   ? "fast"
                        : options.quality == Quality::high ? "high"
                                                           : "balanced";
    fields["usage"] = options.usage == Usage::moving ? "moving" : "fixed";
    fields["compact"] = options.compact;
    return fields;
}

template <class Scene, class AnyCamera>
nb::tuple named(const std::shared_ptr<Scene>& scene, const std::string& name,
                const std::vector<AnyCamera>& shown) {
    nb::list cameras;
    for (const AnyCamera& camera : shown) cameras.append(camera_figures(camera));
    return nb::make_tuple(scene, text_of(name), cameras);
}

/// What a file holds, and what belongs to it.
nb::tuple load(const nb::bytes& file, std::uint64_t seed, const std::string& builder,
               int reinsertion_rounds, int bits, int max_leaf, bool strict, int threads,
               const std::string& quality, const std::string& usage, bool compact) {
    const BuildOptions trees =
        build_options(builder, reinsertion_rounds, bits, max_leaf, strict, threads);
    const SceneOptions commits = scene_options(quality, usage, compact, strict, threads);
    const std::string spec = path_of(file);
    std::string name, cameras_fault;
    std::vector<Camera> shown;
    std::shared_ptr<SceneTrees> scene;
    {
        const nb::gil_scoped_release unlocked;
        Model model = load_model(spec, seed);
        name = model.name;
        cameras_fault = model.cameras_fault;
        shown = std::move(model.cameras.cameras);
        scene = SceneFiles::scene_of(std::move(model), trees, commits);
    }
    warn_of_cameras(cameras_fault);
    return named(scene, name, shown);
}

RdxScene load_rdx(const std::string& file, const SceneTrees*) { return load_rdx_scene(file); }
RdxSceneD load_rdx(const std::string& file, const SceneTreesD*) {
    return load_rdx_scene_double(file);
}

/// The same of a .rdx file, with the options that it was saved with.
template <class Scene>
nb::tuple load_saved(const nb::bytes& path, int threads) {
    using Names = typename Scene::Types;
    std::string name;
    decltype(Names::CameraSet::cameras) shown;
    std::shared_ptr<Scene> scene;
    const std::string file = path_of(path);
    {
        const nb::gil_scoped_release unlocked;
        auto loaded = load_rdx(file, static_cast<const Scene*>(nullptr));
        name = loaded.name;
        shown = std::move(loaded.cameras.cameras);
        loaded.options.threads = threads;
        BuildOptions trees = build_options_for(loaded.options.quality);
        trees.threads = threads;
        scene = SceneFiles::scene_of_rdx<Names>(std::move(loaded), trees);
    }
    return named(scene, name, shown);
}

template <class Scene>
void save(Scene& self, const nb::bytes& path, const std::string& name,
          const std::vector<CameraFields<typename Scene::Types::Scalar>>& cameras) {
    typename Scene::Types::CameraSet shown;
    for (const auto& camera : cameras) shown.cameras.push_back(camera_of(camera));
    const std::string file = path_of(path);
    while_reading(self, [&] { save_rdx(file, self.traced(), name, shown); });
}

template <class Scene>
std::vector<std::uint32_t> add_instances(Scene& self, std::shared_ptr<Scene> scene,
                                         const TransformRows<Scene>& transforms, const Ids& masks,
                                         std::optional<std::uint32_t> id) {
    const auto places = rows<typename Scene::Transform>(transforms);
    const nb::gil_scoped_release unlocked;
    return self.add(std::move(scene), places, {masks.data(), masks.shape(0)}, id);
}

template <class Scene>
std::uint32_t add_mesh(Scene& self, const PointRows<Scene>& vertices, const FacesIn& faces,
                       std::uint32_t mask, std::optional<std::uint32_t> id) {
    const nb::gil_scoped_release unlocked;
    return self.add(copy_of<typename Scene::Types>(vertices, faces), {mask, id});
}

template <class Scene>
void update(Scene& self, std::uint32_t id, const PointRows<Scene>& vertices,
            const std::optional<FacesIn>& faces) {
    const auto corners = rows<typename Scene::Types::Point>(vertices);
    const nb::gil_scoped_release unlocked;
    std::optional<std::vector<Triangle>> triangles;
    if (faces) {
        const auto given = rows<Triangle>(*faces);
        triangles.emplace(given.begin(), given.end());
    }
    self.update(id, {corners.begin(), corners.end()}, std::move(triangles));
}

template <class Scene>
void set_transforms(Scene& self, const Ids& ids, const TransformRows<Scene>& transforms) {
    const auto places = rows<typename Scene::Transform>(transforms);
    const nb::gil_scoped_release unlocked;
    self.set_transforms({ids.data(), ids.shape(0)}, places);
}

template <class Scene>
void set_masks(Scene& self, const Ids& ids, const Ids& masks) {
    const nb::gil_scoped_release unlocked;
    self.set_masks({ids.data(), ids.shape(0)}, {masks.data(), masks.shape(0)});
}

/// What a commit calls from any thread, without the interpreter's lock, with the part of it that is
/// done: signals are heard on this thread, and `told`, if there is one, which outlives the commit.
std::function<void(double)> tell(const std::optional<nb::callable>& told) {
    return [hear = hear_signals_on_this_thread(), &told](double part) {
        hear(part);
        if (!told) return;
        const Writing::OnThread changing;
        const nb::gil_scoped_acquire locked;
        (*told)(part);
    };
}

/// What is left out stays as in the last commit.
template <class Scene>
nb::dict commit(Scene& self, const std::optional<std::string>& quality,
                const std::optional<std::string>& usage, std::optional<bool> compact,
                std::optional<double> refit_limit, std::optional<int> threads,
                const std::optional<nb::callable>& progress) {
    CommitReport report;
    {
        const nb::gil_scoped_release unlocked;
        SceneOptions options = [&] {
            const Reading lock = self.read();
            return self.commit_options();
        }();
        if (quality) options.quality = quality_of(*quality);
        if (usage) options.usage = usage_of(*usage);
        options.compact = compact.value_or(options.compact);
        options.refit_limit = refit_limit.value_or(options.refit_limit);
        options.threads = threads.value_or(options.threads);
        options.progress = tell(progress);
        report = self.commit(options);
    }
    return commit_figures(report);
}

template <class Scene>
nb::dict refit(Scene& scene, const PointRows<Scene>& vertices, int threads) {
    const auto corners = rows<typename Scene::Types::Point>(vertices);
    RefitQuality quality;
    {
        const nb::gil_scoped_release unlocked;
        quality = scene.refit({corners.begin(), corners.end()}, threads);
    }
    nb::dict fields;
    fields["sah"] = quality.sah;
    fields["sah_at_build"] = quality.sah_at_build;
    fields["ratio"] = quality.ratio;
    return fields;
}

/// `with scene.held():` calls of this thread see one commit, whatever other threads do.
template <class Scene>
class Held {
public:
    explicit Held(std::shared_ptr<Scene> scene) : scene_(std::move(scene)) {}
    void enter() {
        const nb::gil_scoped_release unlocked;
        lock_ = scene_->read();
    }
    void leave() { lock_ = {}; }

private:
    std::shared_ptr<Scene> scene_;
    Reading lock_;
};

template <class Scene>
void bind_held(nb::class_<Scene>& scene) {
    nb::class_<Held<Scene>>(scene, "Held")
        .def("__enter__", &Held<Scene>::enter)
        .def("__exit__", [](Held<Scene>& self, const nb::args&) { self.leave(); });
    scene.def("held", [](std::shared_ptr<Scene> self) { return Held<Scene>(std::move(self)); });
}

/// What a scene of either type says of itself.
template <class Scene>
void bind_contents(nb::class_<Scene>& scene) {
    scene.def("ids", [](Scene& self) { return while_reading(self, [&] { return self.ids(); }); })
        .def("ids_given",
             [](Scene& self) { return while_reading(self, [&] { return self.ids_given(); }); })
        .def("__len__",
             [](Scene& self) { return while_reading(self, [&] { return self.ids().size(); }); })
        .def("__contains__",
             [](Scene& self, std::uint32_t id) {
                 return while_reading(self, [&] { return self.contains(id); });
             })
        .def("is_mesh",
             [](Scene& self) { return while_reading(self, [&] { return self.is_mesh(); }); });
}

template <class Scene>
void bind_commits(nb::class_<Scene>& scene) {
    scene
        .def("commit", &commit<Scene>, nb::arg("quality").none(), nb::arg("usage").none(),
             nb::arg("compact").none(), nb::arg("refit_limit").none(), nb::arg("threads").none(),
             nb::arg("progress").none())
        .def("refit", &refit<Scene>, nb::arg("vertices").noconvert(), nb::arg("threads") = 0)
        .def("commit_options", &commit_options<Scene>)
        .def("refit_limit",
             [](Scene& self) {
                 return while_reading(self, [&] { return self.commit_options().refit_limit; });
             })
        .def(
            "set_options",
            [](Scene& self, const std::string& builder, int reinsertion_rounds, int bits,
               int max_leaf, bool strict, int threads, double refit_limit) {
                const nb::gil_scoped_release unlocked;
                self.set_options(
                    build_options(builder, reinsertion_rounds, bits, max_leaf, strict, threads),
                    refit_limit);
            },
            nb::arg("builder"), nb::arg("reinsertion_rounds"), nb::arg("bits"), nb::arg("max_leaf"),
            nb::arg("strict"), nb::arg("threads"), nb::arg("refit_limit"))
        .def("committed",
             [](Scene& self) { return while_reading(self, [&] { return self.committed(); }); })
        .def("bounds",
             [](Scene& self) {
                 return corners(while_reading(self, [&] { return self.traced().bounds(); }));
             })
        .def(
            "path",
            [](Scene& self, std::uint32_t number) {
                return while_reading(self, [&] { return self.traced().path(number); });
            },
            nb::arg("number"));
}

template <class Scene>
void bind_making(nb::class_<Scene>& scene) {
    scene.def(
        "__init__",
        [](Scene* self, const std::string& builder, int reinsertion_rounds, int bits, int max_leaf,
           bool strict, int threads, const std::string& quality, const std::string& usage,
           bool compact) {
            new (self)
                Scene(build_options(builder, reinsertion_rounds, bits, max_leaf, strict, threads),
                      scene_options(quality, usage, compact, strict, threads));
        },
        nb::arg("builder"), nb::arg("reinsertion_rounds"), nb::arg("bits"), nb::arg("max_leaf"),
        nb::arg("strict"), nb::arg("threads"), nb::arg("quality"), nb::arg("usage"),
        nb::arg("compact"));
    scene.def(
        "__init__",
        [](Scene* self, const PointRows<Scene>& vertices, const FacesIn& faces,
           const std::string& builder, int reinsertion_rounds, int bits, int max_leaf, bool strict,
           int threads, const std::string& quality, const std::string& usage, bool compact) {
            const nb::gil_scoped_release unlocked;
            new (self)
                Scene(copy_of<typename Scene::Types>(vertices, faces),
                      build_options(builder, reinsertion_rounds, bits, max_leaf, strict, threads),
                      scene_options(quality, usage, compact, strict, threads));
        },
        nb::arg("vertices").noconvert(), nb::arg("faces").noconvert(), nb::arg("builder"),
        nb::arg("reinsertion_rounds"), nb::arg("bits"), nb::arg("max_leaf"), nb::arg("strict"),
        nb::arg("threads"), nb::arg("quality"), nb::arg("usage"), nb::arg("compact"));
}

}  // namespace

template <class Scene>
void bind_changes(nb::class_<Scene>& scene) {
    bind_making(scene);
    scene
        .def("add_mesh", &add_mesh<Scene>, nb::arg("vertices").noconvert(),
             nb::arg("faces").noconvert(), nb::arg("mask"), nb::arg("id").none())
        .def("add_instances", &add_instances<Scene>, nb::arg("scene"),
             nb::arg("transforms").noconvert(), nb::arg("masks").noconvert(), nb::arg("id").none())
        .def(
            "remove",
            [](Scene& self, std::uint32_t id) {
                const nb::gil_scoped_release unlocked;
                self.remove(id);
            },
            nb::arg("id"))
        .def("update", &update<Scene>, nb::arg("id"), nb::arg("vertices").noconvert(),
             nb::arg("faces").noconvert().none())
        .def("set_transforms", &set_transforms<Scene>, nb::arg("ids").noconvert(),
             nb::arg("transforms").noconvert())
        .def("set_masks", &set_masks<Scene>, nb::arg("ids").noconvert(),
             nb::arg("masks").noconvert());
    bind_held(scene);
    bind_contents(scene);
    bind_commits(scene);
}

template void bind_changes(nb::class_<SceneTrees>& scene);
template void bind_changes(nb::class_<SceneTreesD>& scene);

namespace {

/// Rows of numbers that are one shape each.
template <class Shape, class Scene>
using ShapeRows = In<Scalar<Scene>, nb::shape<-1, sizeof(Shape) / sizeof(Scalar<Scene>)>>;

template <class Shape, class Scene>
void bind_shapes_of_a_kind(nb::class_<Scene>& scene, const char* add, const char* update) {
    scene
        .def(
            add,
            [](Scene& self, const ShapeRows<Shape, Scene>& shapes, std::uint32_t mask,
               std::optional<std::uint32_t> id) {
                const auto all = rows<Shape>(shapes);
                const nb::gil_scoped_release unlocked;
                return self.add_shapes(
                    [&](auto& to, const GeometryOptions& options) { return to.add(all, options); },
                    {mask, id});
            },
            nb::arg("shapes").noconvert(), nb::arg("mask"), nb::arg("id").none())
        .def(
            update,
            [](Scene& self, std::uint32_t id, const ShapeRows<Shape, Scene>& shapes) {
                const auto all = rows<Shape>(shapes);
                const nb::gil_scoped_release unlocked;
                self.update_shapes([&](auto& of, std::uint32_t which) { of.update(which, all); },
                                   id);
            },
            nb::arg("id"), nb::arg("shapes").noconvert());
}

/// Points of one radius.
template <class Scene>
void bind_balls(nb::class_<Scene>& scene) {
    using Point = typename Scene::Types::Point;
    scene
        .def(
            "add_points",
            [](Scene& self, const PointRows<Scene>& points, Scalar<Scene> radius,
               std::uint32_t mask, std::optional<std::uint32_t> id) {
                const auto all = rows<Point>(points);
                const nb::gil_scoped_release unlocked;
                return self.add_shapes(
                    [&](auto& to, const GeometryOptions& options) {
                        return to.add(all, radius, options);
                    },
                    {mask, id});
            },
            nb::arg("points").noconvert(), nb::arg("radius"), nb::arg("mask"), nb::arg("id").none())
        .def(
            "update_points",
            [](Scene& self, std::uint32_t id, const PointRows<Scene>& points,
               Scalar<Scene> radius) {
                const auto all = rows<Point>(points);
                const nb::gil_scoped_release unlocked;
                self.update_shapes(
                    [&](auto& of, std::uint32_t which) { of.update(which, all, radius); }, id);
            },
            nb::arg("id"), nb::arg("points").noconvert(), nb::arg("radius"));
}

}  // namespace

template <class Scene>
void bind_shapes(nb::class_<Scene>& scene) {
    using Sphere = typename Scene::Types::Sphere;
    using Capsule = typename Scene::Types::Capsule;
    static_assert(sizeof(Sphere) == 4 * sizeof(Scalar<Scene>) &&
                  sizeof(Capsule) == 7 * sizeof(Scalar<Scene>));
    bind_shapes_of_a_kind<Sphere>(scene, "add_spheres", "update_spheres");
    bind_shapes_of_a_kind<Capsule>(scene, "add_capsules", "update_capsules");
    bind_balls(scene);
}

template void bind_shapes(nb::class_<SceneTrees>& scene);
template void bind_shapes(nb::class_<SceneTreesD>& scene);

void bind_files(nb::class_<SceneTrees>& scene) {
    scene.def_static("load", &load, nb::arg("file"), nb::arg("seed"), nb::arg("builder"),
                     nb::arg("reinsertion_rounds"), nb::arg("bits"), nb::arg("max_leaf"),
                     nb::arg("strict"), nb::arg("threads"), nb::arg("quality"), nb::arg("usage"),
                     nb::arg("compact"), "The scene, its name, and its cameras' fields.");
}

template <class Scene>
void bind_saving(nb::class_<Scene>& scene) {
    scene.def("save_rdx", &save<Scene>, nb::arg("file"), nb::arg("name"), nb::arg("cameras"))
        .def_static("load_rdx", &load_saved<Scene>, nb::arg("file"), nb::arg("threads"),
                    "The scene of a .rdx file, its name, and its cameras' fields.");
}

template void bind_saving(nb::class_<SceneTrees>& scene);
template void bind_saving(nb::class_<SceneTreesD>& scene);

}  // namespace raydix::python
