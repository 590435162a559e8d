// An index over points that answers who is near: the k nearest, all within a radius or a box, all
// pairs within a distance. float32 and float64, 2-D and 3-D.
//
// Distances are true ones: sqrt(d2) with d2 = (dx*dx + dy*dy) + dz*dz in the index's own scalar,
// without FMA (docs/contract.md 8); in 2-D d2 = dx*dx + dy*dy. Nearest points are ordered by (d2,
// index); a point is within a radius R if d2 <= R*R. Answers are exact, and the same for every kind
// of tree, number of threads, instruction set and order of queries.
#pragma once

#include <raydix/buffer.h>
#include <raydix/types.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

namespace raydix {

struct Vec2 {
    float x, y;
};
struct Vec2d {
    double x, y;
};

/// A closed box of any of these points.
template <class Point>
struct PointBox {
    Point lo, hi;
};

namespace detail {
template <class Scalar, int Dim>
struct PointOf;
template <>
struct PointOf<float, 2> {
    using Point = Vec2;
    using Box = PointBox<Vec2>;
};
template <>
struct PointOf<float, 3> {
    using Point = Vec3;
    using Box = Aabb;
};
template <>
struct PointOf<double, 2> {
    using Point = Vec2d;
    using Box = PointBox<Vec2d>;
};
template <>
struct PointOf<double, 3> {
    using Point = Vec3d;
    using Box = PointBox<Vec3d>;
};
}  // namespace detail

/// How points are put into groups of 16, and those into larger ones. Answers do not depend on it.
enum class PointsTree : std::uint32_t {
    automatic = 0,  // kdtree, but bvh where the curve alone already parts the points well
    kdtree = 1,     // short runs of the Morton curve are halved at the median of their widest side
    bvh = 2,        // runs of the Morton curve as they are: built faster, boxes overlap more
};
[[nodiscard]] std::string_view points_tree_name(PointsTree tree);
/// Throws InputError that lists the known names.
[[nodiscard]] PointsTree points_tree_from_name(std::string_view name);

struct PointsOptions {
    PointsTree tree = PointsTree::automatic;
    bool strict = false;  // points that are not finite or beyond 1e12 are an InputError
    int threads = 0;      // 0 to 1,024; 0: all the machine has. The index does not depend on it
};

/// Milliseconds of a build.
struct PointsBuildMs {
    double bounds = 0, sort = 0, nodes = 0, leaves = 0, boxes = 0, total = 0;
};

namespace detail {
template <class Scalar, int Dim>
struct PointArrays;
}

/// A finished index. Owns copies of the points, in the order of its tree; move-only. Made by
/// `build_points`; an index that was never built is empty and may be asked.
template <class Scalar_, int Dim_>
class PointIndex {
    static_assert((std::is_same_v<Scalar_, float> || std::is_same_v<Scalar_, double>)&&(Dim_ == 2 ||
                                                                                        Dim_ == 3));

public:
    using Scalar = Scalar_;
    static constexpr int dimension = Dim_;
    using Point = typename detail::PointOf<Scalar, Dim_>::Point;
    using Box = typename detail::PointOf<Scalar, Dim_>::Box;

    PointIndex();
    ~PointIndex();
    PointIndex(PointIndex&&) noexcept;
    PointIndex& operator=(PointIndex&&) noexcept;

    /// The same as a new index over `points`, with the options of the last build or others, in the
    /// memory of the old one, which grows only where it is too small; scratch is kept as well from
    /// the first rebuild on. Throws what `build_points` throws; the index is then empty.
    void rebuild(std::span<const Point> points);
    void rebuild(std::span<const Point> points, const PointsOptions& options);

    /// Points that are in the index; the caller gave left_out() more.
    [[nodiscard]] std::uint32_t size() const;
    [[nodiscard]] bool empty() const { return size() == 0; }
    [[nodiscard]] std::uint64_t input_count() const;
    [[nodiscard]] std::uint64_t left_out() const;
    /// Around all points in the index; lo > hi if there are none.
    [[nodiscard]] Box bounds() const;
    /// As given, and the tree that was chosen: kdtree or bvh.
    [[nodiscard]] const PointsOptions& options() const;
    [[nodiscard]] PointsTree tree() const;
    /// Groups of 16 points, inner nodes above them, and edges from the root to a group.
    [[nodiscard]] std::uint32_t leaf_count() const;
    [[nodiscard]] std::uint32_t node_count() const;
    [[nodiscard]] std::uint32_t depth() const;
    /// Every byte a query touches.
    [[nodiscard]] std::uint64_t bytes() const;
    /// Most bytes that the last build held at once, index included, above its input.
    [[nodiscard]] std::uint64_t peak_bytes() const;
    [[nodiscard]] const PointsBuildMs& build_ms() const;
    /// Position in the index -> the caller's index of that point, [size()]: a copy.
    [[nodiscard]] std::vector<std::uint32_t> order() const;

    /// What the queries read (src).
    [[nodiscard]] const detail::PointArrays<Scalar, Dim_>& arrays() const;

private:
    std::unique_ptr<detail::PointArrays<Scalar, Dim_>> arrays_;
};

using Points = PointIndex<float, 3>;
using Points2 = PointIndex<float, 2>;
using PointsD = PointIndex<double, 3>;   // D: double
using Points2D = PointIndex<double, 2>;  // two coordinates, double

/// points [n] -> an index of them. Points that are not finite or have a coordinate beyond 1e12 are
/// left out and counted, or an error with `options.strict`. Same input, same index, for every
/// number of threads. Throws InputError: 2^31 points or more, an invalid point with `strict` (it is
/// named).
[[nodiscard]] Points build_points(std::span<const Vec3> points, const PointsOptions& options = {});
[[nodiscard]] Points2 build_points(std::span<const Vec2> points, const PointsOptions& options = {});
[[nodiscard]] PointsD build_points(std::span<const Vec3d> points,
                                   const PointsOptions& options = {});
[[nodiscard]] Points2D build_points(std::span<const Vec2d> points,
                                    const PointsOptions& options = {});

/// In which order a batch is worked off. Answers do not depend on it.
enum class QueryOrder : std::uint32_t {
    automatic = 0,  // as given where neighbours in the batch are neighbours in space, else sorted
    as_given = 1,
    sorted = 2,  // along a Morton curve
};

struct PointQueryOptions {
    int threads = 0;    // 0 to 1,024; 0: all the machine has
    bool sort = false;  // rows by (distance, index) instead of by index
    QueryOrder order = QueryOrder::automatic;
    /// Bounds the peak of a call that makes room for its result. 0: half of what is left
    /// (result_limit.h).
    std::uint64_t max_result_bytes = 0;
    std::string isa = {};  // one of point_instruction_sets(); empty: the best
};

/// Instruction sets that batches can run in here, best first.
[[nodiscard]] std::vector<std::string> point_instruction_sets();

struct PointQueryCounts {
    std::uint64_t queries = 0;
    std::uint64_t invalid_queries = 0;  // a coordinate is NaN or Inf: nothing is near
    std::uint64_t found = 0;            // points, over all queries
};

/// The k nearest of each query: row i is [i * k, (i + 1) * k) of both. Where there are fewer than k
/// points the row ends with no_primitive and infinity.
template <class Scalar>
struct NearestPoints {
    Buffer<std::uint32_t> indices;  // [queries * k]
    Buffer<Scalar> distances;       // [queries * k]
    PointQueryCounts counts;
};

/// Rows of any length: those of query i are [offsets[i], offsets[i + 1]) of the other two.
template <class Scalar>
struct PointLists {
    Buffer<std::uint64_t> offsets;  // [queries + 1]
    Buffer<std::uint32_t> indices;
    Buffer<Scalar> distances;
    PointQueryCounts counts;
};

// The functions below are templates over the four kinds of index, instantiated in the library.
// `Point` and `Scalar` are those of the index: knn(index, std::span<const Vec3>(...), 8).
template <class Index>
using PointsOf = std::type_identity_t<std::span<const typename Index::Point>>;
template <class Index>
using ScalarsOf = std::type_identity_t<std::span<typename Index::Scalar>>;
template <class Index>
using ScalarOf = std::type_identity_t<typename Index::Scalar>;

/// queries [n] -> indices and distances [n * k], the query's own point included if it is one of the
/// index. Throws InputError: k = 0, sizes that do not fit. What makes
/// room for its result throws ResultTooLarge, before it does so.
template <class Index>
PointQueryCounts knn(const Index& index, PointsOf<Index> queries, std::uint32_t k,
                     std::span<std::uint32_t> indices, ScalarsOf<Index> distances,
                     const PointQueryOptions& options = {});
template <class Index>
[[nodiscard]] NearestPoints<typename Index::Scalar> knn(const Index& index, PointsOf<Index> queries,
                                                        std::uint32_t k,
                                                        const PointQueryOptions& options = {});
/// One query: indices and distances [k], any k > 0, nothing is allocated. Returns how many there
/// are.
template <class Index>
std::uint32_t knn(const Index& index, const typename Index::Point& query,
                  std::span<std::uint32_t> indices, ScalarsOf<Index> distances);

/// All points with d2 <= R*R. Zero finds equal points, infinity all. Throws InputError: a radius is
/// negative or NaN (it is named). ResultTooLarge, an InputError: the call would take more than
/// options.max_result_bytes; known before the result is allocated.
template <class Index>
[[nodiscard]] PointLists<typename Index::Scalar> radius_search(
    const Index& index, PointsOf<Index> queries, ScalarOf<Index> radius,
    const PointQueryOptions& options = {});
/// The same with a radius for each query: radii [n].
template <class Index>
[[nodiscard]] PointLists<typename Index::Scalar> radius_search(
    const Index& index, PointsOf<Index> queries,
    std::type_identity_t<std::span<const typename Index::Scalar>> radii,
    const PointQueryOptions& options = {});
/// How many there are: queries [n] -> counts [n].
template <class Index>
PointQueryCounts radius_count(const Index& index, PointsOf<Index> queries, ScalarOf<Index> radius,
                              std::span<std::uint32_t> counts,
                              const PointQueryOptions& options = {});
/// One query.
template <class Index>
[[nodiscard]] std::uint32_t radius_count(const Index& index, const typename Index::Point& query,
                                         ScalarOf<Index> radius);

/// All points in each closed box, ascending by index; their distance from the box is 0. A box with
/// lo > hi holds none; one with NaN or Inf neither, and counts as invalid.
template <class Index>
[[nodiscard]] PointLists<typename Index::Scalar> box_search(
    const Index& index, std::type_identity_t<std::span<const typename Index::Box>> boxes,
    const PointQueryOptions& options = {});

/// Which of the two rows a pair of neighbours stands in.
enum class PairRows : std::uint32_t {
    half = 0,  // once, in the row of the lower index
    full = 1,  // in both
};

/// The points within `radius` of each point, itself left out: one row for each point that the index
/// was built from, invalid ones have none. Two points at the same place are neighbours.
template <class Index>
[[nodiscard]] PointLists<typename Index::Scalar> neighbour_lists(
    const Index& index, ScalarOf<Index> radius, PairRows rows,
    const PointQueryOptions& options = {});

namespace detail {
/// Type-erased `for_each_in_radius`: call(data, index, distance) until it says false.
template <class Index>
bool visit_radius(const Index& index, const typename Index::Point& query,
                  typename Index::Scalar radius,
                  bool (*call)(void*, std::uint32_t, typename Index::Scalar), void* data);
}  // namespace detail

/// Calls visit(index, distance) for the points within the radius, in the order of the tree, until
/// it returns false; nothing is allocated. Returns whether all were visited. Throws InputError as
/// `radius_search` does.
template <class Index, class Visit>
bool for_each_in_radius(const Index& index, const typename Index::Point& query,
                        ScalarOf<Index> radius, Visit&& visit) {
    return detail::visit_radius(
        index, query, radius,
        [](void* data, std::uint32_t point, typename Index::Scalar distance) -> bool {
            return (*static_cast<std::remove_reference_t<Visit>*>(data))(point, distance);
        },
        const_cast<void*>(static_cast<const void*>(std::addressof(visit))));
}

}  // namespace raydix
