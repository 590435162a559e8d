// What an index of points promises about its tree, its memory and bad points.
#include <gtest/gtest.h>
#include <raydix/error.h>
#include <raydix/points.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "points/point_arrays.h"
#include "support/message.h"
#include "support/point_reference.h"
#include "support/support.h"

namespace raydix::test {
namespace {

constexpr std::uint64_t build_tree_seed = 71;

template <class Index>
class PointTree : public ::testing::Test {};
using Indices = ::testing::Types<Points, Points2, PointsD, Points2D>;
TYPED_TEST_SUITE(PointTree, Indices);

/// Walks from the root: boxes tight, lowest ids, numbers of points, depth, each group reached once.
template <class Index>
class Walk {
public:
    using T = typename Index::Scalar;
    static constexpr int dim = Index::dimension;
    struct Below {
        T lo[dim], hi[dim];
        std::uint32_t lowest = no_primitive, points = 0;
    };

    Walk(const Index& index, const std::vector<typename Index::Point>& points)
        : tree_(index.arrays().tree), points_(points), seen_(points.size()) {
        leaves_.resize(tree_.leaf_count);
        nodes_.resize(tree_.node_count);
    }
    void run() {
        if (tree_.empty()) return;
        EXPECT_EQ(node(0, 1).points, tree_.points);
        EXPECT_EQ(depth_, tree_.depth);
        EXPECT_EQ(std::ranges::count(leaves_, 1), tree_.leaf_count);
        EXPECT_EQ(std::ranges::count(nodes_, 1), tree_.node_count);
        for (std::size_t i = 0; i < points_.size(); ++i)
            EXPECT_EQ(seen_[i], EveryPoint<Index>::is_valid(points_[i]) ? 1 : 0);
    }

private:
    static Below nothing() {
        Below below;
        std::fill_n(below.lo, dim, std::numeric_limits<T>::infinity());
        std::fill_n(below.hi, dim, -std::numeric_limits<T>::infinity());
        return below;
    }
    Below leaf(std::uint32_t at, bool last) {
        ++leaves_[at];
        Below below = nothing();
        const PointLeaf<T, dim>& group = tree_.leaves[at];
        for (std::uint32_t i = 0; i < points_per_leaf; ++i) {
            const std::uint32_t id = group.id[i];
            if (id == no_primitive) {
                EXPECT_TRUE(last);
                for (int d = 0; d < dim; ++d) EXPECT_TRUE(std::isnan(group.at[d][i]));
                continue;
            }
            ++seen_[id];
            EXPECT_EQ(below.points, i);  // none behind a gap
            ++below.points;
            below.lowest = std::min(below.lowest, id);
            for (int d = 0; d < dim; ++d) {
                const T x = group.at[d][i];
                EXPECT_EQ(x, EveryPoint<Index>::coordinate(points_[id], d));
                EXPECT_FALSE(x == 0 && std::signbit(x));
                below.lo[d] = std::min(below.lo[d], x);
                below.hi[d] = std::max(below.hi[d], x);
            }
        }
        return below;
    }
    Below node(std::uint32_t at, std::uint32_t depth) {
        ++nodes_[at];
        depth_ = std::max(depth_, depth);
        const PointNode<T, dim>& of_node = tree_.nodes[at];
        EXPECT_GE(of_node.children, 1u);
        EXPECT_LE(of_node.children, boxes_per_node);
        Below all = nothing();
        for (std::uint32_t c = 0; c < of_node.children; ++c) {
            const Below below = of_node.is_bottom != 0
                                    ? leaf(of_node.below + c, c + 1 == of_node.children)
                                    : node(of_node.below + c, depth + 1);
            EXPECT_EQ(of_node.points[c], below.points);
            EXPECT_EQ(of_node.lowest_id[c], below.lowest);
            all.points += below.points;
            all.lowest = std::min(all.lowest, below.lowest);
            for (int d = 0; d < dim; ++d) {
                EXPECT_EQ(of_node.lo[d][c], below.lo[d]);
                EXPECT_EQ(of_node.hi[d][c], below.hi[d]);
                all.lo[d] = std::min(all.lo[d], below.lo[d]);
                all.hi[d] = std::max(all.hi[d], below.hi[d]);
            }
        }
        return all;
    }

    const PointTreeView<T, dim>& tree_;
    const std::vector<typename Index::Point>& points_;
    std::vector<int> seen_, leaves_, nodes_;
    std::uint32_t depth_ = 0;
};

TYPED_TEST(PointTree, HoldsEachPointOnce) {
    for (const PointSet& set : point_sets(300 * thorough, build_tree_seed)) {
        auto points = points_as<TypeParam>(set.points);
        if (points.size() > 5) points[5].x = -typename TypeParam::Scalar{0};
        for (const PointsTree tree : {PointsTree::automatic, PointsTree::kdtree, PointsTree::bvh}) {
            SCOPED_TRACE(set.name + ", " + std::string(points_tree_name(tree)));
            const TypeParam index = build_points(points, {.tree = tree, .threads = 2});
            Walk<TypeParam>(index, points).run();
            const auto valid = static_cast<std::uint64_t>(
                std::ranges::count_if(points, EveryPoint<TypeParam>::is_valid));
            EXPECT_EQ(index.size(), valid);
            EXPECT_EQ(index.left_out(), points.size() - valid);
            EXPECT_EQ(index.input_count(), points.size());
            EXPECT_EQ(index.empty(), valid == 0);
            EXPECT_EQ(index.order().size(), valid);
            EXPECT_NE(index.tree(), PointsTree::automatic);
            EXPECT_LE(index.leaf_count(), valid / 16 + valid / 120 + 1);  // almost all are full
        }
    }
}

TYPED_TEST(PointTree, DepthIsBoundedWhereCodesCollapse) {
    // All but one point lie in one cell of the grid, so medians must part them.
    using T = typename TypeParam::Scalar;
    std::vector<typename TypeParam::Point> points(2000 * thorough);
    for (std::size_t i = 0; i < points.size(); ++i)
        points[i].x = static_cast<T>(1 + static_cast<double>(i * 7919 % points.size()) * 1e-6);
    points[0].x = static_cast<T>(1e12f);
    const TypeParam index = build_points(points);
    EXPECT_LE(index.depth(), 20u);
    Walk<TypeParam>(index, points).run();
}

TYPED_TEST(PointTree, MemoryIsCounted) {
    const auto points =
        points_as<TypeParam>(point_sets(1000 * thorough, build_tree_seed)[5].points);
    ASSERT_EQ(points.size(), 1000 * thorough);
    const TypeParam index = build_points(points);
    const auto& arrays = index.arrays();
    EXPECT_EQ(index.bytes(), arrays.leaves.size() * sizeof(arrays.leaves[0]) +
                                 arrays.nodes.size() * sizeof(arrays.nodes[0]));
    EXPECT_GE(index.peak_bytes(), index.bytes() + points.size() * sizeof(SortRecord<PointCode>));
    EXPECT_LT(index.bytes(), points.size() * sizeof(points[0]) * 3);
}

TYPED_TEST(PointTree, RebuildsInPlace) {
    TypeParam index;
    const auto sets = point_sets(500 * thorough, build_tree_seed);
    const auto uniform = points_as<TypeParam>(sets[5].points);
    index.rebuild(uniform);
    index.rebuild(uniform);
    const void* leaves = index.arrays().leaves.data();
    const void* records = index.arrays().sort_scratch.records.data();
    EXPECT_NE(records, nullptr);
    index.rebuild(uniform);
    EXPECT_EQ(index.arrays().leaves.data(), leaves);
    EXPECT_EQ(index.arrays().sort_scratch.records.data(), records);
    for (const PointSet& set : sets) {
        const auto points = points_as<TypeParam>(set.points);
        index.rebuild(points, {.threads = 2});
        EXPECT_EQ(index.order(), build_points(points).order()) << set.name;
        Walk<TypeParam>(index, points).run();
    }
    index.rebuild(uniform);
    EXPECT_EQ(index.order(), build_points(uniform).order());
    auto bad = uniform;
    bad[3].y = std::numeric_limits<typename TypeParam::Scalar>::quiet_NaN();
    EXPECT_THROW(index.rebuild(bad, {.strict = true}), InputError);
    EXPECT_TRUE(index.empty());
    index.rebuild(uniform, {});
    EXPECT_EQ(index.size(), uniform.size());
}

TYPED_TEST(PointTree, StrictNamesTheFirstInvalidPoint) {
    using T = typename TypeParam::Scalar;
    auto points = points_as<TypeParam>(point_sets(100'000, build_tree_seed)[5].points);
    const T inf = std::numeric_limits<T>::infinity();
    points[77'777].x = inf;
    points[90'000].y = static_cast<T>(-1.1e12f);
    EXPECT_EQ(build_points(points).left_out(), 2u);
    const auto refusal = [&] {
        return message_of([&] { (void)build_points(points, {.strict = true}); });
    };
    EXPECT_EQ(refusal(), "point 77777: not finite or out of range, as is 1 other");
    points[88'888].x = -inf;
    EXPECT_EQ(refusal(), "point 77777: not finite or out of range, as are 2 others");
    points[77'777].x = points[88'888].x = 0;
    EXPECT_EQ(refusal(), "point 90000: not finite or out of range");
    points[77'777].x = static_cast<T>(1e12f);
    points[90'000].y = -static_cast<T>(1e12f);
    EXPECT_EQ(build_points(points, {.strict = true}).left_out(), 0u);
}

TEST(PointsOptions, SayTheTreeOfNoPointsAndLastUntilTheNextBuild) {
    const std::vector<Vec3> points{{0, 0, 0}, {1, 0, 0}, {NAN, 0, 0}};
    Points index;
    index.rebuild({}, {.tree = PointsTree::bvh});
    EXPECT_EQ(index.tree(), PointsTree::bvh);
    index.insert(points);
    EXPECT_EQ(index.tree(), PointsTree::bvh);
    EXPECT_THROW(index.rebuild(points, {.strict = true}), InputError);
    EXPECT_THROW(index.rebuild(points, {.threads = -1}), InputError);
    EXPECT_TRUE(index.empty());
    EXPECT_EQ(index.options().tree, PointsTree::bvh) << "that of the last build";
    EXPECT_EQ(index.insert(points), 0u);
    EXPECT_EQ(index.size(), 2u);
    index.rebuild(points);
    EXPECT_EQ(index.tree(), PointsTree::bvh);
}

TEST(PointsTreeNames, ThereAndBack) {
    for (const PointsTree tree : {PointsTree::automatic, PointsTree::kdtree, PointsTree::bvh})
        EXPECT_EQ(points_tree_from_name(points_tree_name(tree)), tree);
    EXPECT_THROW((void)points_tree_from_name("octree"), InputError);
    EXPECT_THROW((void)build_points(std::vector<Vec3>(1), {.tree = static_cast<PointsTree>(9)}),
                 InputError);
}

}  // namespace
}  // namespace raydix::test
