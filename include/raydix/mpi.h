// Points and scenes spread over the ranks of an MPI communicator. Answers have the bits of one
// process that holds everything, for every number of ranks and every partition
// (docs/distributed.md).
//
// This header needs <mpi.h> and the library raydix_mpi (CMake: raydix::mpi). MPI must have been
// started with MPI_THREAD_FUNNELED or more; all calls come from the thread that started it.
//
// Every call that says "collective" must be made by all ranks of the communicator, in the same
// order. Each rank gives its own queries, any number of them or none, and gets their answers in its
// own order. An error on one rank is thrown on all: the same type, and a message that begins with
// that rank. Ranks whose calls or options differ get an InputError that names two of them.
#pragma once

#include <mpi.h>
#include <raydix/buffer.h>
#include <raydix/bvh.h>
#include <raydix/error.h>
#include <raydix/mesh.h>
#include <raydix/picture.h>
#include <raydix/points.h>
#include <raydix/scene.h>
#include <raydix/scene_queries.h>
#include <raydix/types.h>

#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

namespace raydix::mpi {

/// MPI itself failed. The message names the MPI call.
class CommunicationError : public std::runtime_error {
public:
    using std::runtime_error::runtime_error;
};

/// Stands in 64-bit numbers for "nothing was found".
inline constexpr std::uint64_t no_global = std::numeric_limits<std::uint64_t>::max();

/// Which rank holds what. Answers do not depend on it.
enum class Partition : std::uint32_t {
    as_given = 0,  // each rank keeps what it gave
    curve = 1,     // all is sorted along one Morton curve; each rank holds a run of about equal
                   // length. Queries then reach few ranks
};

struct Options {
    Partition partition = Partition::curve;
    bool strict = false;  // true: what would be left out is an InputError
    int threads = 0;      // of each rank: 0 to 1,024; 0: all the machine has
    /// The most bytes that a rank takes in during a round, questions or answers, one long answer
    /// aside. Fewer bytes mean more rounds.
    std::uint64_t exchange_bytes = std::uint64_t{64} << 20;
    std::uint64_t message_bytes = std::uint64_t{1} << 20;  // the most of one message
    /// Boxes around what a rank holds that every rank knows. More boxes make queries reach fewer
    /// ranks for nothing, and cost memory on all: 1 to 4,096.
    std::uint32_t boxes_per_rank = 64;
    /// Called with true before a rank computes and with false after it; must not throw. For
    /// programs with more ranks than processors, which may hold a rank back.
    std::function<void(bool)> compute_gate = {};
};

/// What this rank sent to others.
struct Traffic {
    std::uint64_t messages = 0, bytes = 0;  // between two ranks, of questions, answers and parts
    std::uint64_t collectives = 0;          // calls that all ranks take part in
};

/// What a call took, on this rank.
struct CallReport {
    std::uint64_t rounds = 0;
    std::uint64_t questions = 0;  // asked of ranks, this one included
    std::uint64_t answered = 0;   // questions of all ranks that this one answered
    /// Questions that two rounds would take: of each query one to the nearest rank, then one to
    /// every rank that its answer leaves, the nearest again. Counted, not asked.
    std::uint64_t two_round_questions = 0;
    Traffic traffic;
    double compute_seconds = 0;  // processor time of all threads, waiting for others left out
};

/// What an object holds, on this rank and on all.
struct Holding {
    std::uint64_t size = 0, left_out = 0;  // of all ranks: elements given, and those left out
    std::uint64_t local = 0;               // elements that this rank holds
    std::uint64_t first = 0;               // the number of the first element that this rank gave
    /// Of a scene: ways to instances on this rank, and on the ranks before it. Hits on this rank's
    /// ways have the instances first_path + 1 to first_path + paths.
    std::uint64_t paths = 0, first_path = 0;
    std::uint64_t replicated_bytes = 0;  // of the tree over the boxes of all ranks
    std::uint64_t bytes = 0;             // that queries read on this rank
    CallReport report;                   // of the construction
};

struct QueryOptions {
    bool sort = false;  // true: rows by (squared distance, number). false: by number
    /// The most bytes that the result may take on this rank. 0: half of what is left to the process
    /// (result_limit.h).
    std::uint64_t max_result_bytes = 0;
};

/// As raydix::NearestPoints, with numbers that count through the ranks.
template <class Scalar>
struct NearestRows {
    Buffer<std::uint64_t> indices;  // [queries * k]; no_global behind the last point
    Buffer<Scalar> distances;       // [queries * k]; infinity behind the last point
    QueryCounts counts;             // of this rank's queries
    CallReport report;
};

/// As raydix::PointLists, with numbers that count through the ranks.
template <class Scalar>
struct PointRows {
    Buffer<std::uint64_t> offsets;  // [queries + 1]
    Buffer<std::uint64_t> indices;
    Buffer<Scalar> distances;
    QueryCounts counts;
    CallReport report;
};

/// Points in 3-D spread over ranks. Point i of rank r has the number i + (points that the ranks
/// before r gave). Move-only. To destroy it is collective too, while MPI runs.
template <class Scalar>
class BasicDistributedPoints {
public:
    using Index = PointIndex<Scalar, 3>;
    using Point = typename Index::Point;
    using Box = typename Index::Box;

    /// Collective. Points that are not finite or have a coordinate beyond 1e12 are left out and
    /// counted. Throws InputError: 2^31 points or more on one rank, an option out of range.
    BasicDistributedPoints(MPI_Comm comm, std::span<const Point> points,
                           const Options& options = {});
    ~BasicDistributedPoints();
    BasicDistributedPoints(BasicDistributedPoints&&) noexcept;
    BasicDistributedPoints& operator=(BasicDistributedPoints&&) noexcept;

    [[nodiscard]] const Holding& holding() const;

    /// Collective. The k nearest points of each query by (d2, number), as raydix::knn. All ranks
    /// give the same k. Throws InputError: k = 0. Throws ResultTooLarge before the result is
    /// allocated.
    [[nodiscard]] NearestRows<Scalar> knn(std::span<const Point> queries, std::uint32_t k,
                                          const QueryOptions& options = {}) const;
    /// Collective. All points with d2 <= R*R, as raydix::radius_search. All ranks give the same
    /// radius and `sort`.
    [[nodiscard]] PointRows<Scalar> radius(std::span<const Point> queries, Scalar radius,
                                           const QueryOptions& options = {}) const;
    /// Collective. All points in each closed box, ascending, as raydix::box_search.
    [[nodiscard]] PointRows<Scalar> box(std::span<const Box> boxes,
                                        const QueryOptions& options = {}) const;

private:
    struct State;
    std::unique_ptr<State> state_;
};
extern template class BasicDistributedPoints<float>;
extern template class BasicDistributedPoints<double>;
using DistributedPoints = BasicDistributedPoints<float>;
using DistributedPointsD = BasicDistributedPoints<double>;

struct SceneOptions : Options {
    /// false: what all ranks give are geometries 0, 1, 2, ... in rank order, and `prim` counts
    /// within each. true: the meshes are parts of one geometry, 0, and `prim` counts through all of
    /// them, in rank order. For a mesh that no rank holds whole.
    bool one_geometry = false;
    Quality quality = Quality::balanced;  // of the tree on each rank. Hits do not depend on it
};

/// What a rank gives of a scene: one of a mesh, shapes, geometry of the caller's own, and an
/// instance of a scene that the rank holds. Without any it only takes a number. All but triangles
/// of meshes stay on that rank.
template <class Scalar>
struct BasicDistributedGeometry {
    BasicMeshView<Scalar> mesh{};
    /// Not null: an instance of this scene as its last commit left it. It need not outlive the
    /// construction.
    const BasicScene<Scalar>* scene = nullptr;
    BasicTransform<Scalar> transform{};  // of an instance
    std::uint32_t mask = 0xFFFFFFFFu;    // as GeometryOptions::mask
    // As Scene::add takes them.
    std::span<const BasicSphere<Scalar>> spheres = {};
    std::span<const BasicCapsule<Scalar>> capsules = {};
    std::span<const BasicVec3<Scalar>> points = {};
    Scalar radius = 0;  // of points
    /// Not null: geometry whose test answers by the ray alone. The place of a ray that it is told
    /// has no meaning here.
    const BasicUserGeometry<Scalar>* user = nullptr;
};
using DistributedGeometry = BasicDistributedGeometry<float>;
using DistributedGeometryD = BasicDistributedGeometry<double>;

/// A raydix::Hit with a 64-bit prim. Paths to instances count from 1 through the ranks, in rank
/// order; `geometry` of a hit in an instance is the id in the scene that stands there.
template <class Scalar>
struct BasicDistributedHit {
    Scalar t = infinity;
    Scalar u = 0, v = 0;
    std::uint32_t geometry = no_primitive;
    std::uint32_t instance = 0;
    std::uint64_t prim = no_global;

    [[nodiscard]] constexpr bool hit() const { return prim != no_global; }
};
using DistributedHit = BasicDistributedHit<float>;
using DistributedHitD = BasicDistributedHit<double>;

/// Says whether a hit counts, as raydix::HitFilter. It is called on the rank that holds what was
/// hit, so all ranks give the same function, and the answer may depend on the arguments alone. tmax
/// of the ray may be less than its caller gave: rays travel with their best hit so far.
template <class Scalar>
using BasicDistributedFilter =
    std::function<bool(const BasicRay<Scalar>& ray, const BasicDistributedHit<Scalar>& hit)>;
using DistributedFilter = BasicDistributedFilter<float>;
using DistributedFilterD = BasicDistributedFilter<double>;

/// Of the rays of this rank.
template <class Scalar>
struct BasicTraceOptions {
    std::uint32_t mask = 0xFFFFFFFFu;            // of all of them
    std::span<const std::uint32_t> masks = {};   // [rays], one for each ray instead; or empty
    BasicDistributedFilter<Scalar> filter = {};  // on all ranks; empty: all hits count
    /// trace_all only: as QueryOptions::max_result_bytes.
    std::uint64_t max_result_bytes = 0;
};
using TraceOptions = BasicTraceOptions<float>;
using TraceOptionsD = BasicTraceOptions<double>;

/// A raydix::SceneClosestPoint with a 64-bit prim.
template <class Scalar>
struct BasicDistributedClosest {
    BasicVec3<Scalar> position{infinity, infinity, infinity};
    Scalar distance = infinity;
    Scalar u = 0, v = 0;
    std::uint32_t geometry = no_primitive;
    std::uint32_t instance = 0;
    std::uint64_t prim = no_global;

    [[nodiscard]] constexpr bool found() const { return prim != no_global; }
};

/// Answers, one for each query of this rank.
template <class Answer, class Counts>
struct Answers {
    std::vector<Answer> values;
    Counts counts;  // of this rank's queries
    CallReport report;
};

/// All hits: those of ray i are hits[offsets[i]] .. hits[offsets[i + 1]].
template <class Scalar>
struct HitRows {
    Buffer<std::uint64_t> offsets;  // [rays + 1]
    Buffer<BasicDistributedHit<Scalar>> hits;
    TraceCounts counts;
    CallReport report;
};

/// Meshes, shapes and instances spread over ranks, asked as a raydix::Scene of all of them.
/// Move-only. To destroy it is collective too, while MPI runs.
template <class Scalar>
class BasicDistributedScene {
public:
    using MeshView = BasicMeshView<Scalar>;
    using Geometry = BasicDistributedGeometry<Scalar>;
    using Ray = BasicRay<Scalar>;
    using Point = BasicVec3<Scalar>;
    using Hit = BasicDistributedHit<Scalar>;
    using Closest = BasicDistributedClosest<Scalar>;
    using TraceOptions = BasicTraceOptions<Scalar>;

    /// Collective. The meshes are copied. One without triangles only takes a number. Triangles that
    /// are not finite or out of range are left out and counted. Throws InputError: an index past
    /// the vertices, 2^31 triangles or more on one rank, 2^32 - 2 geometries or paths or more on
    /// all, an option out of range, a geometry that is several things, shapes with one_geometry,
    /// and as Scene::add and Scene::commit.
    BasicDistributedScene(MPI_Comm comm, std::span<const Geometry> geometries,
                          const SceneOptions& options = {});
    /// The same of meshes alone, which all rays see.
    BasicDistributedScene(MPI_Comm comm, std::span<const MeshView> meshes,
                          const SceneOptions& options = {});
    ~BasicDistributedScene();
    BasicDistributedScene(BasicDistributedScene&&) noexcept;
    BasicDistributedScene& operator=(BasicDistributedScene&&) noexcept;

    /// Elements are triangles and shapes, those of instances left out.
    [[nodiscard]] const Holding& holding() const;

    /// Collective. The closest hit of each ray: the least (t, instance, geometry, prim), as
    /// raydix::trace. Throws InputError: masks that are not as many as rays, a filter on some ranks
    /// alone.
    [[nodiscard]] Answers<Hit, TraceCounts> trace(std::span<const Ray> rays,
                                                  const TraceOptions& options = {}) const;
    /// Collective. Whether each ray hits anything: 1 or 0.
    [[nodiscard]] Answers<std::uint8_t, TraceCounts> trace_any(
        std::span<const Ray> rays, const TraceOptions& options = {}) const;
    /// Collective. All hits of each ray, sorted by (t, instance, geometry, prim), as
    /// raydix::trace_all.
    [[nodiscard]] HitRows<Scalar> trace_all(std::span<const Ray> rays,
                                            const TraceOptions& options = {}) const;
    /// Collective. The closest point of all triangles and shapes to each query, as
    /// raydix::closest_points. All ranks give the same max_distance and mask. Throws InputError if
    /// max_distance is negative or NaN, and if the mask shows user geometry.
    [[nodiscard]] Answers<Closest, QueryCounts> closest_points(
        std::span<const Point> queries, Scalar max_distance = infinity,
        std::uint32_t mask = 0xFFFFFFFFu) const;
    /// Collective. Whether each query is inside: 1 or 0. Inside means that the way to infinity
    /// crosses an odd number of triangles, or that the query is on one: InsideRule::parity of all
    /// meshes together, those in instances moved as raydix::contains moves them. Exact for closed
    /// meshes. The first call makes a second tree on each rank. Throws InputError if a geometry
    /// with a bit in its mask has spheres or other shapes.
    [[nodiscard]] Answers<std::uint8_t, QueryCounts> contains(std::span<const Point> queries) const;

private:
    template <class>
    friend struct DistributedSceneInternals;
    struct State;
    std::unique_ptr<State> state_;
};
extern template class BasicDistributedScene<float>;
extern template class BasicDistributedScene<double>;
using DistributedScene = BasicDistributedScene<float>;
using DistributedSceneD = BasicDistributedScene<double>;

/// This rank's part of a file.
struct FilePart {
    Mesh mesh;                                  // a run of triangles and the vertices they use; or
                                                // a run of points
    std::uint64_t vertices = 0, triangles = 0;  // of the whole file, or of all files
};

/// Collective. Each rank reads its part of a file by offset: equal runs of triangles, or of points
/// where there are none, in rank order, as raydix::load_model numbers them. For uncompressed binary
/// .ply files with triangles alone or no faces, uncompressed .npy files in C order, and .rdx files
/// that hold a tree of triangles or points, or a scene of meshes alone in float (one after the
/// other by their ids). Of .rdx files only the header's checksum is compared. Gives nothing, on all
/// ranks, for any other file: one rank must read that. All ranks give the same file. Throws
/// InputError that names the file: one that cannot be read, a header that is broken, a face with a
/// vertex that is not there.
[[nodiscard]] std::optional<FilePart> load_part(MPI_Comm comm, const std::filesystem::path& file);
/// The same of several files, one after the other: their triangles, or points where none has any,
/// count through. Every rank reads the head of each file.
[[nodiscard]] std::optional<FilePart> load_part(MPI_Comm comm,
                                                std::span<const std::filesystem::path> files);

/// Collective. raydix::tree_hash of the tree that build_bvh makes of one mesh: the triangles of all
/// ranks in rank order. The ranks sort them along one Morton curve and make the nodes that begin on
/// each; rank 0 hashes their words, rank by rank. All ranks give the same options, `threads` aside.
/// Throws InputError: a builder whose trees do not follow from sorted codes alone (not karras,
/// lauterbach, garanzha or apetrei, or with reinsertion), 2^31 triangles or more on all ranks, and
/// as build_bvh.
[[nodiscard]] std::string tree_hash(MPI_Comm comm, const MeshView& mesh,
                                    const BuildOptions& options = {});

/// Collective. Renders a scene that every rank holds whole, as raydix::render: the ranks take parts
/// of the picture from a shared counter until none is left. Rank 0 gets the picture, with the bits
/// of one process; the others get an empty one. All ranks give the same scene, camera and options,
/// `threads` aside. Progress is told on rank 0 alone, by the calling thread. Throws InputError as
/// raydix::render does, and if the boxes of the scenes or the arguments differ.
[[nodiscard]] Picture render(MPI_Comm comm, const Scene& scene, const Camera& camera,
                             const RenderOptions& options = {});
[[nodiscard]] Picture render(MPI_Comm comm, const SceneD& scene, const CameraD& camera,
                             const RenderOptions& options = {});

/// Collective. Renders a scene that is spread over the ranks, as raydix::render: every rank makes
/// the rays of its share of the picture on one thread, and all trace them together. All views but
/// `steps`; that throws InputError. `threads` has no effect: rays take those of the scene.
/// Otherwise as above.
[[nodiscard]] Picture render(const DistributedScene& scene, const Camera& camera,
                             const RenderOptions& options = {});
[[nodiscard]] Picture render(const DistributedSceneD& scene, const CameraD& camera,
                             const RenderOptions& options = {});

}  // namespace raydix::mpi
