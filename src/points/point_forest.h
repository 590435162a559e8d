// An index of points that changes: one tree whose top node has up to 16 trees below it, the oldest
// and largest first. Points that come are built into a tree at the end, together with the youngest
// trees while those are not much larger (the logarithmic method, Bentley and Saxe 1980). Points
// that go leave holes. Queries see one tree of the usual form.
#pragma once

#include <raydix/points.h>

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "points/point_arrays.h"

namespace raydix {

template <class T, int Dim>
class PointForest {
public:
    using Index = PointIndex<T, Dim>;
    using Point = typename Index::Point;
    using Arrays = detail::PointArrays<T, Dim>;

    explicit PointForest(Arrays& arrays) : arrays_(arrays), state_(arrays.forest) {}

    void insert(std::span<const Point> points);
    std::uint32_t remove(std::span<const std::uint32_t> ids);

private:
    using Leaf = PointLeaf<T, Dim>;
    using Node = PointNode<T, Dim>;
    /// Points and their numbers, ascending.
    struct Gathered {
        std::vector<Point> points;
        std::vector<std::uint32_t> ids;
    };

    void begin();
    void rebuild_all();
    [[nodiscard]] std::size_t levels_that_stay(std::size_t more) const;
    [[nodiscard]] Gathered gather(std::size_t first_level) const;
    void replace_from(std::size_t level, const Index& part, const std::uint32_t* ids);
    void make_room(std::size_t leaves, std::size_t nodes);
    void place_leaves(const Arrays& part, std::uint32_t first, const std::uint32_t* ids);
    void place_nodes(const Arrays& part, const PointLevel& level, std::uint32_t root,
                     const std::uint32_t* ids);
    void set_top(std::size_t child, const Arrays& part, std::uint32_t lowest_id);
    void take_out(std::uint32_t id);
    void refresh();

    Arrays& arrays_;
    PointForestState& state_;
};

}  // namespace raydix
