// Meshes spread over ranks: partition, a scene of raydix on each rank, a tree over the boxes of
// all; then queries in rounds.
#include <raydix/error.h>
#include <raydix/mpi.h>
#include <raydix/result_limit.h>

#include <optional>
#include <string>

#include "base/options.h"
#include "mpi/call.h"
#include "mpi/curve.h"
#include "mpi/inside_query.h"
#include "mpi/scene_internals.h"
#include "mpi/scene_queries.h"

namespace raydix::mpi {

template <class Scalar>
struct BasicDistributedScene<Scalar>::State {
    using Mesh = typename Types::Mesh;
    using Triangles = std::vector<MovingTriangle<Scalar>>;
    using Box = RankBox<Scalar>;

    State(MPI_Comm given, const SceneOptions& chosen) : comm(given), options(chosen) {}

    void build(std::span<const MeshView> meshes) {
        ComputeClock clock(options.compute_gate);
        std::exception_ptr error;
        keep_error(error, [&] { clock.run([&] { check(meshes); }); });
        agree_on(comm,
                 "DistributedScene, " + describe<Scalar>(options) +
                     (options.one_geometry ? ", one geometry" : ""),
                 error);
        const std::vector<TriangleName> firsts = name_meshes(meshes);
        if (options.partition == Partition::curve) {
            const Mesh held = move_along_curve(meshes, firsts, clock);
            keep_error(error, [&] { clock.run([&] { scene.add(held); }); });
        } else {
            for (const TriangleName& first : firsts) names.add_mesh(first);
            keep_error(error, [&] {
                clock.run([&] {
                    for (const MeshView& mesh : meshes)
                        scene.add(mesh.triangles.empty() ? MeshView() : mesh);
                });
            });
        }
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
        bounds = joined(scene.bounds());
        std::uint64_t sums[2] = {committed.triangles, committed.left_out};
        comm.reduce(sums, 2, MPI_SUM);
        holding.size = sums[0];
        holding.left_out = sums[1];
        holding.local = committed.triangles;
        holding.replicated_bytes = tree.bytes();
        holding.bytes = committed.bytes + names.bytes() + tree.bytes();
        holding.report.traffic = comm.traffic();
        holding.report.compute_seconds = clock.seconds();
    }

    void check(std::span<const MeshView> meshes) const {
        check_options(options);
        std::uint64_t triangles = 0;
        for (std::size_t m = 0; m < meshes.size(); ++m) {
            triangles += meshes[m].triangles.size();
            for (std::size_t i = 0; i < meshes[m].triangles.size(); ++i)
                for (const std::uint32_t v : meshes[m].triangles[i])
                    if (v >= meshes[m].vertices.size())
                        throw InputError("mesh " + std::to_string(m) + ", triangle " +
                                         std::to_string(i) + ": vertex " + std::to_string(v) +
                                         ", but there are " +
                                         std::to_string(meshes[m].vertices.size()));
        }
        if (triangles > std::uint64_t(std::numeric_limits<std::int32_t>::max()))
            throw InputError(std::to_string(triangles) +
                             " triangles; a rank holds fewer than 2^31");
    }

    /// The names of the first triangle of each mesh of this rank.
    std::vector<TriangleName> name_meshes(std::span<const MeshView> meshes) {
        std::uint64_t triangles = 0;
        for (const MeshView& mesh : meshes) triangles += mesh.triangles.size();
        holding.first = comm.sum_before(triangles);
        const std::uint64_t geometries = comm.sum_before(meshes.size());
        std::vector<TriangleName> names_of;
        std::uint64_t prim = holding.first;
        for (std::size_t m = 0; m < meshes.size(); ++m) {
            names_of.push_back(options.one_geometry
                                   ? TriangleName{0, prim}
                                   : TriangleName{static_cast<std::uint32_t>(geometries + m), 0});
            prim += meshes[m].triangles.size();
        }
        return names_of;
    }

    /// The triangles that this rank is to hold, in the order of their names.
    Mesh move_along_curve(std::span<const MeshView> meshes, const std::vector<TriangleName>& firsts,
                          ComputeClock& clock) {
        std::exception_ptr error;
        Triangles triangles;
        Box around = Box::empty();
        keep_error(error, [&] {
            clock.run([&] {
                for (std::size_t m = 0; m < meshes.size(); ++m) {
                    TriangleName name = firsts[m];
                    for (const Triangle& t : meshes[m].triangles) {
                        const auto& v = meshes[m].vertices;
                        triangles.push_back({{v[t[0]], v[t[1]], v[t[2]]}, name});
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
        Mesh held;
        clock.run([&] {
            std::sort(triangles.begin(), triangles.end(),
                      [](const auto& a, const auto& b) { return a.name < b.name; });
            for (const MovingTriangle<Scalar>& triangle : triangles) {
                const auto v = static_cast<std::uint32_t>(held.vertices.size());
                held.vertices.insert(held.vertices.end(), triangle.corners, triangle.corners + 3);
                held.triangles.push_back({v, v + 1, v + 2});
                names.add_triangle(triangle.name);
            }
        });
        return held;
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

    std::vector<Box> boxes_of_scene() const {
        std::vector<Box> boxes;
        for (const std::uint32_t id : scene.ids()) {
            const MeshView mesh = *scene.mesh(id);
            for (const Triangle& t : mesh.triangles)
                boxes.push_back(box_of_corners<Scalar>(mesh.vertices[t[0]], mesh.vertices[t[1]],
                                                       mesh.vertices[t[2]]));
        }
        return boxes;
    }

    /// Around what all ranks hold.
    typename Types::Box joined(const typename Types::Box& mine) const {
        double least[6] = {mine.lo.x,          mine.lo.y,          mine.lo.z,
                           -double(mine.hi.x), -double(mine.hi.y), -double(mine.hi.z)};
        comm.reduce(least, 6, MPI_MIN);
        Point lo, hi;
        Double3(least[0], least[1], least[2]).round_to(lo);
        Double3(-least[3], -least[4], -least[5]).round_to(hi);
        return {lo, hi};
    }

    /// Trees for crossings, made by the first call that asks for them.
    const std::vector<typename CrossingTree<Scalar>::Bvh>& crossing_trees() {
        if (crossings.empty()) {
            BuildOptions of_tree;
            of_tree.threads = options.threads;
            for (const std::uint32_t id : scene.ids())
                crossings.push_back(build_bvh(*scene.mesh(id), of_tree));
        }
        return crossings;
    }

    [[nodiscard]] SceneParts<Scalar> parts() const { return {scene, names, tree, options.threads}; }

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
    typename Types::Box bounds{};
    std::vector<typename CrossingTree<Scalar>::Bvh> crossings;
    Holding holding;
};

template <class Scalar>
BasicDistributedScene<Scalar>::BasicDistributedScene(MPI_Comm comm,
                                                     std::span<const MeshView> meshes,
                                                     const SceneOptions& options)
    : state_(std::make_unique<State>(comm, options)) {
    const FloatEnvironment plain;
    state_->build(meshes);
}

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
auto BasicDistributedScene<Scalar>::trace(std::span<const Ray> rays) const
    -> Answers<Hit, TraceCounts> {
    return state_->template ask<ClosestHitKind<Scalar>, Answers<Hit, TraceCounts>>(
        "trace", [&](auto& kind, auto& answers) { kind.emplace(state_->parts(), rays, answers); });
}

template <class Scalar>
Answers<std::uint8_t, TraceCounts> BasicDistributedScene<Scalar>::trace_any(
    std::span<const Ray> rays) const {
    return state_->template ask<AnyHitKind<Scalar>, Answers<std::uint8_t, TraceCounts>>(
        "trace_any",
        [&](auto& kind, auto& answers) { kind.emplace(state_->parts(), rays, answers); });
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
                                                         std::uint64_t max_result_bytes) const {
    HitRows<Scalar> rows;
    RowStore<Hit> store("trace_all", rays.size(), max_result_bytes);
    AllHitsKind<Scalar> kind(state_->parts(), rays, store);
    Call call(state_->comm, state_->options);
    call.template begin<AllHitsKind<Scalar>>("trace_all", [] {});
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
                                                   Scalar max_distance) const
    -> Answers<Closest, ClosestCounts> {
    return state_->template ask<ClosestPointKind<Scalar>, Answers<Closest, ClosestCounts>>(
        "closest_points, " + exact_text(max_distance), [&](auto& kind, auto& answers) {
            if (!(max_distance >= 0))
                throw InputError("max_distance is " + std::to_string(max_distance) +
                                 "; it must be 0 or more");
            kind.emplace(state_->parts(), queries, max_distance, answers);
        });
}

template <class Scalar>
Answers<std::uint8_t, ClosestCounts> BasicDistributedScene<Scalar>::contains(
    std::span<const Point> queries) const {
    State& s = *state_;
    return s.template ask<InsideKind<Scalar>, Answers<std::uint8_t, ClosestCounts>>(
        "contains", [&](auto& kind, auto& answers) {
            kind.emplace(s.crossing_trees(), s.tree, s.options.threads, queries, answers);
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
                kind.emplace(state.parts(), rays, answers, &*of_hits);
            })
        .values;
}

template class BasicDistributedScene<float>;
template class BasicDistributedScene<double>;
template struct DistributedSceneInternals<float>;
template struct DistributedSceneInternals<double>;

}  // namespace raydix::mpi
