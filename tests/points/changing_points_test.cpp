// Points that come and go: every answer against that of a fresh index over what is there.
#include <gtest/gtest.h>
#include <raydix/error.h>
#include <raydix/points.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <iostream>
#include <limits>
#include <numeric>
#include <random>
#include <vector>

#include "base/math.h"
#include "points/point_arrays.h"
#include "support/message.h"
#include "support/point_reference.h"
#include "support/support.h"

namespace raydix::test {
namespace {

constexpr std::uint64_t changing_points_seed = 71;

template <class Index>
class Changing : public ::testing::Test {};
using Indices = ::testing::Types<Points, Points2, PointsD, Points2D>;
TYPED_TEST_SUITE(Changing, Indices);

/// What was ever given, and which of it is there.
template <class Index>
struct Kept {
    using Point = typename Index::Point;
    std::vector<Point> points;
    std::vector<bool> there;

    /// A fresh index over what is there, and the numbers of its points.
    Index fresh(std::vector<std::uint32_t>& ids) const {
        std::vector<Point> now;
        for (std::uint32_t i = 0; i < points.size(); ++i)
            if (there[i]) {
                now.push_back(points[i]);
                ids.push_back(i);
            }
        return build_points(now);
    }
};

template <class T>
void expect_same(const Buffer<T>& a, const Buffer<T>& b, const char* what) {
    ASSERT_EQ(a.size(), b.size()) << what;
    EXPECT_TRUE(a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0) << what;
}

void rename(Buffer<std::uint32_t>& indices, const std::vector<std::uint32_t>& ids) {
    for (std::uint32_t& index : indices.span())
        if (index != no_primitive) index = ids[index];
}

template <class Index>
void expect_answers_of_fresh(const Index& index, const Kept<Index>& kept,
                             const std::vector<typename Index::Point>& queries) {
    using T = typename Index::Scalar;
    std::vector<std::uint32_t> ids;
    const Index fresh = kept.fresh(ids);
    ASSERT_EQ(index.size(), fresh.size());
    ASSERT_EQ(index.input_count(), kept.points.size());
    const auto box = index.bounds(), expected_box = fresh.bounds();
    for (int d = 0; d < Index::dimension; ++d) {
        EXPECT_EQ((&box.lo.x)[d], (&expected_box.lo.x)[d]);
        EXPECT_EQ((&box.hi.x)[d], (&expected_box.hi.x)[d]);
    }
    for (const std::uint32_t k : {1u, 5u, 12u, 40u}) {
        const auto found = knn(index, queries, k);
        auto expected = knn(fresh, queries, k);
        rename(expected.indices, ids);
        expect_same(found.indices, expected.indices, "nearest");
        expect_same(found.distances, expected.distances, "distances of the nearest");
    }
    for (const T radius : {T(0), T(0.4), std::numeric_limits<T>::infinity()}) {
        const auto found = radius_search(index, queries, radius);
        auto expected = radius_search(fresh, queries, radius);
        rename(expected.indices, ids);
        expect_same(found.offsets, expected.offsets, "offsets");
        expect_same(found.indices, expected.indices, "within the radius");
        expect_same(found.distances, expected.distances, "distances within the radius");
        std::vector<std::uint32_t> counts(queries.size()), wanted(queries.size());
        radius_count(index, queries, radius, counts);
        radius_count(fresh, queries, radius, wanted);
        EXPECT_EQ(counts, wanted);
    }
    // One row for each number ever given.
    const auto rows = neighbour_lists(index, T(0.2), PairRows::full);
    auto expected = neighbour_lists(fresh, T(0.2), PairRows::full);
    rename(expected.indices, ids);
    ASSERT_EQ(rows.offsets.size(), kept.points.size() + 1);
    expect_same(rows.indices, expected.indices, "neighbours");
    std::size_t at = 0;
    for (std::uint32_t i = 0; i < kept.points.size(); ++i) {
        const bool has_row = at < ids.size() && ids[at] == i;
        const std::uint64_t length = rows.offsets[i + 1] - rows.offsets[i];
        EXPECT_EQ(length, has_row ? expected.offsets[at + 1] - expected.offsets[at] : 0) << i;
        at += has_row;
    }
}

/// Random batches in and out, of sizes from one to thousands.
template <class Index>
void come_and_go(const std::vector<typename Index::Point>& points, Index index, Kept<Index> kept,
                 std::mt19937_64& random) {
    using Point = typename Index::Point;
    std::vector<Point> queries(points.begin(),
                               points.begin() + std::min<std::size_t>(points.size(), 40));
    std::size_t next = kept.points.size();
    for (int round = 0; next < points.size(); ++round) {
        const std::size_t most = round % 5 == 0 ? 700 : round % 3 == 0 ? 60 : 3;
        const std::size_t n = std::min(1 + random() % most, points.size() - next);
        const std::span batch(points.data() + next, n);
        EXPECT_EQ(index.insert(batch), next);
        kept.points.insert(kept.points.end(), batch.begin(), batch.end());
        kept.there.resize(kept.points.size(), true);
        next += n;
        std::vector<std::uint32_t> gone;
        const std::size_t leave = random() % (round % 4 == 3 ? 400 : 4);
        for (std::size_t i = 0; i < leave; ++i)
            gone.push_back(static_cast<std::uint32_t>(random() % kept.points.size()));
        std::uint32_t there = 0;
        for (const std::uint32_t id : gone) {
            there += kept.there[id] && EveryPoint<Index>::is_valid(kept.points[id]);
            kept.there[id] = false;
        }
        EXPECT_EQ(index.remove(gone), there);
        if (round % 9 == 0 || next == points.size()) expect_answers_of_fresh(index, kept, queries);
        if (::testing::Test::HasFailure()) return;
    }
    // All of it goes, and some comes again.
    std::vector<std::uint32_t> all(kept.points.size());
    for (std::uint32_t i = 0; i < all.size(); ++i) all[i] = i;
    index.remove(all);
    EXPECT_TRUE(index.empty());
    EXPECT_EQ(knn(index, queries, 2).counts.found, 0u);
    EXPECT_EQ(index.insert(queries), all.size());
    kept.there.assign(all.size(), false);
    kept.points.insert(kept.points.end(), queries.begin(), queries.end());
    kept.there.resize(kept.points.size(), true);
    expect_answers_of_fresh(index, kept, queries);
}

TYPED_TEST(Changing, AnswersAreThoseOfAFreshIndex) {
    std::cout << "seed " << changing_points_seed << "\n";
    std::mt19937_64 random(changing_points_seed);
    for (const PointSet& set : point_sets(900, changing_points_seed)) {
        SCOPED_TRACE(set.name);
        auto points = points_as<TypeParam>(set.points);
        if (points.size() > 20) points[7].x = std::numeric_limits<float>::quiet_NaN();
        come_and_go<TypeParam>(points, TypeParam(), {}, random);  // from nothing
        const std::span built(points.data(), points.size() / 2);
        Kept<TypeParam> kept{{built.begin(), built.end()}, std::vector<bool>(built.size(), true)};
        come_and_go<TypeParam>(points, build_points(built), kept, random);
    }
}

/// Points below a node; `lo` and `hi` become their box. Every box on the way is the one of its
/// points.
std::uint32_t expect_boxes_that_fit(const PointTreeView<float, 3>& tree, std::uint32_t at, Vec3& lo,
                                    Vec3& hi) {
    lo = {infinity, infinity, infinity};
    hi = {-infinity, -infinity, -infinity};
    const PointNode<float, 3>& node = tree.nodes[at];
    std::uint32_t sum = 0;
    for (std::uint32_t c = 0; c < node.children; ++c) {
        Vec3 least{infinity, infinity, infinity}, most{-infinity, -infinity, -infinity};
        std::uint32_t points = 0;
        if (node.is_bottom == 0) {
            points = expect_boxes_that_fit(tree, node.below + c, least, most);
        } else {
            const PointLeaf<float, 3>& leaf = tree.leaves[node.below + c];
            for (; points < points_per_leaf && leaf.id[points] != no_primitive; ++points) {
                const Vec3 p{leaf.at[0][points], leaf.at[1][points], leaf.at[2][points]};
                least = min_of(least, p);
                most = max_of(most, p);
            }
        }
        EXPECT_EQ(points, node.points[c]);
        for (int d = 0; d < 3 && points != 0; ++d) {
            EXPECT_EQ(node.lo[d][c], (&least.x)[d]) << "node " << at << ", child " << c;
            EXPECT_EQ(node.hi[d][c], (&most.x)[d]) << "node " << at << ", child " << c;
        }
        lo = min_of(lo, least);
        hi = max_of(hi, most);
        sum += points;
    }
    return sum;
}

/// Whether one goes from the inside or from the border, all at once or each alone.
TEST(ChangingPoints, BoxesFitWhatIsLeft) {
    std::mt19937_64 random(changing_points_seed);
    std::uniform_real_distribution<float> place(0, 1);
    std::vector<Vec3> points(5000);
    for (Vec3& p : points) p = {place(random), place(random), place(random)};
    Points index = build_points(std::span(points).first(4000));
    index.insert(std::span(points).subspan(4000));
    std::vector<std::uint32_t> by_x(points.size());
    std::iota(by_x.begin(), by_x.end(), 0u);
    std::sort(by_x.begin(), by_x.end(),
              [&](std::uint32_t a, std::uint32_t b) { return points[a].x < points[b].x; });
    for (std::uint32_t i = 0; i < 900; ++i) {
        index.remove({&by_x[i], 1});
        EXPECT_EQ(index.bounds().lo.x, points[by_x[i + 1]].x);
    }
    index.remove(std::span(by_x).last(200));
    Vec3 lo, hi;
    EXPECT_EQ(expect_boxes_that_fit(index.arrays().tree, 0, lo, hi), 3900u);
    EXPECT_EQ(lo.x, index.bounds().lo.x);
    EXPECT_EQ(hi.x, points[by_x[4799]].x);
}

TEST(ChangingPoints, TreesStayFew) {
    std::mt19937_64 random(changing_points_seed);
    std::uniform_real_distribution<float> place(0, 1);
    Points index;
    std::uint32_t deepest = 0;
    for (int i = 0; i < 3000; ++i) {
        const Vec3 point{place(random), place(random), place(random)};
        index.insert({&point, 1});
        deepest = std::max(deepest, index.depth());
    }
    EXPECT_EQ(index.size(), 3000u);
    EXPECT_LE(deepest, 6u);
    EXPECT_LT(index.leaf_count(), 3000 / 16 * 3);
}

TEST(ChangingPoints, WhatIsWrongChangesNothing) {
    const std::vector<Vec3> points{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}};
    PointsOptions strict;
    strict.strict = true;
    Points index = build_points(points, strict);
    const std::vector<std::uint32_t> never{0, 3};
    EXPECT_EQ(message_of([&] { index.remove(never); }), "there is no point 3; 3 were given");
    const std::vector<Vec3> bad{{0, 0, 0}, {0, std::numeric_limits<float>::infinity(), 0}};
    EXPECT_EQ(message_of([&] { index.insert(bad); }), "point 1: not finite or out of range");
    EXPECT_EQ(index.size(), 3u);
    EXPECT_EQ(index.input_count(), 3u);
    const std::vector<std::uint32_t> twice{1, 1};
    EXPECT_EQ(index.remove(twice), 1u);
    EXPECT_EQ(index.remove(twice), 0u);
    EXPECT_EQ(index.insert({}), 3u);
    index.rebuild(points);
    EXPECT_EQ(index.input_count(), 3u);
    EXPECT_EQ(index.order().size(), 3u);
}

}  // namespace
}  // namespace raydix::test
