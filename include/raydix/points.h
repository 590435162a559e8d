// An index over points that finds what is near: the k nearest, all within a radius or a box, all
// pairs within a distance. float32 and float64, 2-D and 3-D.
//
// Distances are sqrt(d2) with d2 = (dx*dx + dy*dy) + dz*dz in the index's own type, without FMA
// (docs/contract.md 8). In 2-D d2 = dx*dx + dy*dy. Nearest points are ordered by (d2, index). A
// point is within a radius R if d2 <= R*R. Answers are exact. They are the same for every kind of
// tree, number of threads, instruction set and order of queries. Any number of threads may ask one
// index at once.
#pragma once

#include <raydix/batch.h>
#include <raydix/buffer.h>
#include <raydix/types.h>

#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

namespace raydix {

template <class Scalar>
struct BasicVec2 {
    Scalar x, y;
};
using Vec2 = BasicVec2<float>;
using Vec2d = BasicVec2<double>;

/// A closed box between two points of a type.
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
    automatic = 0,  // kdtree: no points were found on which bvh answers faster
    kdtree = 1,     // short runs of the curve are halved at the median of their widest side
    bvh = 2,        // runs of the curve as they are. Built faster; boxes overlap more
};
[[nodiscard]] std::string_view points_tree_name(PointsTree tree);
/// Throws InputError that lists the known names.
[[nodiscard]] PointsTree points_tree_from_name(std::string_view name);

struct PointsOptions {
    PointsTree tree = PointsTree::automatic;
    bool strict = false;  // true: a point that is not finite or beyond 1e12 is an InputError
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

/// A finished index, made by `build_points`. Owns copies of the points, in the order of its tree.
/// Move-only. An index that was never built is empty and may be asked.
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

    /// Makes the index that `build_points` would make, in the memory of this one. Without `options`
    /// those of the last build hold. The memory grows only where it is too small. Scratch is kept
    /// too, from the first rebuild on. Needs the index for itself. Throws what `build_points`
    /// throws; the index is then empty, and its options are those of the last build.
    void rebuild(std::span<const Point> points);
    void rebuild(std::span<const Point> points, const PointsOptions& options);

    /// Adds points. Their numbers go on where those before ended: the first has the number
    /// input_count(), which is returned. A number is never given again, also not that of a point
    /// that was removed or left out. Answers are those of a fresh index over the same points, bit
    /// for bit, but for the numbers; queries take up to twice its time. Of n points a batch of b
    /// costs on average what building b * log(n / b) points does, within a small factor. Four bytes
    /// are kept for each number ever given. Needs the index for itself. Throws InputError, and
    /// nothing is added: 2^31 numbers or more; with options.strict the first point that would be
    /// left out (it is named by its place in `points`).
    std::uint32_t insert(std::span<const Point> points);
    /// Removes points by their numbers. Those that are not in the index any more, or were left out,
    /// are passed over. Returns how many were removed. All is built again when more than a quarter
    /// of the points have gone; where that fails, for want of memory or of a thread, queries stay
    /// slower until a later removal. Needs the index for itself. Throws InputError, and nothing is
    /// removed: a number that was never given.
    std::uint32_t remove(std::span<const std::uint32_t> ids);

    /// Number of points in the index.
    [[nodiscard]] std::uint32_t size() const;
    [[nodiscard]] bool empty() const { return size() == 0; }
    /// Number of points that the caller gave, those removed included, and of those that were left
    /// out.
    [[nodiscard]] std::uint64_t input_count() const;
    [[nodiscard]] std::uint64_t left_out() const;
    /// The box around all points in the index; lo > hi if there are none.
    [[nodiscard]] Box bounds() const;
    /// The options as given, and the tree that was chosen: kdtree or bvh.
    [[nodiscard]] const PointsOptions& options() const;
    [[nodiscard]] PointsTree tree() const;
    /// Number of groups of 16 points, of nodes above them, and of edges from the root to a group.
    [[nodiscard]] std::uint32_t leaf_count() const;
    [[nodiscard]] std::uint32_t node_count() const;
    [[nodiscard]] std::uint32_t depth() const;
    /// Every byte a query touches.
    [[nodiscard]] std::uint64_t bytes() const;
    /// Most bytes that the last build held at once: the index included, its input not.
    [[nodiscard]] std::uint64_t peak_bytes() const;
    [[nodiscard]] const PointsBuildMs& build_ms() const;
    /// Position in the index -> the caller's index of that point, [size()]: a copy.
    [[nodiscard]] std::vector<std::uint32_t> order() const;
    /// Position in the index -> the point there, [size()]: a copy.
    [[nodiscard]] std::vector<Point> points() const;

    /// What the queries read; for the library's own use.
    [[nodiscard]] const detail::PointArrays<Scalar, Dim_>& arrays() const;

private:
    std::unique_ptr<detail::PointArrays<Scalar, Dim_>> arrays_;
};

using Points = PointIndex<float, 3>;
using Points2 = PointIndex<float, 2>;
using PointsD = PointIndex<double, 3>;   // D: double
using Points2D = PointIndex<double, 2>;  // two coordinates, double

/// Builds an index of points. Points that are not finite or have a coordinate beyond 1e12 are left
/// out and counted. The others keep their numbers. The index does not depend on the number of
/// threads. Throws InputError: 2^31 points or more; with `options.strict` the first point that
/// would be left out (it is named).
[[nodiscard]] Points build_points(std::span<const Vec3> points, const PointsOptions& options = {});
[[nodiscard]] Points2 build_points(std::span<const Vec2> points, const PointsOptions& options = {});
[[nodiscard]] PointsD build_points(std::span<const Vec3d> points,
                                   const PointsOptions& options = {});
[[nodiscard]] Points2D build_points(std::span<const Vec2d> points,
                                    const PointsOptions& options = {});

/// In which order a batch is worked off. Answers do not depend on it.
enum class QueryOrder : std::uint32_t {
    automatic = 0,  // as_given if neighbours in the batch are neighbours in space, else sorted
    as_given = 1,
    sorted = 2,  // along a Morton curve
};

struct PointQueryOptions {
    int threads = 0;    // 0 to 1,024; 0: all the machine has
    bool sort = false;  // true: rows by (d2, index). false: by index
    QueryOrder order = QueryOrder::automatic;
    /// The most bytes that a call may hold which makes room for its result. 0: half of what is left
    /// to the process (result_limit.h).
    std::uint64_t max_result_bytes = 0;
    std::string isa = {};  // one of point_instruction_sets(); empty: the best
    /// Of knn: points farther away do not count, as radius_search has it. Rounded to the index's
    /// type. 0 or more.
    double max_distance = std::numeric_limits<double>::infinity();
};

/// Instruction sets that batches can run in here, best first.
[[nodiscard]] std::vector<std::string> point_instruction_sets();

/// The k nearest of each query. Row i is [i * k, (i + 1) * k) of both arrays. Where there are fewer
/// than k points, or fewer within max_distance, the row ends with no_primitive and infinity.
template <class Scalar>
struct NearestPoints {
    Buffer<std::uint32_t> indices;  // [queries * k]
    Buffer<Scalar> distances;       // [queries * k]
    QueryCounts counts;
};

/// Rows of any length. That of query i is [offsets[i], offsets[i + 1]) of the other two arrays.
template <class Scalar>
struct PointLists {
    Buffer<std::uint64_t> offsets;  // [queries + 1]
    Buffer<std::uint32_t> indices;
    Buffer<Scalar> distances;
    QueryCounts counts;
};

// The functions below are templates over the four kinds of index, instantiated in the library.
// `Point` and `Scalar` are those of the index: knn(index, std::span<const Vec3>(...), 8).
template <class Index>
using PointsOf = std::type_identity_t<std::span<const typename Index::Point>>;
template <class Index>
using ScalarsOf = std::type_identity_t<std::span<typename Index::Scalar>>;
template <class Index>
using ScalarOf = std::type_identity_t<typename Index::Scalar>;

/// Finds the k nearest points of each query, a point at the query's own place included. queries [n]
/// -> indices and distances [n * k]. A query that is not finite finds nothing and is counted.
/// Throws InputError: k = 0, sizes that do not fit, a max_distance that is negative or NaN. The
/// form that returns NearestPoints throws ResultTooLarge before it makes room for more than
/// options.max_result_bytes.
template <class Index>
QueryCounts knn(const Index& index, PointsOf<Index> queries, std::uint32_t k,
                std::span<std::uint32_t> indices, ScalarsOf<Index> distances,
                const PointQueryOptions& options = {});
template <class Index>
[[nodiscard]] NearestPoints<typename Index::Scalar> knn(const Index& index, PointsOf<Index> queries,
                                                        std::uint32_t k,
                                                        const PointQueryOptions& options = {});
/// One query: indices and distances [k] for any k > 0. Nothing is allocated. Returns how many were
/// found. `max_distance` as in PointQueryOptions.
template <class Index>
std::uint32_t knn(const Index& index, const typename Index::Point& query,
                  std::span<std::uint32_t> indices, ScalarsOf<Index> distances,
                  double max_distance = std::numeric_limits<double>::infinity());

/// Finds all points with d2 <= R*R. A radius of 0 finds points at the same place, infinity all.
/// Throws InputError if a radius is negative or NaN (it is named). Throws ResultTooLarge, an
/// InputError, before the result is allocated, if the call would take more than
/// options.max_result_bytes.
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
/// Counts the points within the radius: queries [n] -> counts [n].
template <class Index>
QueryCounts radius_count(const Index& index, PointsOf<Index> queries, ScalarOf<Index> radius,
                         std::span<std::uint32_t> counts, const PointQueryOptions& options = {});
/// One query.
template <class Index>
[[nodiscard]] std::uint32_t radius_count(const Index& index, const typename Index::Point& query,
                                         ScalarOf<Index> radius);

/// Finds all points in each closed box, ascending by index. The distances are 0. A box with lo > hi
/// holds none. A box with NaN or Inf holds none and is counted as invalid.
template <class Index>
[[nodiscard]] PointLists<typename Index::Scalar> box_search(
    const Index& index, std::type_identity_t<std::span<const typename Index::Box>> boxes,
    const PointQueryOptions& options = {});

/// Which of the two rows a pair of neighbours stands in.
enum class PairRows : std::uint32_t {
    half = 0,  // once, in the row of the lower index
    full = 1,  // in both
};

/// Finds the points within `radius` of each point of the index, itself left out. There is a row for
/// each point that the caller gave; the row of a point that was left out is empty. Two points at
/// the same place are neighbours. Throws as radius_search does.
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

/// Calls visit(index, distance) for the points within the radius, on the caller's thread and in the
/// order of the tree, until it returns false. Nothing is allocated. Returns whether all were
/// visited. Throws InputError as `radius_search` does, and what `visit` throws.
template <class Index, class Visit>
bool for_each_in_radius(const Index& index, const typename Index::Point& query,
                        ScalarOf<Index> radius, Visit&& visit) {
    auto* visitor = std::addressof(visit);  // of a function too
    return detail::visit_radius(
        index, query, radius,
        [](void* data, std::uint32_t point, typename Index::Scalar distance) -> bool {
            return (**static_cast<decltype(visitor)*>(data))(point, distance);
        },
        &visitor);
}

}  // namespace raydix
