// Meshes, shapes and instances spread over ranks: partition, a scene of raydix on each rank, a tree
// over the boxes of all; then queries in rounds.
#include <raydix/error.h>
#include <raydix/mpi.h>
#include <raydix/result_limit.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <utility>

#include "base/options.h"
#include "engine/flat_scene.h"
#include "engine/scene_state.h"
#include "engine/shape_tree.h"
#include "mpi/call.h"
#include "mpi/curve.h"
#include "mpi/inside_query.h"
#include "mpi/scene_internals.h"
#include "mpi/scene_queries.h"

namespace raydix::mpi {

template <class Scalar>
struct BasicDistributedScene<Scalar>::State {
    using Mesh = BasicMesh<Scalar>;
    using Triangles = std::vector<MovingTriangle<Scalar>>;
    using Box = RankBox<Scalar>;

    State(MPI_Comm given, const SceneOptions& chosen) : comm(given), options(chosen) {}

    void build(std::span<const Geometry> given) {
        ComputeClock clock(options.compute_gate);
        std::exception_ptr error;
        keep_error(error, [&] { clock.run([&] { check(given); }); });
        agree_on(comm,
                 "DistributedScene, " + describe<Scalar>(options) +
                     (options.one_geometry ? ", one geometry" : ""),
                 error);
        const std::vector<TriangleName> firsts = name_meshes(given);
        Triangles moved;
        if (options.partition == Partition::curve) moved = move_along_curve(given, firsts, clock);
        keep_error(error, [&] {
            clock.run([&] {
                if (options.partition == Partition::curve)
                    hold_moved(moved, given, firsts);
                else
                    hold_as_given(given, firsts);
                moved = {};
            });
        });
        CommitReport committed;
        std::vector<Box> boxes;
        keep_error(error, [&] {
            clock.run([&] {
                committed = commit();
                boxes = cover(boxes_of_scene(), options.boxes_per_rank);
            });
        });
        agree(comm, error);
        tree = RankTree<Scalar>(comm, boxes);
        comm.reduce(&ray_error, 1, MPI_MAX);
        holding.paths = committed.paths;
        holding.first_path = comm.sum_before(committed.paths);
        require_few(committed.paths, "paths to instances");
        bounds = joined(scene.bounds());
        holding.local = committed.triangles + committed.primitives;
        std::uint64_t sums[2] = {holding.local, committed.left_out};
        comm.reduce(sums, 2, MPI_SUM);
        holding.size = sums[0];
        holding.left_out = sums[1];
        holding.replicated_bytes = tree.bytes();
        holding.bytes = committed.bytes + names.bytes() + tree.bytes();
        holding.report.traffic = comm.traffic();
        holding.report.compute_seconds = clock.seconds();
    }

    void check(std::span<const Geometry> given) const {
        check_options(options);
        std::uint64_t triangles = 0;
        for (std::size_t m = 0; m < given.size(); ++m) {
            const MeshView& mesh = given[m].mesh;
            check_kind(given[m], m);
            triangles += mesh.triangles.size();
            for (std::size_t i = 0; i < mesh.triangles.size(); ++i)
                for (const std::uint32_t v : mesh.triangles[i])
                    if (v >= mesh.vertices.size())
                        throw InputError("mesh " + std::to_string(m) + ", triangle " +
                                         std::to_string(i) + ": vertex " + std::to_string(v) +
                                         ", but there are " + std::to_string(mesh.vertices.size()));
        }
        if (triangles > std::uint64_t(std::numeric_limits<std::int32_t>::max()))
            throw InputError(std::to_string(triangles) +
                             " triangles; a rank holds fewer than 2^31");
    }

    /// One thing, and one that options.one_geometry knows a number for.
    void check_kind(const Geometry& given, std::size_t m) const {
        const std::pair<bool, const char*> kinds[] = {
            {given.scene != nullptr, "a scene"}, {!given.mesh.triangles.empty(), "a mesh"},
            {!given.spheres.empty(), "spheres"}, {!given.capsules.empty(), "capsules"},
            {!given.points.empty(), "points"},   {given.user != nullptr, "user geometry"}};
        const char* first = nullptr;
        for (const auto& kind : kinds) {
            if (!kind.first) continue;
            if (first != nullptr)
                throw InputError("geometry " + std::to_string(m) + " has " + first + " and " +
                                 kind.second + "; it can be one of them");
            first = kind.second;
        }
        if (options.one_geometry && has_shapes(given))
            throw InputError("geometry " + std::to_string(m) + " has " + first +
                             "; with one_geometry there are meshes and instances alone");
    }
    static bool has_shapes(const Geometry& given) {
        return !given.spheres.empty() || !given.capsules.empty() || !given.points.empty() ||
               given.user != nullptr;
    }

    /// Collective. Throws InputError on all ranks if they have too many together for 32 bits.
    void require_few(std::uint64_t mine, const char* what) const {
        std::uint64_t all = mine;
        comm.reduce(&all, 1, MPI_SUM);
        if (all >= no_primitive - 1)
            throw InputError("DistributedScene: " + std::to_string(all) + " " + what +
                             "; there may be less than 2^32 - 2");
    }

    /// Collective. The names of the first triangle of each mesh of this rank. Instances have one
    /// too, without a meaning.
    std::vector<TriangleName> name_meshes(std::span<const Geometry> given) {
        std::uint64_t triangles = 0;
        for (const Geometry& one : given) triangles += one.mesh.triangles.size();
        holding.first = comm.sum_before(triangles);
        const std::uint64_t geometries = comm.sum_before(given.size());
        require_few(given.size(), "geometries");
        std::vector<TriangleName> names_of;
        std::uint64_t prim = holding.first;
        for (std::size_t m = 0; m < given.size(); ++m) {
            names_of.push_back(options.one_geometry
                                   ? TriangleName{0, prim}
                                   : TriangleName{static_cast<std::uint32_t>(geometries + m), 0});
            prim += given[m].mesh.triangles.size();
        }
        return names_of;
    }

    /// Collective. The triangles that this rank is to hold, in the order of their names.
    Triangles move_along_curve(std::span<const Geometry> given,
                               const std::vector<TriangleName>& firsts, ComputeClock& clock) {
        std::exception_ptr error;
        Triangles triangles;
        Box around = Box::empty();
        keep_error(error, [&] {
            clock.run([&] {
                for (std::size_t m = 0; m < given.size(); ++m) {
                    TriangleName name = firsts[m];
                    const auto& v = given[m].mesh.vertices;
                    for (const Triangle& t : given[m].mesh.triangles) {
                        triangles.push_back({{v[t[0]], v[t[1]], v[t[2]]}, given[m].mask, name});
                        around.unite(box_of(triangles.back()));
                        ++name.prim;
                    }
                }
            });
        });
        const GlobalGrid grid(comm, around);
        std::vector<CurveKey> keys;
        keep_error(error, [&] {
            clock.run([&] {
                for (std::size_t i = 0; i < triangles.size(); ++i)
                    keys.push_back({code_of(grid, triangles[i]), holding.first + i});
            });
        });
        agree(comm, error);
        triangles = partition_by_curve(comm, std::move(triangles), keys, options.message_bytes);
        clock.run([&] {
            std::sort(triangles.begin(), triangles.end(),
                      [](const auto& a, const auto& b) { return a.name < b.name; });
        });
        return triangles;
    }

    static GeometryOptions masked(std::uint32_t mask) {
        GeometryOptions options;
        options.mask = mask;
        return options;
    }

    void add_instance(const Geometry& given) {
        scene.add(*given.scene, given.transform, masked(given.mask));
        names.skip();
    }

    void add_shapes(const Geometry& given, TriangleName first) {
        if (given.user != nullptr)
            scene.add(*given.user, masked(given.mask));
        else if (!given.spheres.empty())
            scene.add(given.spheres, masked(given.mask));
        else if (!given.capsules.empty())
            scene.add(given.capsules, masked(given.mask));
        else
            scene.add(given.points, given.radius, masked(given.mask));
        names.add_mesh(first);
    }

    void hold_as_given(std::span<const Geometry> given, const std::vector<TriangleName>& firsts) {
        for (std::size_t m = 0; m < given.size(); ++m) {
            if (given[m].scene != nullptr) {
                add_instance(given[m]);
            } else if (has_shapes(given[m])) {
                add_shapes(given[m], firsts[m]);
            } else {
                scene.add(given[m].mesh.triangles.empty() ? MeshView() : given[m].mesh,
                          masked(given[m].mask));
                names.add_mesh(firsts[m]);
            }
        }
    }

    /// As meshes of one mask each, and shapes between them, so that ids here are in the order of
    /// names: ties go as they do in the whole. Instances come later in ties anyway.
    void hold_moved(const Triangles& triangles, std::span<const Geometry> given,
                    const std::vector<TriangleName>& firsts) {
        std::size_t held = 0;
        for (std::size_t m = 0; m < given.size(); ++m) {
            if (!has_shapes(given[m])) continue;
            hold_meshes(triangles, held, firsts[m].geometry);
            add_shapes(given[m], firsts[m]);
        }
        hold_meshes(triangles, held, no_primitive);
        for (const Geometry& one : given)
            if (one.scene != nullptr) add_instance(one);
    }
    /// Triangles from `begin` on, up to those of the whole's geometry `limit`; moves `begin` there.
    void hold_meshes(const Triangles& triangles, std::size_t& begin, std::uint32_t limit) {
        const auto is_before = [&](std::size_t i) {
            return i < triangles.size() && triangles[i].name.geometry < limit;
        };
        while (is_before(begin)) {
            const std::uint32_t mask = triangles[begin].mask;
            Mesh mesh;
            std::vector<TriangleName> of_mesh;
            for (; is_before(begin) && triangles[begin].mask == mask; ++begin) {
                const auto& corners = triangles[begin].corners;
                const auto v = static_cast<std::uint32_t>(mesh.vertices.size());
                mesh.vertices.insert(mesh.vertices.end(), corners, corners + 3);
                mesh.triangles.push_back({v, v + 1, v + 2});
                of_mesh.push_back(triangles[begin].name);
            }
            scene.add(mesh, masked(mask));
            names.add_mesh(of_mesh);
        }
    }

    static Box box_of(const MovingTriangle<Scalar>& t) {
        return box_of_corners<Scalar>(t.corners[0], t.corners[1], t.corners[2]);
    }
    /// Of the middle of its box; 0 where the triangle is left out in any case.
    static std::uint64_t code_of(const GlobalGrid& grid, const MovingTriangle<Scalar>& triangle) {
        const Box box = box_of(triangle);
        if (!(box.lo[0] <= box.hi[0])) return 0;
        Scalar middle[3];
        for (int d = 0; d < 3; ++d) middle[d] = box.lo[d] + (box.hi[d] - box.lo[d]) / 2;
        return grid.code(middle);
    }

    CommitReport commit() {
        raydix::SceneOptions of_scene;
        of_scene.quality = options.quality;
        of_scene.strict = options.strict;
        of_scene.threads = options.threads;
        return scene.commit(of_scene);
    }

    /// Of all triangles, and of all shapes and instances with what rays may miss them by.
    std::vector<Box> boxes_of_scene() {
        std::vector<Box> boxes;
        for (const std::uint32_t id : scene.ids()) {
            const std::optional<MeshView> mesh = scene.mesh(id);
            if (!mesh) continue;
            for (const Triangle& t : mesh->triangles)
                boxes.push_back(box_of_corners<Scalar>(mesh->vertices[t[0]], mesh->vertices[t[1]],
                                                       mesh->vertices[t[2]]));
        }
        const auto& committed = *BasicSceneInternals<Scalar>::tree(scene);
        const auto add = [&](const BasicAabb<Scalar>& box) {
            if (box.lo.x <= box.hi.x)
                boxes.push_back({{box.lo.x, box.lo.y, box.lo.z}, {box.hi.x, box.hi.y, box.hi.z}});
        };
        for (std::size_t i = committed.meshes.size(); i < committed.extents.size(); ++i) {
            const auto& extent = committed.extents[i];
            if (extent.box.lo.x <= extent.box.hi.x) ray_error = std::max(ray_error, extent.error);
            if (i >= committed.own_part_count())
                add(extent.box);
            else
                add_boxes_of(*committed.shapes[i - committed.meshes.size()], extent.box, add);
        }
        return boxes;
    }
    /// Of each shape, as much larger as the box around all of them is than it need be.
    template <class Shapes, class Add>
    static void add_boxes_of(const Shapes& shapes, const BasicAabb<Scalar>& widened,
                             const Add& add) {
        const BasicAabb<Scalar>& tight = shapes.bounds;
        const Scalar most = std::numeric_limits<Scalar>::max();
        const Scalar by =
            std::nextafter(std::max({tight.lo.x - widened.lo.x, tight.lo.y - widened.lo.y,
                                     tight.lo.z - widened.lo.z, widened.hi.x - tight.hi.x,
                                     widened.hi.y - tight.hi.y, widened.hi.z - tight.hi.z}),
                           most);
        const auto below = [&](Scalar x) { return std::nextafter(x - by, -most); };
        const auto above = [&](Scalar x) { return std::nextafter(x + by, most); };
        for (const auto& box : boxes_of<Scalar>(shapes.shapes))
            if (is_in_range(box.lo) && is_in_range(box.hi))  // others are left out
                add({{below(box.lo.x), below(box.lo.y), below(box.lo.z)},
                     {above(box.hi.x), above(box.hi.y), above(box.hi.z)}});
    }

    /// Around what all ranks hold.
    BasicAabb<Scalar> joined(const BasicAabb<Scalar>& mine) const {
        double least[6] = {mine.lo.x,          mine.lo.y,          mine.lo.z,
                           -double(mine.hi.x), -double(mine.hi.y), -double(mine.hi.z)};
        comm.reduce(least, 6, MPI_MIN);
        Point lo, hi;
        Double3(least[0], least[1], least[2]).round_to(lo);
        Double3(-least[3], -least[4], -least[5]).round_to(hi);
        return {lo, hi};
    }

    /// All triangles in the world, made by the first call that asks for them.
    const typename CrossingTree<Scalar>::Bvh& crossing_tree() {
        if (!crossings)
            crossings = FlatPlan<Scalar>(scene, 0xFFFFFFFFu, "contains").tree(options.threads);
        return crossings->tree;
    }

    [[nodiscard]] SceneParts<Scalar> parts() const {
        return {
            scene,          names, tree, ray_error, static_cast<std::uint32_t>(holding.first_path),
            options.threads};
    }

    /// Throws InputError for geometry that has no closest points, and makes what queries need.
    void require_closest_points(std::uint32_t mask) const {
        BasicSceneClosestOptions<Scalar> seen;
        seen.mask = mask;
        seen.threads = options.threads;
        static_cast<void>(raydix::closest_points(scene, std::span<const Point>(), seen));
    }

    /// A query whose answers have a fixed size.
    template <class Kind, class Answers, class Make>
    Answers ask(const std::string& name, const Make& make) {
        Answers answers;
        std::optional<Kind> kind;
        Call call(comm, options);
        call.template begin<Kind>(name, [&] {
            make(kind, answers);
            kind->clear();
        });
        call.run(*kind);
        call.finish([&] { kind->finish(); });
        answers.report = call.report();
        return answers;
    }

    Communicator comm;
    SceneOptions options;
    BasicScene<Scalar> scene;
    TriangleNames names;
    RankTree<Scalar> tree;
    BasicAabb<Scalar> bounds{};
    double ray_error = 0;  // the greatest of the extents of shapes and instances, on all ranks
    std::optional<FlatTree<Scalar>> crossings;
    Holding holding;
};

template <class Scalar>
BasicDistributedScene<Scalar>::BasicDistributedScene(MPI_Comm comm,
                                                     std::span<const Geometry> geometries,
                                                     const SceneOptions& options)
    : state_(std::make_unique<State>(comm, options)) {
    const FloatEnvironment plain;
    state_->build(geometries);
}

namespace {

template <class Scalar>
auto geometries_of(std::span<const BasicMeshView<Scalar>> meshes) {
    std::vector<BasicDistributedGeometry<Scalar>> geometries(meshes.size());
    for (std::size_t m = 0; m < meshes.size(); ++m) geometries[m].mesh = meshes[m];
    return geometries;
}

}  // namespace

template <class Scalar>
BasicDistributedScene<Scalar>::BasicDistributedScene(MPI_Comm comm,
                                                     std::span<const MeshView> meshes,
                                                     const SceneOptions& options)
    : BasicDistributedScene(comm, std::span<const Geometry>(geometries_of<Scalar>(meshes)),
                            options) {}

template <class Scalar>
BasicDistributedScene<Scalar>::~BasicDistributedScene() = default;
template <class Scalar>
BasicDistributedScene<Scalar>::BasicDistributedScene(BasicDistributedScene&&) noexcept = default;
template <class Scalar>
BasicDistributedScene<Scalar>& BasicDistributedScene<Scalar>::operator=(
    BasicDistributedScene&&) noexcept = default;

template <class Scalar>
const Holding& BasicDistributedScene<Scalar>::holding() const {
    return state_->holding;
}

template <class Scalar>
auto BasicDistributedScene<Scalar>::trace(std::span<const Ray> rays,
                                          const TraceOptions& options) const
    -> Answers<Hit, TraceCounts> {
    const GivenRays<Scalar> given{rays, options};
    return state_->template ask<ClosestHitKind<Scalar>, Answers<Hit, TraceCounts>>(
        given.name("trace"), [&](auto& kind, auto& answers) {
            given.check();
            kind.emplace(state_->parts(), given, answers);
        });
}

template <class Scalar>
Answers<std::uint8_t, TraceCounts> BasicDistributedScene<Scalar>::trace_any(
    std::span<const Ray> rays, const TraceOptions& options) const {
    const GivenRays<Scalar> given{rays, options};
    return state_->template ask<AnyHitKind<Scalar>, Answers<std::uint8_t, TraceCounts>>(
        given.name("trace_any"), [&](auto& kind, auto& answers) {
            given.check();
            kind.emplace(state_->parts(), given, answers);
        });
}

namespace {

template <class Scalar>
struct PlaceHits {
    HitRows<Scalar>& rows;

    void make_room(std::uint64_t count) const {
        rows.hits.reset(count);
        rows.counts.hits = count;
    }
    void operator()(std::uint64_t place, const BasicDistributedHit<Scalar>& hit) const {
        rows.hits[place] = hit;
    }
};

}  // namespace

template <class Scalar>
HitRows<Scalar> BasicDistributedScene<Scalar>::trace_all(std::span<const Ray> rays,
                                                         const TraceOptions& options) const {
    HitRows<Scalar> rows;
    const GivenRays<Scalar> given{rays, options};
    RowStore<Hit> store("trace_all", rays.size(), options.max_result_bytes);
    AllHitsKind<Scalar> kind(state_->parts(), given, store);
    Call call(state_->comm, state_->options);
    call.template begin<AllHitsKind<Scalar>>(given.name("trace_all"), [&] { given.check(); });
    call.run(kind);
    call.finish([&] {
        store.finish(
            rows.offsets, sizeof(Hit),
            [](const Hit& a, const Hit& b) { return order_of(a) < order_of(b); },
            PlaceHits<Scalar>{rows});
        kind.finish(rows.counts);
    });
    rows.report = call.report();
    return rows;
}

template <class Scalar>
auto BasicDistributedScene<Scalar>::closest_points(std::span<const Point> queries,
                                                   Scalar max_distance, std::uint32_t mask) const
    -> Answers<Closest, QueryCounts> {
    return state_->template ask<ClosestPointKind<Scalar>, Answers<Closest, QueryCounts>>(
        "closest_points, " + exact_text(max_distance) + ", mask " + std::to_string(mask),
        [&](auto& kind, auto& answers) {
            check_not_negative("max_distance", max_distance);
            state_->require_closest_points(mask);
            kind.emplace(state_->parts(), queries, max_distance, mask, answers);
        });
}

template <class Scalar>
Answers<std::uint8_t, QueryCounts> BasicDistributedScene<Scalar>::contains(
    std::span<const Point> queries) const {
    State& s = *state_;
    return s.template ask<InsideKind<Scalar>, Answers<std::uint8_t, QueryCounts>>(
        "contains", [&](auto& kind, auto& answers) {
            kind.emplace(s.crossing_tree(), s.tree, s.options.threads, queries, answers);
        });
}

template <class Scalar>
const Communicator& DistributedSceneInternals<Scalar>::communicator(const DistributedOf& scene) {
    return scene.state_->comm;
}

template <class Scalar>
auto DistributedSceneInternals<Scalar>::bounds(const DistributedOf& scene) -> Box {
    return scene.state_->bounds;
}

template <class Scalar>
auto DistributedSceneInternals<Scalar>::trace(const DistributedOf& scene, std::span<const Ray> rays,
                                              std::span<Double3> normals) -> std::vector<Hit> {
    auto& state = *scene.state_;
    std::optional<HitNormals<Scalar>> of_hits;
    return state
        .template ask<ClosestHitKind<Scalar>, Answers<Hit, TraceCounts>>(
            "trace for a picture",
            [&](auto& kind, auto& answers) {
                of_hits.emplace(state.scene, normals);
                kind.emplace(state.parts(), GivenRays<Scalar>{rays, {}}, answers, &*of_hits);
            })
        .values;
}

template class BasicDistributedScene<float>;
template class BasicDistributedScene<double>;
template struct DistributedSceneInternals<float>;
template struct DistributedSceneInternals<double>;

}  // namespace raydix::mpi
