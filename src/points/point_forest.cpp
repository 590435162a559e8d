// Insertion and removal of points (point_forest.h).
#include "points/point_forest.h"

#include <raydix/error.h>

#include <algorithm>
#include <limits>
#include <string>
#include <utility>

#include "base/check.h"
#include "base/options.h"
#include "exec/parallel.h"
#include "points/build_tree.h"
#include "sort/radix_sort.h"

namespace raydix {
namespace {

/// A tree stays if it has so many times the points of what is built behind it.
constexpr std::size_t least_ratio = 8;
/// All is built again when more than a quarter of the places are holes.
constexpr std::size_t places_of_four = 3;

/// A box around points; inverted around none.
template <class T, int Dim>
struct Extent {
    Extent() {
        std::fill_n(lo, Dim, std::numeric_limits<T>::infinity());
        std::fill_n(hi, Dim, -std::numeric_limits<T>::infinity());
    }
    void add(int d, T low, T high) {  // NaN adds nothing
        lo[d] = std::min(lo[d], low);
        hi[d] = std::max(hi[d], high);
    }
    T lo[Dim], hi[Dim];
};

template <class T, int Dim>
Extent<T, Dim> extent_of(const PointLeaf<T, Dim>& leaf) {
    Extent<T, Dim> extent;
    for (int d = 0; d < Dim; ++d)
        for (const T at : leaf.at[d]) extent.add(d, at, at);
    return extent;
}

/// Of its children that have points.
template <class T, int Dim>
Extent<T, Dim> extent_of(const PointNode<T, Dim>& node) {
    Extent<T, Dim> extent;
    for (std::uint32_t c = 0; c < node.children; ++c)
        for (int d = 0; d < Dim && node.points[c] != 0; ++d)
            extent.add(d, node.lo[d][c], node.hi[d][c]);
    return extent;
}

/// Whether the child had another box.
template <class T, int Dim>
bool set_box(const Extent<T, Dim>& box, PointNode<T, Dim>& node, std::uint32_t child) {
    bool differs = false;
    for (int d = 0; d < Dim; ++d) {
        differs |= node.lo[d][child] != box.lo[d] || node.hi[d][child] != box.hi[d];
        node.lo[d][child] = box.lo[d];
        node.hi[d][child] = box.hi[d];
    }
    return differs;
}

constexpr std::uint32_t first_root = 1, first_node = first_root + boxes_per_node;

template <class Element>
void grow(Buffer<Element>& buffer, std::size_t used, std::size_t room) {
    if (room <= buffer.size()) return;
    Buffer<Element> larger(std::max(room, used == 0 ? room : 2 * used));
    std::copy_n(buffer.data(), used, larger.data());
    buffer = std::move(larger);
}

}  // namespace

template <class T, int Dim>
void PointForest<T, Dim>::insert(std::span<const Point> points) {
    const std::size_t known = arrays_.input_count, n = points.size();
    if (known + n > static_cast<std::size_t>(std::numeric_limits<std::int32_t>::max()))
        throw InputError(std::to_string(known + n) +
                         " points, those before and those removed included; an index holds fewer "
                         "than 2^31");
    if (n == 0) return;
    if (arrays_.options.strict) {
        const auto bounds = bounds_of_points<T, Dim>(reinterpret_cast<const T*>(points.data()), n);
        if (bounds.left_out != 0)
            throw InputError("point " + std::to_string(bounds.first_left_out) +
                             ": not finite or out of range" + others_too(bounds.left_out));
    }
    begin();
    const std::size_t level = levels_that_stay(n);
    Gathered all = gather(level);
    all.points.insert(all.points.end(), points.begin(), points.end());
    for (std::size_t i = 0; i < n; ++i) all.ids.push_back(static_cast<std::uint32_t>(known + i));
    PointsOptions options = arrays_.options;
    options.strict = false;
    Index part;
    part.rebuild(all.points, options);
    state_.leaf_of.resize(known + n, no_primitive);
    replace_from(level, part, all.ids.data());
    arrays_.input_count += n;
    arrays_.left_out += part.left_out();
    refresh();
}

template <class T, int Dim>
std::uint32_t PointForest<T, Dim>::remove(std::span<const std::uint32_t> ids) {
    for (const std::uint32_t id : ids)
        if (id >= arrays_.input_count)
            throw InputError("there is no point " + std::to_string(id) + "; " +
                             std::to_string(arrays_.input_count) + " were given");
    begin();
    std::uint32_t removed = 0;
    for (const std::uint32_t id : ids) {
        if (state_.leaf_of[id] == no_primitive) continue;
        take_out(id);
        ++removed;
    }
    refresh();
    std::size_t places = 0;
    for (const PointLevel& level : state_.levels) places += level.built;
    if (4 * std::size_t{arrays_.tree.points} < places_of_four * places) {
        try {
            rebuild_all();
        } catch (...) {  // the points have gone and answers are right: the next removal tries again
        }
    }
    return removed;
}

/// The tree as it was built becomes the first below a top node.
template <class T, int Dim>
void PointForest<T, Dim>::begin() {
    if (state_.begun) return;
    state_.leaf_of.assign(arrays_.input_count, no_primitive);
    if (arrays_.tree.empty()) {
        make_room(0, 0);
    } else {
        state_.levels.reserve(1);  // nothing throws once there is room
        Arrays part;
        part.leaves = std::move(arrays_.leaves);
        part.nodes = std::move(arrays_.nodes);
        part.tree = arrays_.tree;
        part.bounds = arrays_.bounds;
        try {
            make_room(part.tree.leaf_count, part.tree.node_count);
        } catch (...) {  // no memory: as it was
            arrays_.leaves = std::move(part.leaves);
            arrays_.nodes = std::move(part.nodes);
            arrays_.tree = part.tree;
            state_ = {};
            throw;
        }
        const PointLevel level{0,
                               part.tree.leaf_count,
                               first_node,
                               part.tree.node_count - 1,
                               part.tree.points,
                               part.tree.depth};
        place_leaves(part, 0, nullptr);
        place_nodes(part, level, first_root, nullptr);
        state_.levels.push_back(level);
        set_top(0, part,
                *std::min_element(part.nodes[0].lowest_id,
                                  part.nodes[0].lowest_id + part.nodes[0].children));
    }
    state_.begun = true;
    refresh();
}

template <class T, int Dim>
void PointForest<T, Dim>::rebuild_all() {
    const Gathered all = gather(0);
    PointsOptions options = arrays_.options;
    options.strict = false;
    Index part;
    part.rebuild(all.points, options);
    replace_from(0, part, all.ids.data());
    refresh();
}

/// How many trees, the oldest, are so large that `more` points may stand behind them.
template <class T, int Dim>
std::size_t PointForest<T, Dim>::levels_that_stay(std::size_t more) const {
    const Node& top = arrays_.nodes[0];
    std::size_t stay = state_.levels.size();
    while (stay > 0 && (top.points[stay - 1] < least_ratio * more || stay == boxes_per_node))
        more += top.points[--stay];
    return stay;
}

/// The points of trees [first_level, ...), ascending by number.
template <class T, int Dim>
typename PointForest<T, Dim>::Gathered PointForest<T, Dim>::gather(std::size_t first_level) const {
    Gathered all;
    if (first_level == state_.levels.size()) return all;
    const std::uint32_t begin = state_.levels[first_level].first_leaf;
    const std::uint32_t end = arrays_.tree.leaf_count;
    std::vector<Point> points;
    for (std::uint32_t leaf = begin; leaf < end; ++leaf) {
        const Leaf& group = arrays_.leaves[leaf];
        for (std::uint32_t i = 0; i < points_per_leaf && group.id[i] != no_primitive; ++i) {
            Point& point = points.emplace_back();
            for (int d = 0; d < Dim; ++d) (&point.x)[d] = group.at[d][i];
            all.ids.push_back(group.id[i]);
        }
    }
    std::vector<std::uint32_t> order(points.size());
    SortScratch<std::uint32_t> scratch;
    sort_keys<std::uint32_t>(all.ids, order, 31, scratch);
    all.points.resize(points.size());
    for (std::size_t i = 0; i < points.size(); ++i) all.points[i] = points[order[i]];
    return all;
}

/// Trees [level, ...) go, and `part` comes in their place; ids [its input] are the numbers of its
/// points.
template <class T, int Dim>
void PointForest<T, Dim>::replace_from(std::size_t level, const Index& part,
                                       const std::uint32_t* ids) {
    const Arrays& arrays = part.arrays();
    const bool empty = arrays.tree.empty();
    PointLevel at{0,
                  arrays.tree.leaf_count,
                  first_node,
                  empty ? 0 : arrays.tree.node_count - 1,
                  arrays.tree.points,
                  arrays.tree.depth};
    if (level > 0) {
        const PointLevel& before = state_.levels[level - 1];
        at.first_leaf = before.first_leaf + before.leaves;
        at.first_node = before.first_node + before.nodes;
    }
    RAYDIX_CHECK(at.depth + 1, <=, max_point_depth);
    make_room(at.first_leaf + at.leaves, at.first_node + at.nodes);
    state_.levels.reserve(level + 1);
    // From here on nothing throws.
    state_.levels.resize(level);
    Node& top = arrays_.nodes[0];
    top.children = static_cast<std::uint32_t>(level);
    for (std::size_t c = level; c < boxes_per_node; ++c) top.points[c] = 0;
    if (empty) return;
    place_leaves(arrays, at.first_leaf, ids);
    place_nodes(arrays, at, first_root + static_cast<std::uint32_t>(level), ids);
    state_.levels.push_back(at);
    const Node& root = arrays.nodes[0];
    set_top(level, arrays, ids[*std::min_element(root.lowest_id, root.lowest_id + root.children)]);
}

template <class T, int Dim>
void PointForest<T, Dim>::make_room(std::size_t leaves, std::size_t nodes) {
    const bool first = !state_.begun && state_.levels.empty();
    nodes = std::max<std::size_t>(nodes, first_node) + (first ? first_node : 0);
    std::size_t used_leaves = 0, used_nodes = first ? 0 : first_node;
    if (!state_.levels.empty()) {
        const PointLevel& last = state_.levels.back();
        used_leaves = last.first_leaf + last.leaves;
        used_nodes = last.first_node + last.nodes;
    }
    // The view follows at once: if there is no memory for what comes next, queries go on.
    grow(arrays_.leaves, used_leaves, leaves);
    arrays_.tree.leaves = arrays_.leaves.data();
    grow(arrays_.nodes, used_nodes, nodes);
    arrays_.tree.nodes = arrays_.nodes.data();
    if (leaves > state_.parent_of_leaf.size()) state_.parent_of_leaf.resize(arrays_.leaves.size());
    if (nodes > state_.parent_of_node.size()) state_.parent_of_node.resize(arrays_.nodes.size());
    if (first) {
        Node& top = arrays_.nodes[0];
        top = {};
        top.below = first_root;
        std::fill_n(top.lowest_id, boxes_per_node, no_primitive);
    }
}

template <class T, int Dim>
void PointForest<T, Dim>::place_leaves(const Arrays& part, std::uint32_t first,
                                       const std::uint32_t* ids) {
    for_each_index_to_the_end(part.tree.leaf_count, [&](std::size_t i) {
        Leaf& leaf = arrays_.leaves[first + i];
        leaf = part.leaves[i];
        for (std::uint32_t& id : leaf.id) {
            if (id == no_primitive) break;
            if (ids != nullptr) id = ids[id];
            state_.leaf_of[id] = static_cast<std::uint32_t>(first + i);
        }
    });
}

template <class T, int Dim>
void PointForest<T, Dim>::place_nodes(const Arrays& part, const PointLevel& level,
                                      std::uint32_t root, const std::uint32_t* ids) {
    const auto place = [&](std::size_t i) {
        return i == 0 ? root : level.first_node + static_cast<std::uint32_t>(i) - 1;
    };
    state_.parent_of_node[root] = 0;
    for_each_index_to_the_end(part.tree.node_count, [&](std::size_t i) {
        const std::uint32_t at = place(i);
        Node& node = arrays_.nodes[at];
        node = part.nodes[i];
        node.below = node.is_bottom != 0 ? level.first_leaf + node.below : place(node.below);
        for (std::uint32_t c = 0; c < node.children; ++c) {
            if (ids != nullptr) node.lowest_id[c] = ids[node.lowest_id[c]];
            (node.is_bottom != 0 ? state_.parent_of_leaf : state_.parent_of_node)[node.below + c] =
                at;
        }
    });
}

template <class T, int Dim>
void PointForest<T, Dim>::set_top(std::size_t child, const Arrays& part, std::uint32_t lowest_id) {
    Node& top = arrays_.nodes[0];
    for (int d = 0; d < Dim; ++d) {
        top.lo[d][child] = (&part.bounds.lo.x)[d];
        top.hi[d][child] = (&part.bounds.hi.x)[d];
    }
    top.lowest_id[child] = lowest_id;
    top.points[child] = part.tree.points;
    top.children = static_cast<std::uint32_t>(child + 1);
}

/// The last point of the group takes the place of the one that goes. Boxes up to the root become
/// those of what is left. Lowest numbers stay: they may be too low, never too high.
template <class T, int Dim>
void PointForest<T, Dim>::take_out(std::uint32_t id) {
    const std::uint32_t at = std::exchange(state_.leaf_of[id], no_primitive);
    Leaf& leaf = arrays_.leaves[at];
    const auto slot = std::find(leaf.id, leaf.id + points_per_leaf, id) - leaf.id;
    const auto last = std::find(leaf.id, leaf.id + points_per_leaf, no_primitive) - leaf.id - 1;
    for (int d = 0; d < Dim; ++d) {
        leaf.at[d][slot] = leaf.at[d][last];
        leaf.at[d][last] = std::numeric_limits<T>::quiet_NaN();
    }
    leaf.id[slot] = leaf.id[last];
    leaf.id[last] = no_primitive;
    auto left = extent_of(leaf);
    bool fits = false;  // the box of `child`, and so all above
    std::uint32_t child = at;
    for (std::uint32_t node = state_.parent_of_leaf[at];;) {
        Node& above = arrays_.nodes[node];
        const std::uint32_t c = child - above.below;
        --above.points[c];
        if (above.points[c] != 0 && !fits) fits = !set_box(left, above, c);
        if (node == 0) break;
        if (!fits) left = extent_of(above);
        child = node;
        node = state_.parent_of_node[node];
    }
}

/// The view that queries read, and the box around all.
template <class T, int Dim>
void PointForest<T, Dim>::refresh() {
    const Node& top = arrays_.nodes[0];
    PointTreeView<T, Dim>& tree = arrays_.tree;
    tree = {};
    tree.leaves = arrays_.leaves.data();
    tree.nodes = arrays_.nodes.data();
    tree.node_count = first_node;
    for (std::size_t c = 0; c < state_.levels.size(); ++c) {
        const PointLevel& level = state_.levels[c];
        tree.points += top.points[c];
        tree.leaf_count = level.first_leaf + level.leaves;
        tree.node_count = level.first_node + level.nodes;
        tree.depth = std::max(tree.depth, level.depth + 1);
    }
    const auto all = extent_of(top);
    for (int d = 0; d < Dim; ++d) {
        (&arrays_.bounds.lo.x)[d] = all.lo[d];
        (&arrays_.bounds.hi.x)[d] = all.hi[d];
    }
}

template <class T, int Dim>
std::uint32_t PointIndex<T, Dim>::insert(std::span<const Point> points) {
    if (!arrays_) *this = PointIndex();
    const auto first = static_cast<std::uint32_t>(arrays_->input_count);
    with_threads(arrays_->options.threads, [&] { PointForest<T, Dim>(*arrays_).insert(points); });
    return first;
}

template <class T, int Dim>
std::uint32_t PointIndex<T, Dim>::remove(std::span<const std::uint32_t> ids) {
    if (!arrays_) *this = PointIndex();
    std::uint32_t removed = 0;
    with_threads(arrays_->options.threads,
                 [&] { removed = PointForest<T, Dim>(*arrays_).remove(ids); });
    return removed;
}

#define RAYDIX_POINT_FOREST(T, Dim)                                \
    template std::uint32_t PointIndex<T, Dim>::insert(             \
        std::span<const typename detail::PointOf<T, Dim>::Point>); \
    template std::uint32_t PointIndex<T, Dim>::remove(std::span<const std::uint32_t>);
RAYDIX_POINT_FOREST(float, 3)
RAYDIX_POINT_FOREST(float, 2)
RAYDIX_POINT_FOREST(double, 3)
RAYDIX_POINT_FOREST(double, 2)
#undef RAYDIX_POINT_FOREST

}  // namespace raydix
