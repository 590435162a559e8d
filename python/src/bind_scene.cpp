// Scenes asked: rays, and what they are.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/variant.h>
#include <raydix/check.h>
#include <raydix/double.h>
#include <raydix/surface.h>
#include <raydix/trace.h>
#include <raydix/wide.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "arrays.h"
#include "asking.h"
#include "batch.h"
#include "bindings.h"
#include "figures.h"
#include "lists.h"
#include "one_ray.h"
#include "ray_parts.h"
#include "scene_changes.h"
#include "scene_handle.h"
#include "scene_queries.h"
#include "scene_trees.h"
#include "scene_views.h"

namespace raydix::python {
namespace {

using Masks = In<std::uint32_t, nb::ndim<1>>;  // of rays

/// Hits as rows of scalars, of which a whole number takes the room of one: t, prim, u, v, geometry,
/// instance; in double the last two share the room of one.
template <class Scene>
constexpr std::size_t hit_columns = sizeof(typename Scene::Types::Hit) / sizeof(Scalar<Scene>);
static_assert(sizeof(Hit) == 6 * sizeof(float) && sizeof(HitD) == 5 * sizeof(double));
template <class Scene>
using HitRows = Out<Scalar<Scene>, nb::shape<-1, hit_columns<Scene>>>;

/// So few rays are traced on the caller's thread, one by one: a batch's set-up would cost more.
constexpr std::size_t few_rays = 8;

/// Contract.md 3: what cannot hit anything.
template <class RayType>
bool is_valid(const RayType& ray) {
    const auto finite = [](const auto& v) {
        return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
    };
    return finite(ray.origin) && finite(ray.direction) &&
           (ray.direction.x != 0 || ray.direction.y != 0 || ray.direction.z != 0) &&
           std::max(ray.tmin, decltype(ray.tmin){0}) <= ray.tmax && !std::isnan(ray.tmin);
}

/// No rays go the way of batches, which tells what is wrong besides them.
bool are_few(std::size_t rays, const RayOptions& options) {
    return rays != 0 && rays <= few_rays && options.filter == nullptr;
}

/// Of rays [begin, end).
RayOptions piece_of(const RayOptions& options, std::size_t begin, std::size_t end) {
    RayOptions piece = options;
    piece.first += begin;
    if (!options.masks.empty()) piece.masks = options.masks.subspan(begin, end - begin);
    return piece;
}

std::uint32_t mask_of(const RayOptions& options, std::size_t ray) {
    return options.masks.empty() ? options.mask : options.masks[ray];
}

RayOptions ray_options(std::size_t rays, std::uint32_t mask, const std::optional<Masks>& masks,
                       int threads, const ArrayFilter* filter) {
    RayOptions options{.mask = mask, .threads = threads_for(threads), .filter = filter};
    if (filter != nullptr && !filter->prims.empty()) require_length(filter->prims.size(), rays);
    if (masks) {
        require_length(masks->shape(0), rays);
        options.masks = {masks->data(), masks->shape(0)};
    }
    return options;
}

template <class Scene, class Rays>
Counts intersect(Scene& scene, Rays& rays, const HitRows<Scene>& out, const RayOptions& options) {
    const auto hits = rows_out<typename Scene::Types::Hit>(out);
    require_length(hits.size(), rays.size());
    Counts counts{0, 0};
    read_in_pieces(scene, rays.size(), [&](std::size_t begin, std::size_t end) {
        const auto piece = rays.piece(begin, end);
        if (are_few(rays.size(), options)) {
            for (std::size_t i = 0; i < piece.size(); ++i) {
                hits[i] = scene.closest_hit(piece[i], mask_of(options, i));
                counts.first += hits[i].hit();
                counts.second += !is_valid(piece[i]);
            }
            return;
        }
        const TraceCounts met =
            scene.trace(piece, hits.subspan(begin, end - begin), piece_of(options, begin, end));
        counts.first += met.hits;
        counts.second += met.invalid_rays;
    });
    return counts;
}

template <class Scene, class Rays>
Counts occluded(Scene& scene, Rays& rays, const FlagsOut& out, const RayOptions& options) {
    const std::span flags(reinterpret_cast<std::uint8_t*>(out.data()), out.shape(0));
    require_length(flags.size(), rays.size());
    Counts counts{0, 0};
    read_in_pieces(scene, rays.size(), [&](std::size_t begin, std::size_t end) {
        const auto piece = rays.piece(begin, end);
        if (are_few(rays.size(), options)) {
            for (std::size_t i = 0; i < piece.size(); ++i) {
                flags[i] = scene.any_hit(piece[i], mask_of(options, i));
                counts.first += flags[i];
                counts.second += !is_valid(piece[i]);
            }
            return;
        }
        const TraceCounts met = scene.trace_any(piece, flags.subspan(begin, end - begin),
                                                piece_of(options, begin, end));
        counts.first += met.hits;
        counts.second += met.invalid_rays;
    });
    return counts;
}

template <class Scene, class Rays>
nb::tuple all_hits(Scene& scene, Rays& rays, std::uint64_t max_result_bytes,
                   const RayOptions& options) {
    using AllHits = typename Scene::Types::AllHits;
    PieceLimit limit("all_hits", max_result_bytes);
    std::vector<AllHits> pieces;
    std::uint64_t invalid = 0;
    read_in_pieces(
        scene, rays.size(),
        [&](std::size_t begin, std::size_t end) {
            RayOptions piece = piece_of(options, begin, end);
            pieces.push_back(limit.next([&](std::uint64_t bytes) {
                piece.max_result_bytes = bytes;
                return scene.trace_all(rays.piece(begin, end), piece);
            }));
            limit.hold(piece_bytes(pieces.back(), &AllHits::offsets, &AllHits::hits));
            invalid += pieces.back().counts.invalid_rays;
        },
        first_listed);
    require_room_to_join(limit, pieces, &AllHits::offsets, &AllHits::hits);
    auto offsets = join_offsets(pieces);
    return nb::make_tuple(
        offsets, hand_over_rows<Scalar<Scene>>(join_column(pieces, &AllHits::hits)), invalid);
}

template <class Scene, class Rays>
Counts count_hits(Scene& scene, Rays& rays, const Out<std::uint32_t, nb::ndim<1>>& out,
                  const RayOptions& options) {
    require_length(out.shape(0), rays.size());
    Counts counts{0, 0};
    // Smaller pieces: what is counted is first listed.
    const auto count = [&](std::size_t begin, std::size_t end) {
        constexpr std::size_t part = piece_size / 8;
        std::size_t first = begin;
        do {  // once without rays too: what is wrong besides them is told
            const std::size_t last = std::min(end, first + part);
            const auto all =
                scene.trace_all(rays.piece(first, last), piece_of(options, first, last));
            for (std::size_t i = first; i < last; ++i)
                out.data()[i] =
                    static_cast<std::uint32_t>(all.offsets[i - first + 1] - all.offsets[i - first]);
            counts.first += all.counts.hits;
            counts.second += all.counts.invalid_rays;
            first = last;
        } while (first < end);
    };
    read_in_pieces(scene, rays.size(), count, first_listed);
    return counts;
}

template <class Scene>
using PointsOut = Out<Scalar<Scene>, nb::shape<-1, 3>>;
template <class Scene>
using HitsIn = In<Scalar<Scene>, nb::shape<-1, hit_columns<Scene>>>;
template <class Scene>
using MaybeRays = std::optional<In<Scalar<Scene>, nb::shape<-1, 8>>>;

/// call(scene, [rays,] hits, points, threads): points or normals of hits.
template <class Scene, class Call>
void fill_for_hits(Scene& scene, const HitsIn<Scene>& hits, const MaybeRays<Scene>& with,
                   const PointsOut<Scene>& out, int threads, const Call& call) {
    using Ray = typename Scene::Types::Ray;
    const auto given = rows<typename Scene::Types::Hit>(hits);
    const auto points = rows_out<Point<Scene>>(out);
    require_length(points.size(), given.size());
    std::span<const Ray> rays;
    if (with) rays = raydix::python::rows<Ray>(*with);
    if (with) require_length(rays.size(), given.size());
    const auto fill = [&](std::size_t begin, std::size_t end) {
        const std::size_t n = end - begin;
        if (with)
            call(scene.traced(), rays.subspan(begin, n), given.subspan(begin, n),
                 points.subspan(begin, n), threads_for(threads));
        else
            call(scene.traced(), given.subspan(begin, n), points.subspan(begin, n),
                 threads_for(threads));
    };
    read_in_pieces(scene, given.size(), fill,
                   piece_size);  // errors count hits from a piece's first
}

template <class Scene>
void positions_of(Scene& scene, const HitsIn<Scene>& hits, const MaybeRays<Scene>& rays,
                  const PointsOut<Scene>& out, int threads) {
    fill_for_hits(scene, hits, rays, out, threads,
                  [](const auto&... arguments) { positions(arguments...); });
}

template <class Scene>
void normals_of(Scene& scene, const HitsIn<Scene>& hits, const MaybeRays<Scene>& rays,
                const PointsOut<Scene>& out, int threads) {
    fill_for_hits(scene, hits, rays, out, threads,
                  [](const auto&... arguments) { normals(arguments...); });
}

/// Rows of hits -> a column for each part, as raydix.open3d gives them. Normals of misses, NaN, are
/// set to 0. Of lengths that differ: ValueError.
void split_hits(const HitsIn<SceneTrees>& rows_in, const Out<float, nb::shape<-1>>& t,
                const Out<std::uint32_t, nb::shape<-1>>& geometry,
                const Out<std::uint32_t, nb::shape<-1>>& prim,
                const Out<float, nb::shape<-1, 2>>& uv,
                const Out<float, nb::shape<-1, 3>>& normals) {
    const auto hits = rows<Hit>(rows_in);
    for (const std::size_t length :
         {t.shape(0), geometry.shape(0), prim.shape(0), uv.shape(0), normals.shape(0)})
        require_length(length, hits.size());
    float* const uvs = uv.data();
    float* const facing = normals.data();
    const nb::gil_scoped_release unlocked;
    for (std::size_t i = 0; i < hits.size(); ++i) {
        const Hit& hit = hits[i];
        t.data()[i] = hit.t;
        geometry.data()[i] = hit.geometry;
        prim.data()[i] = hit.prim;
        uvs[2 * i] = hit.u;
        uvs[2 * i + 1] = hit.v;
        if (!hit.hit()) facing[3 * i] = facing[3 * i + 1] = facing[3 * i + 2] = 0;
    }
}

/// The wide tree of the one mesh, made as a commit makes it.
template <class Scene>
nb::dict wide_stats(Scene& scene) {
    return wide_figures(reading(scene, [&] {
        const auto mesh = scene.mesh("wide_stats").view();
        if (mesh.triangles.empty()) return WideBvh().stats();
        const SceneOptions& commits = scene.commit_options();
        BuildOptions options = build_options_for(commits.quality);
        options.threads = threads_for(commits.threads);
        if constexpr (std::is_same_v<Scene, SceneTreesD>)
            return wide_stats_of(mesh, options);
        else
            return build_wide_bvh(mesh, options, {.compact = commits.compact}).stats();
    }));
}

const Bvh& boxes_of(const Bvh& bvh) { return bvh; }
const Bvh& boxes_of(const BvhD& bvh) { return bvh.tree(); }

/// Of the binary tree; with its stages' milliseconds, and what was left out.
template <class Scene>
nb::dict stats(Scene& scene) {
    BuildMs ms;
    std::uint64_t left_out = 0, bytes = 0;
    const TreeStats figures = reading(scene, [&] {
        const auto& bvh = scene.bvh("stats");
        ms = bvh.build_ms();
        left_out = bvh.left_out();
        bytes = bvh.bytes();
        return tree_stats(boxes_of(bvh), {.threads = threads_for(scene.options().threads)});
    });
    nb::dict fields = tree_figures(figures);
    if (std::is_same_v<Scene, SceneTreesD>) fields["bytes"] = bytes;  // with corners in double
    fields["builder"] = std::string(builder_name(scene.options().builder));
    fields["reinsertion_rounds"] = scene.options().reinsertion_rounds;
    fields["left_out"] = left_out;
    fields["ms"] = stage_ms(ms);
    return fields;
}

template <class Scene>
nb::dict mesh_info(Scene& scene) {
    return mesh_figures(reading(scene, [&] {
        const auto& mesh = scene.mesh("info");
        return inspect(typename Scene::Types::MeshView{*mesh.vertices, *mesh.triangles});
    }));
}

std::pair<bool, std::string> check_trees(SceneTrees& scene) {
    const CheckReport report = reading(scene, [&] {
        // The vertices of a scene without triangles are no points.
        const MeshView mesh = scene.mesh("check").view();
        return mesh.triangles.empty() ? check(scene.bvh("check")) : check(scene.bvh("check"), mesh);
    });
    return {report.ok, report.broken};
}

/// Of the tree of boxes: the library has no check that knows the triangles in double.
std::pair<bool, std::string> check_boxes(SceneTreesD& scene) {
    const CheckReport report = reading(scene, [&] { return check(scene.bvh("check").tree()); });
    return {report.ok, report.broken};
}

/// A filter and the arrays that it views.
struct FilterOfArrays : ArrayFilter {
    using Column = In<std::uint32_t, nb::ndim<1>>;
    using Flags = In<bool, nb::ndim<1>>;
    std::vector<Column> columns;
    std::vector<Flags> flags;

    void skip(const Column& of_prims, const Column& of_geometries, const Column& of_instances) {
        require_length(of_geometries.shape(0), of_prims.shape(0));
        require_length(of_instances.shape(0), of_prims.shape(0));
        columns = {of_prims, of_geometries, of_instances};
        const auto view = [](const Column& column) {
            return std::span<const std::uint32_t>(column.data(), column.shape(0));
        };
        prims = view(of_prims), geometries = view(of_geometries), instances = view(of_instances);
    }
    void keep(std::uint32_t instance, std::uint32_t geometry, const Flags& values) {
        flags.push_back(values);
        seen[{instance, geometry}] = {values.data(), values.shape(0)};
    }
};

void bind_filter(nb::module_& module) {
    nb::class_<FilterOfArrays>(module, "HitFilter", "Which hits count.")
        .def(nb::init<>())
        .def("skip", &FilterOfArrays::skip, nb::arg("prims").noconvert(),
             nb::arg("geometries").noconvert(), nb::arg("instances").noconvert())
        .def("keep", &FilterOfArrays::keep, nb::arg("instance"), nb::arg("geometry"),
             nb::arg("values").noconvert());
}

/// The four calls with rays, for rays of the library's layout and for columns.
template <class Scene>
void bind_rays(nb::class_<Scene>& scene) {
    using Ray = typename Scene::Types::Ray;
    using Hits = HitRows<Scene>;
    using Counted = Out<std::uint32_t, nb::ndim<1>>;
    using Each = std::optional<Masks>;
    const auto mask = nb::arg("mask") = 0xFFFFFFFFu;
    const auto masks = nb::arg("masks").noconvert() = nb::none();
    const auto threads = nb::arg("threads") = 0;
    using Filter = std::shared_ptr<FilterOfArrays>;
    const auto filter = nb::arg("filter") = nb::none();
    def_for_rays<Ray>(
        scene, "intersect",
        [](Scene& self, auto& rays, const Hits& hits, std::uint32_t all, const Each& each, int n,
           const Filter& only) {
            return intersect(self, rays, hits, ray_options(rays.size(), all, each, n, only.get()));
        },
        MoreArguments<const Hits&, std::uint32_t, const Each&, int, const Filter&>(),
        nb::arg("hits").noconvert(), mask, masks, threads, filter);
    def_for_rays<Ray>(
        scene, "occluded",
        [](Scene& self, auto& rays, const FlagsOut& flags, std::uint32_t all, const Each& each,
           int n, const Filter& only) {
            return occluded(self, rays, flags, ray_options(rays.size(), all, each, n, only.get()));
        },
        MoreArguments<const FlagsOut&, std::uint32_t, const Each&, int, const Filter&>(),
        nb::arg("flags").noconvert(), mask, masks, threads, filter);
    def_for_rays<Ray>(
        scene, "count",
        [](Scene& self, auto& rays, const Counted& counts, std::uint32_t all, const Each& each,
           int n, const Filter& only) {
            return count_hits(self, rays, counts,
                              ray_options(rays.size(), all, each, n, only.get()));
        },
        MoreArguments<const Counted&, std::uint32_t, const Each&, int, const Filter&>(),
        nb::arg("counts").noconvert(), mask, masks, threads, filter);
    def_for_rays<Ray>(
        scene, "all_hits",
        [](Scene& self, auto& rays, std::uint64_t max_result_bytes, std::uint32_t all,
           const Each& each, int n, const Filter& only) {
            return all_hits(self, rays, max_result_bytes,
                            ray_options(rays.size(), all, each, n, only.get()));
        },
        MoreArguments<std::uint64_t, std::uint32_t, const Each&, int, const Filter&>(),
        nb::arg("max_result_bytes") = 0, mask, masks, threads, filter);
}

/// A view that stays as it is when the scene moves its vertices or goes.
template <class Item, class Row>
auto view_of(std::shared_ptr<const std::vector<Row>> values) {
    const std::span<const Row> all(*values);
    return view_rows<Item>(
        all,
        owner_of(std::make_unique<std::shared_ptr<const std::vector<Row>>>(std::move(values))));
}

/// (numbers, columns or None)
template <class Scalar>
nb::tuple attribute_tuple(std::shared_ptr<const Attribute<Scalar>> attribute) {
    const auto columns = attribute->columns;
    const auto* const values = &attribute->values;
    // The vector lives as long as the attribute.
    const std::shared_ptr<const std::vector<Scalar>> shared(std::move(attribute), values);
    return nb::make_tuple(view_of<Scalar>(shared),
                          columns ? nb::object(nb::int_(*columns)) : nb::object(nb::none()));
}

/// The arrays of a mesh, changes without a commit included; None of what is no mesh.
template <class Scene>
nb::object arrays_of(Scene& scene, std::uint32_t id) {
    const auto arrays = reading(scene, [&] { return scene.mesh_arrays(id); });
    if (!arrays) return nb::none();
    return nb::make_tuple(view_of<Scalar<Scene>>(arrays->vertices),
                          view_of<std::uint32_t>(arrays->triangles));
}

/// Of one mesh: numbers for each vertex, `columns` of them, or one without columns.
template <class Scene>
void set_attribute(Scene& scene, std::uint32_t id, const std::string& name,
                   const std::optional<In<Scalar<Scene>, nb::ndim<1>>>& values,
                   std::optional<std::size_t> columns) {
    std::shared_ptr<const Attribute<Scalar<Scene>>> value;
    if (values) {
        const auto* const first = values->data();
        value = std::make_shared<const Attribute<Scalar<Scene>>>(
            Attribute<Scalar<Scene>>{{first, first + values->size()}, columns});
    }
    const nb::gil_scoped_release unlocked;
    scene.set_attribute(id, name, std::move(value));
}

/// {name: (numbers, columns or None)}
template <class Scene>
nb::dict attributes(Scene& scene, std::uint32_t id) {
    nb::dict out;
    for (auto& [name, value] : reading(scene, [&] { return scene.attributes(id); }))
        out[name.c_str()] = attribute_tuple(value);
    return out;
}

/// (numbers, columns or None, vertices, triangles), or None. Without a path: of any mesh of the
/// scene itself.
template <class Scene>
nb::object attribute(Scene& scene, const std::string& name, std::optional<std::uint32_t> path,
                     std::uint32_t id) {
    const auto found = reading(
        scene, [&] { return path ? scene.attribute(*path, id, name) : scene.any_attribute(name); });
    if (!found) return nb::none();
    return attribute_tuple(found->value) +
           nb::make_tuple(found->vertices, view_of<std::uint32_t>(found->triangles));
}

/// The closest hit of one ray, from its two arrays to the row of a hit. The shortest way here that
/// there is: 1 or 2 says how many dimensions the arrays have, (3,) or (1, 3); 0: they are something
/// else, and nothing was done.
template <class Scene>
int hit_of(Scene& scene, nb::handle origin, nb::handle direction, nb::handle row) {
    typename Scene::Types::Ray ray;
    const int dimensions = read_vector(origin, ray.origin);
    if (dimensions == 0 || read_vector(direction, ray.direction) != dimensions) return 0;
    const auto hit = reading(scene, [&] { return scene.closest_hit(ray, 0xFFFFFFFFu); });
    write_bytes(row, &hit, sizeof(hit));
    return dimensions;
}

/// A LendScene in a capsule. What can go wrong with the scene is thrown here.
template <class Scene>
nb::object lend(std::shared_ptr<Scene> scene) {
    using Lend = LendScene<Scalar<Scene>>;
    static_cast<void>(reading(*scene, [&] { return &scene->traced(); }));
    auto function = std::make_unique<Lend>([scene = std::move(scene)] { return scene->lend(); });
    nb::capsule made(function.get(), scene_name<Scalar<Scene>>,
                     [](void* lend) noexcept { delete static_cast<Lend*>(lend); });
    static_cast<void>(function.release());
    return made;
}

/// What both types of scenes answer.
template <class Scene>
void bind_asking(nb::class_<Scene>& scene) {
    scene.def_prop_ro(
        "vertices",
        [](Scene& self) {
            return view_of<Scalar<Scene>>(
                reading(self, [&] { return self.mesh("vertices").vertices; }));
        },
        nb::rv_policy::automatic);
    scene.def_prop_ro(
        "faces",
        [](Scene& self) {
            return view_of<std::uint32_t>(
                reading(self, [&] { return self.mesh("faces").triangles; }));
        },
        nb::rv_policy::automatic);
    scene.def("mesh_id", [](Scene& self) { return reading(self, [&] { return self.mesh_id(); }); });
    scene.def("wide_stats", &wide_stats<Scene>).def("info", &mesh_info<Scene>);
    scene.attr("hit_columns") = static_cast<int>(hit_columns<Scene>);
    scene.def("stats", &stats<Scene>);
    scene.def("mask_of", [](Scene& self, std::uint32_t id) {
        return reading(self, [&] { return self.mask_of(id); });
    });
    scene.def("arrays_of", &arrays_of<Scene>);
    scene.def("set_attribute", &set_attribute<Scene>, nb::arg("id"), nb::arg("name"),
              nb::arg("values").noconvert().none(), nb::arg("columns").none());
    scene.def("attributes", &attributes<Scene>, nb::arg("id"));
    scene.def("attribute", &attribute<Scene>, nb::arg("name"), nb::arg("path").none() = nb::none(),
              nb::arg("id") = 0);
    scene.def("lend", &lend<Scene>);
    scene.def("hit_of", &hit_of<Scene>, nb::arg("origin").none(), nb::arg("direction").none(),
              nb::arg("row"));
    scene.def("positions", &positions_of<Scene>, nb::arg("hits").noconvert(),
              nb::arg("rays").noconvert().none(), nb::arg("points").noconvert(),
              nb::arg("threads") = 0);
    scene.def("normals", &normals_of<Scene>, nb::arg("hits").noconvert(),
              nb::arg("rays").noconvert().none(), nb::arg("normals").noconvert(),
              nb::arg("threads") = 0);
    bind_rays(scene);
    bind_queries(scene);
    bind_views(scene);
}

}  // namespace

void bind_scene(nb::module_& module) {
    bind_filter(module);
    module.def("split_hits", &split_hits, nb::arg("hits").noconvert(), nb::arg("t").noconvert(),
               nb::arg("geometry").noconvert(), nb::arg("prim").noconvert(),
               nb::arg("uv").noconvert(), nb::arg("normals").noconvert());
    nb::class_<SceneTrees> scene(module, "SceneTrees",
                                 "A scene in float; raydix.Scene is what to use.");
    bind_changes(scene);
    bind_saving(scene);
    bind_files(scene);
    bind_shapes(scene);
    bind_asking(scene);
    scene.def("check", &check_trees);
    nb::class_<SceneTreesD> in_double(module, "SceneTreesD",
                                      "A scene in double; raydix.Scene is what to use.");
    bind_changes(in_double);
    bind_saving(in_double);
    bind_shapes(in_double);
    bind_asking(in_double);
    in_double.def("check", &check_boxes);
}

}  // namespace raydix::python
