// Scenes asked without rays: closest points, touches, sweeps, inside and outside, overlaps.
#include "scene_queries.h"

#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <raydix/closest.h>
#include <raydix/double.h>
#include <raydix/error.h>
#include <raydix/overlap.h>
#include <raydix/pairs.h>
#include <raydix/scene_pairs.h>
#include <raydix/scene_queries.h>

#include <algorithm>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "asking.h"
#include "lists.h"

namespace raydix::python {
namespace {

/// Closest points as rows of scalars: x, y, z, distance; prim, geometry and instance, each as half
/// a scalar in double, with as much left over; u, v.
template <class Scene>
using PlaceRows =
    Out<Scalar<Scene>,
        nb::shape<-1, sizeof(typename Scene::Types::ClosestPoint) / sizeof(Scalar<Scene>)>>;
static_assert(sizeof(SceneClosestPoint) == 9 * sizeof(float) &&
              sizeof(SceneClosestPointD) == 8 * sizeof(double));

template <class Scene>
Counts closest(Scene& scene, const PointRows<Scene>& points, const PlaceRows<Scene>& out,
               Scalar<Scene> max_distance, int threads, std::uint32_t mask) {
    const auto queries = rows<Point<Scene>>(points);
    const auto results = rows_out<typename Scene::Types::ClosestPoint>(out);
    require_length(results.size(), queries.size());
    const typename Scene::Types::SceneClosestOptions options{
        .max_distance = max_distance, .mask = mask, .threads = threads_for(threads)};
    Counts counts{0, 0};
    read_in_pieces(scene, queries.size(), [&](std::size_t begin, std::size_t end) {
        const QueryCounts met = scene.closest_points(queries.subspan(begin, end - begin),
                                                     results.subspan(begin, end - begin), options);
        counts.first += met.found;
        counts.second += met.invalid_queries;
    });
    return counts;
}

InsideRule inside_rule(const std::string& name) {
    static const std::pair<const char*, InsideRule> rules[] = {{"automatic", InsideRule::automatic},
                                                               {"crossings", InsideRule::crossings},
                                                               {"parity", InsideRule::parity},
                                                               {"winding", InsideRule::winding}};
    for (const auto& [known, rule] : rules)
        if (name == known) return rule;
    throw InputError("unknown rule \"" + name +
                     "\"; known are automatic, crossings, parity, winding");
}

template <class Scene>
Counts signed_distance(Scene& scene, const PointRows<Scene>& points, const ValuesOut<Scene>& out,
                       Scalar<Scene> max_distance, const std::string& rule_name, int threads,
                       std::uint32_t mask) {
    const auto queries = rows<Point<Scene>>(points);
    const std::span distances(out.data(), out.shape(0));
    require_length(distances.size(), queries.size());
    const InsideRule rule = inside_rule(rule_name);
    const typename Scene::Types::ClosestOptions options{.max_distance = max_distance,
                                                        .threads = threads_for(threads)};
    Counts counts{0, 0};
    read_in_pieces(scene, queries.size(), [&](std::size_t begin, std::size_t end) {
        const QueryCounts met = signed_distances(*scene.solid(rule, mask, "signed_distance"),
                                                 queries.subspan(begin, end - begin),
                                                 distances.subspan(begin, end - begin), options);
        counts.first += met.found;
        counts.second += met.invalid_queries;
    });
    return counts;
}

template <class Scene>
Counts inside(Scene& scene, const PointRows<Scene>& points, const FlagsOut& out,
              const std::string& rule_name, int threads, std::uint32_t mask) {
    const auto queries = rows<Point<Scene>>(points);
    const std::span flags(reinterpret_cast<std::uint8_t*>(out.data()), out.shape(0));
    require_length(flags.size(), queries.size());
    const InsideRule rule = inside_rule(rule_name);
    Counts counts{0, 0};
    read_in_pieces(scene, queries.size(), [&](std::size_t begin, std::size_t end) {
        const QueryCounts met =
            contains(*scene.solid(rule, mask, "contains"), queries.subspan(begin, end - begin),
                     flags.subspan(begin, end - begin), threads_for(threads));
        counts.first += met.found;
        counts.second += met.invalid_queries;
    });
    return counts;
}

template <class Scene>
void winding(Scene& scene, const PointRows<Scene>& points, const Out<double, nb::ndim<1>>& out,
             const std::string& rule_name, int threads, std::uint32_t mask) {
    const auto queries = rows<Point<Scene>>(points);
    require_length(out.shape(0), queries.size());
    const InsideRule rule = inside_rule(rule_name);
    read_in_pieces(scene, queries.size(), [&](std::size_t begin, std::size_t end) {
        const std::vector<double> numbers =
            winding_numbers(*scene.solid(rule, mask, "winding_number"),
                            queries.subspan(begin, end - begin), threads_for(threads));
        std::copy(numbers.begin(), numbers.end(), out.data() + begin);
    });
}

/// closure, open edges, and the rule that `automatic` stands for.
template <class Scene>
nb::tuple closure(Scene& scene) {
    static const char* const closures[] = {"open", "closed", "oriented"};
    static const char* const rules[] = {"automatic", "crossings", "parity", "winding"};
    const auto [kind, open_edges, rule] = [&] {
        const nb::gil_scoped_release unlocked;
        const auto lock = scene.read();
        const auto solid = scene.solid(InsideRule::automatic, every_bit, "closure");
        return std::tuple(solid->closure(), solid->open_edges(), solid->rule());
    }();
    return nb::make_tuple(closures[static_cast<int>(kind)], open_edges,
                          rules[static_cast<int>(rule)]);
}

/// call(whether both are meshes, the other scene or null), without the interpreter's lock. One lock
/// for a scene that is asked about itself: two of the same thread may block each other.
template <class Scene, class Call>
auto with_two(Scene& scene, Scene* other, const Call& call) {
    const nb::gil_scoped_release unlocked;
    Scene* const last = other == nullptr ? &scene : other;
    Reading first_lock, second_lock;
    first_lock = std::min(&scene, last, std::less<>())->read();
    if (last == &scene) return call(scene.is_mesh(), other);
    second_lock = std::max(&scene, last, std::less<>())->read();
    return call(scene.is_mesh() && other->is_mesh(), other);
}

/// Whether a mask shows both meshes. `other` may be null.
template <class Scene>
bool shows_meshes(const Scene& scene, const Scene* other, std::uint32_t mask) {
    return scene.shows_mesh(mask) && (other == nullptr || other->shows_mesh(mask));
}

/// Two columns of meshes; of other scenes six: instance, geometry and prim of the first, and of the
/// second.
template <class Scene>
Array2<std::uint32_t> overlaps(Scene& scene, Scene* other, bool narrow,
                               std::uint64_t max_result_bytes, int threads, std::uint32_t mask) {
    const PairOptions options{
        .narrow = narrow, .max_result_bytes = max_result_bytes, .threads = threads_for(threads)};
    const ScenePairOptions of_scenes{.narrow = narrow,
                                     .mask = mask,
                                     .max_result_bytes = max_result_bytes,
                                     .threads = threads_for(threads)};
    std::vector<PrimitivePair> pairs;
    std::optional<ScenePairs> named;
    with_two(scene, other, [&](bool are_meshes, Scene* b) {
        if (!are_meshes)
            named = b != nullptr ? overlapping_pairs(scene.traced(), b->traced(), of_scenes)
                                 : overlapping_pairs(scene.traced(), of_scenes);
        else if (!shows_meshes(scene, b, mask))
            return;
        else if (b != nullptr)
            pairs = overlapping_pairs(scene.bvh("overlaps"), b->bvh("overlaps"), options);
        else
            pairs = overlapping_pairs(scene.bvh("overlaps"), options);
    });
    return named ? hand_over_rows<std::uint32_t>(std::move(named->pairs))
                 : hand_over_rows<std::uint32_t>(std::move(pairs));
}

template <class Scene>
std::uint64_t count_overlaps(Scene& scene, Scene* other, bool narrow, int threads,
                             std::uint32_t mask) {
    const PairOptions options{.narrow = narrow, .threads = threads_for(threads)};
    const ScenePairOptions of_scenes{
        .narrow = narrow, .mask = mask, .threads = threads_for(threads)};
    return with_two(scene, other, [&](bool are_meshes, Scene* b) -> std::uint64_t {
        if (!are_meshes)
            return b != nullptr ? count_overlapping_pairs(scene.traced(), b->traced(), of_scenes)
                                : count_overlapping_pairs(scene.traced(), of_scenes);
        if (!shows_meshes(scene, b, mask)) return 0;
        return b != nullptr ? count_overlapping_pairs(scene.bvh("count_overlaps"),
                                                      b->bvh("count_overlaps"), options)
                            : count_overlapping_pairs(scene.bvh("count_overlaps"), options);
    });
}

template <class Shape, class Scene, class Array>
Counts touches(Scene& scene, const Array& shapes, const FlagsOut& out, int threads,
               std::uint32_t mask) {
    const auto queries = rows<Shape>(shapes);
    const std::span flags(reinterpret_cast<std::uint8_t*>(out.data()), out.shape(0));
    require_length(flags.size(), queries.size());
    const SceneOverlapOptions options{.mask = mask, .threads = threads_for(threads)};
    Counts counts{0, 0};
    read_in_pieces(scene, queries.size(), [&](std::size_t begin, std::size_t end) {
        const QueryCounts met = scene.touch_any(queries.subspan(begin, end - begin),
                                                flags.subspan(begin, end - begin), options);
        counts.first += met.found;
        counts.second += met.invalid_queries;
    });
    return counts;
}

/// Rows of a ray and a radius.
template <class Scene>
using SweepRows = In<Scalar<Scene>, nb::shape<-1, 9>>;
/// t; prim, geometry and instance as in PlaceRows; x, y, z, u, v.
template <class Scene>
using ContactRows =
    Out<Scalar<Scene>,
        nb::shape<-1, sizeof(typename Scene::Types::SweepHit) / sizeof(Scalar<Scene>)>>;
static_assert(sizeof(SphereSweep) == 9 * sizeof(float) &&
              sizeof(SceneSweepHit) == 9 * sizeof(float));
static_assert(sizeof(SphereSweepD) == 9 * sizeof(double) &&
              sizeof(SceneSweepHitD) == 8 * sizeof(double));

template <class Scene>
Counts sweeps(Scene& scene, const SweepRows<Scene>& balls, const ContactRows<Scene>& out,
              int threads, std::uint32_t mask) {
    const auto queries = rows<typename Scene::Types::Sweep>(balls);
    const auto hits = rows_out<typename Scene::Types::SweepHit>(out);
    require_length(hits.size(), queries.size());
    const SceneOverlapOptions options{.mask = mask, .threads = threads_for(threads)};
    Counts counts{0, 0};
    read_in_pieces(scene, queries.size(), [&](std::size_t begin, std::size_t end) {
        const QueryCounts met = scene.sweep_spheres(queries.subspan(begin, end - begin),
                                                    hits.subspan(begin, end - begin), options);
        counts.first += met.found;
        counts.second += met.invalid_queries;
    });
    return counts;
}

/// Offsets, and rows of instance, geometry and prim.
template <class Shape, class Scene, class Array>
nb::tuple touched(Scene& scene, const Array& shapes, std::uint64_t max_result_bytes, int threads,
                  std::uint32_t mask) {
    using Lists = SceneOverlapLists;
    const auto queries = rows<Shape>(shapes);
    PieceLimit limit("touched_by", max_result_bytes);
    std::vector<Lists> pieces;
    const auto ask = [&](std::size_t begin, std::size_t end) {
        pieces.push_back(limit.next([&](std::uint64_t bytes) {
            return scene.touch_all(
                queries.subspan(begin, end - begin),
                {.mask = mask, .max_result_bytes = bytes, .threads = threads_for(threads)});
        }));
        limit.hold(piece_bytes(pieces.back(), &Lists::offsets, &Lists::prims));
    };
    read_in_pieces(scene, queries.size(), ask, first_listed);
    require_room_to_join(limit, pieces, &Lists::offsets, &Lists::prims);
    auto offsets = join_offsets(pieces);
    return nb::make_tuple(offsets,
                          hand_over_rows<std::uint32_t>(join_column(pieces, &Lists::prims)));
}

}  // namespace

template <class Scene>
void bind_queries(nb::class_<Scene>& scene) {
    using Sphere = typename Scene::Types::Sphere;
    using Segment = typename Scene::Types::Segment;
    using Spheres = In<Scalar<Scene>, nb::shape<-1, 4>>;
    using Segments = In<Scalar<Scene>, nb::shape<-1, 6>>;
    const auto mask = nb::arg("mask") = every_bit;
    scene
        .def("closest", &closest<Scene>, nb::arg("points").noconvert(), nb::arg("out").noconvert(),
             nb::arg("max_distance"), nb::arg("threads") = 0, mask)
        .def("signed_distance", &signed_distance<Scene>, nb::arg("points").noconvert(),
             nb::arg("out").noconvert(), nb::arg("max_distance"), nb::arg("rule"),
             nb::arg("threads") = 0, mask)
        .def("contains", &inside<Scene>, nb::arg("points").noconvert(),
             nb::arg("flags").noconvert(), nb::arg("rule"), nb::arg("threads") = 0, mask)
        .def("winding", &winding<Scene>, nb::arg("points").noconvert(), nb::arg("out").noconvert(),
             nb::arg("rule"), nb::arg("threads") = 0, mask)
        .def("closure", &closure<Scene>)
        .def("overlaps", &overlaps<Scene>, nb::arg("other").none(), nb::arg("narrow"),
             nb::arg("max_result_bytes") = 0, nb::arg("threads") = 0, mask)
        .def("count_overlaps", &count_overlaps<Scene>, nb::arg("other").none(), nb::arg("narrow"),
             nb::arg("threads") = 0, mask)
        .def("touches_spheres", &touches<Sphere, Scene, Spheres>, nb::arg("spheres").noconvert(),
             nb::arg("flags").noconvert(), nb::arg("threads") = 0, mask)
        .def("touches_segments", &touches<Segment, Scene, Segments>,
             nb::arg("segments").noconvert(), nb::arg("flags").noconvert(), nb::arg("threads") = 0,
             mask)
        .def("sweep", &sweeps<Scene>, nb::arg("sweeps").noconvert(), nb::arg("hits").noconvert(),
             nb::arg("threads") = 0, mask)
        .def("touched_by_spheres", &touched<Sphere, Scene, Spheres>, nb::arg("spheres").noconvert(),
             nb::arg("max_result_bytes") = 0, nb::arg("threads") = 0, mask)
        .def("touched_by_segments", &touched<Segment, Scene, Segments>,
             nb::arg("segments").noconvert(), nb::arg("max_result_bytes") = 0,
             nb::arg("threads") = 0, mask);
}

template void bind_queries(nb::class_<SceneTrees>& scene);
template void bind_queries(nb::class_<SceneTreesD>& scene);

}  // namespace raydix::python
