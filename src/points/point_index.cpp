// PointIndex and build_points: bounds -> leaves along a curve -> groups parted by medians -> nodes.
#include <raydix/error.h>
#include <raydix/points.h>

#include <algorithm>
#include <limits>
#include <string>
#include <utility>

#include "base/check.h"
#include "base/options.h"
#include "exec/memory.h"
#include "exec/parallel.h"
#include "measure/stopwatch.h"
#include "points/build_tree.h"
#include "points/point_arrays.h"

namespace raydix {
namespace {

constexpr std::string_view tree_names[] = {"automatic", "kdtree", "bvh"};

template <class T, int Dim>
void set_bounds(const PointBounds<T, Dim>& bounds, typename PointIndex<T, Dim>::Box& box) {
    box.lo.x = bounds.lo[0];
    box.lo.y = bounds.lo[1];
    box.hi.x = bounds.hi[0];
    box.hi.y = bounds.hi[1];
    if constexpr (Dim == 3) {
        box.lo.z = bounds.lo[2];
        box.hi.z = bounds.hi[2];
    }
}

template <class T, int Dim>
void build(const T* points, std::size_t n, detail::PointArrays<T, Dim>& arrays) {
    Stopwatch total, stage;
    const PointBounds<T, Dim> bounds = bounds_of_points<T, Dim>(points, n);
    if (arrays.options.strict && bounds.left_out != 0)
        throw InputError("point " + std::to_string(bounds.first_left_out) +
                         ": not finite or out of range" + others_too(bounds.left_out));
    arrays.left_out = bounds.left_out;
    set_bounds(bounds, arrays.bounds);
    arrays.ms.bounds = stage.lap();
    arrays.chosen = arrays.options.tree == PointsTree::bvh ? PointsTree::bvh : PointsTree::kdtree;
    if (bounds.left_out == n) return;
    const auto valid = static_cast<std::uint32_t>(n - bounds.left_out);
    const bool kdtree = arrays.chosen == PointsTree::kdtree;
    sort_along_curve(points, n, bounds, arrays);
    arrays.ms.sort = stage.lap();
    const std::vector<BottomRange> bottoms = divide_into_nodes(points, valid, kdtree, arrays);
    arrays.ms.nodes = stage.lap();
    fill_leaves(points, bottoms, kdtree, arrays);
    arrays.ms.leaves = stage.lap();
    fit_point_nodes(arrays);
    arrays.tree = {arrays.leaves.data(),
                   arrays.nodes.data(),
                   valid,
                   static_cast<std::uint32_t>(arrays.leaves.size()),
                   static_cast<std::uint32_t>(arrays.nodes.size()),
                   static_cast<std::uint32_t>(arrays.level_starts.size() - 1)};
    RAYDIX_CHECK(arrays.tree.depth, <=, max_point_depth);
    arrays.ms.boxes = stage.lap();
    arrays.ms.total = total.lap();
}

template <class T, int Dim>
void forget(detail::PointArrays<T, Dim>& arrays) {
    constexpr T inf = std::numeric_limits<T>::infinity();
    PointBounds<T, Dim> none;
    std::fill_n(none.lo, Dim, inf);
    std::fill_n(none.hi, Dim, -inf);
    set_bounds(none, arrays.bounds);
    arrays.tree = {};
    arrays.forest = {};
    arrays.input_count = arrays.left_out = 0;
    arrays.ms = {};
}

template <class T, int Dim>
void rebuild_arrays(detail::PointArrays<T, Dim>& arrays, const T* points, std::size_t n,
                    const PointsOptions& options) {
    forget(arrays);
    if (n > static_cast<std::size_t>(std::numeric_limits<std::int32_t>::max()))
        throw InputError(std::to_string(n) + " points; an index holds fewer than 2^31");
    check_enum("tree", options.tree, PointsTree::bvh);
    const PointsOptions last = std::exchange(arrays.options, options);
    const bool first = arrays.leaves.empty();
    memory_count().restart_peak();
    const std::uint64_t held = arrays.leaves.capacity_bytes() + arrays.nodes.capacity_bytes() +
                               arrays.sort_scratch.records.capacity_bytes() +
                               arrays.sort_scratch.spare.capacity_bytes() +
                               arrays.sort_scratch.histogram.capacity_bytes();
    const std::uint64_t before = memory_count().now() - held;
    try {
        with_threads(options.threads, [&] { build(points, n, arrays); });
    } catch (...) {
        forget(arrays);
        arrays.options = last;
        throw;
    }
    arrays.input_count = n;
    arrays.peak_bytes = memory_count().peak() - before;
    if (first) arrays.sort_scratch = {};  // most indices are built once
}

}  // namespace

std::string_view points_tree_name(PointsTree tree) {
    const auto k = static_cast<std::uint32_t>(tree);
    return k < std::size(tree_names) ? tree_names[k] : "unknown";
}

PointsTree points_tree_from_name(std::string_view name) {
    for (std::uint32_t i = 0; i < std::size(tree_names); ++i)
        if (tree_names[i] == name) return static_cast<PointsTree>(i);
    throw InputError("points tree '" + std::string(name) +
                     "' is not one of automatic, kdtree, bvh");
}

template <class T, int Dim>
PointIndex<T, Dim>::PointIndex() : arrays_(new detail::PointArrays<T, Dim>) {
    forget(*arrays_);
}
template <class T, int Dim>
PointIndex<T, Dim>::~PointIndex() = default;
template <class T, int Dim>
PointIndex<T, Dim>::PointIndex(PointIndex&& other) noexcept = default;
template <class T, int Dim>
PointIndex<T, Dim>& PointIndex<T, Dim>::operator=(PointIndex&& other) noexcept = default;

template <class T, int Dim>
const detail::PointArrays<T, Dim>& PointIndex<T, Dim>::arrays() const {
    static const PointIndex nothing;  // what an index is after it was moved from
    return arrays_ ? *arrays_ : *nothing.arrays_;
}

template <class T, int Dim>
void PointIndex<T, Dim>::rebuild(std::span<const Point> points, const PointsOptions& options) {
    static_assert(sizeof(Point) == Dim * sizeof(T));
    if (!arrays_) arrays_ = std::make_unique<detail::PointArrays<T, Dim>>();
    rebuild_arrays(*arrays_, reinterpret_cast<const T*>(points.data()), points.size(), options);
}

template <class T, int Dim>
void PointIndex<T, Dim>::rebuild(std::span<const Point> points) {
    rebuild(points, PointsOptions(arrays().options));
}

template <class T, int Dim>
std::uint32_t PointIndex<T, Dim>::size() const {
    return arrays().tree.points;
}
template <class T, int Dim>
std::uint64_t PointIndex<T, Dim>::input_count() const {
    return arrays().input_count;
}
template <class T, int Dim>
std::uint64_t PointIndex<T, Dim>::left_out() const {
    return arrays().left_out;
}
template <class T, int Dim>
typename PointIndex<T, Dim>::Box PointIndex<T, Dim>::bounds() const {
    return arrays().bounds;
}
template <class T, int Dim>
const PointsOptions& PointIndex<T, Dim>::options() const {
    return arrays().options;
}
template <class T, int Dim>
PointsTree PointIndex<T, Dim>::tree() const {
    return arrays().chosen;
}
template <class T, int Dim>
std::uint32_t PointIndex<T, Dim>::leaf_count() const {
    return arrays().tree.leaf_count;
}
template <class T, int Dim>
std::uint32_t PointIndex<T, Dim>::node_count() const {
    return arrays().tree.node_count;
}
template <class T, int Dim>
std::uint32_t PointIndex<T, Dim>::depth() const {
    return arrays().tree.depth;
}
template <class T, int Dim>
std::uint64_t PointIndex<T, Dim>::bytes() const {
    return leaf_count() * sizeof(PointLeaf<T, Dim>) + node_count() * sizeof(PointNode<T, Dim>);
}
template <class T, int Dim>
std::uint64_t PointIndex<T, Dim>::peak_bytes() const {
    return arrays().peak_bytes;
}
template <class T, int Dim>
const PointsBuildMs& PointIndex<T, Dim>::build_ms() const {
    return arrays().ms;
}
template <class T, int Dim>
std::vector<std::uint32_t> PointIndex<T, Dim>::order() const {
    std::vector<std::uint32_t> ids;
    ids.reserve(size());
    for (std::uint32_t leaf = 0; leaf < leaf_count(); ++leaf)
        for (const std::uint32_t id : arrays().tree.leaves[leaf].id)
            if (id != no_primitive) ids.push_back(id);
    return ids;
}

template <class T, int Dim>
std::vector<typename PointIndex<T, Dim>::Point> PointIndex<T, Dim>::points() const {
    std::vector<Point> all;
    all.reserve(size());
    for (std::uint32_t leaf = 0; leaf < leaf_count(); ++leaf) {
        const PointLeaf<T, Dim>& group = arrays().tree.leaves[leaf];
        for (std::uint32_t i = 0; i < points_per_leaf; ++i) {
            if (group.id[i] == no_primitive) continue;
            if constexpr (Dim == 3)
                all.push_back({group.at[0][i], group.at[1][i], group.at[2][i]});
            else
                all.push_back({group.at[0][i], group.at[1][i]});
        }
    }
    return all;
}

template class PointIndex<float, 2>;
template class PointIndex<float, 3>;
template class PointIndex<double, 2>;
template class PointIndex<double, 3>;

namespace {

template <class Index>
Index built(std::span<const typename Index::Point> points, const PointsOptions& options) {
    Index index;
    index.rebuild(points, options);
    return index;
}

}  // namespace

Points build_points(std::span<const Vec3> points, const PointsOptions& options) {
    return built<Points>(points, options);
}
Points2 build_points(std::span<const Vec2> points, const PointsOptions& options) {
    return built<Points2>(points, options);
}
PointsD build_points(std::span<const Vec3d> points, const PointsOptions& options) {
    return built<PointsD>(points, options);
}
Points2D build_points(std::span<const Vec2d> points, const PointsOptions& options) {
    return built<Points2D>(points, options);
}

}  // namespace raydix
