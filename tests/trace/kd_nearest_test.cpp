// kd_nearest against a look at every point: order, ties, missing ones, and how little it visits.
#include <gtest/gtest.h>
#include <raydix/error.h>
#include <raydix/kdtree.h>
#include <raydix/model.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <iostream>

#include "support/kd_reference.h"
#include "support/point_sets.h"
#include "support/support.h"

namespace raydix::test {
namespace {

constexpr std::uint64_t kd_nearest_seed = 31;

std::size_t differences(std::span<const KdNeighbor> a, std::span<const KdNeighbor> b) {
    std::size_t count = a.size() == b.size() ? 0 : 1;
    for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i)
        count += std::bit_cast<std::uint32_t>(a[i].d2) != std::bit_cast<std::uint32_t>(b[i].d2) ||
                 a[i].point != b[i].point;
    return count;
}

TEST(KdNearest, LikeEveryPoint) {
    std::size_t rows = 0;
    for (const PointSet& set : point_sets(50 * thorough, kd_nearest_seed)) {
        const auto queries = queries_for(set.points, 40 + 8 * thorough, kd_nearest_seed + 1);
        for (const std::uint32_t k : {1u, 2u, 8u, 33u, 2000u}) {
            const auto wanted = nearest_of_all(set.points, queries, k);
            for (const int bits : {30, 63})
                for (const int max_leaf : {1, 8, 64}) {
                    const KdTree tree =
                        build_kdtree(set.points, {.bits = bits, .max_leaf = max_leaf});
                    EXPECT_EQ(differences(kd_nearest(tree, queries, k), wanted), 0u)
                        << set.name << ", " << set.points.size() << " points, k " << k << ", bits "
                        << bits << ", max_leaf " << max_leaf << ", seed " << kd_nearest_seed;
                    rows += queries.size();
                }
        }
    }
    std::cout << rows << " rows compared, seed " << kd_nearest_seed << "\n";
}

TEST(KdNearest, ThreadsAndCountersChangeNothing) {
    const auto sets = point_sets(500 * thorough, kd_nearest_seed);
    for (const PointSet& set : sets) {
        const KdTree tree = build_kdtree(set.points);
        const auto queries = queries_for(set.points, 100 * thorough, kd_nearest_seed);
        const auto wanted = kd_nearest(tree, queries, 8, {.threads = 1});
        const auto invalid = static_cast<std::uint64_t>(
            std::ranges::count_if(queries, [](Vec3 q) { return !std::isfinite(q.x + q.y + q.z); }));
        EXPECT_GE(invalid, 2u);
        KdQueryCounts first;
        for (const int threads : {1, 2, 7}) {
            std::vector<KdNeighbor> found(queries.size() * 8);
            const KdQueryCounts counts =
                kd_nearest(tree, queries, 8, found, {.threads = threads, .counters = true});
            EXPECT_EQ(differences(found, wanted), 0u) << set.name;
            EXPECT_EQ(counts.queries, queries.size());
            EXPECT_EQ(counts.invalid_queries, invalid);
            if (threads == 1) first = counts;
            EXPECT_EQ(counts.node_visits, first.node_visits);
            EXPECT_EQ(counts.distances, first.distances);
        }
    }
}

TEST(KdNearest, InvalidQueriesAndEmptyTreesHaveNoNeighbours) {
    const float nan = std::numeric_limits<float>::quiet_NaN();
    const std::vector<Vec3> queries{{0, nan, 0}, {0, 0, -infinity}, {0, 0, 0}};
    const auto few = kd_nearest(build_kdtree(std::vector<Vec3>{{1, 2, 2}}), queries, 2);
    for (const std::size_t i : {0u, 1u, 2u, 3u, 5u}) {
        EXPECT_EQ(few[i].d2, infinity);
        EXPECT_EQ(few[i].point, no_primitive);
    }
    EXPECT_EQ(few[4].d2, 9.0f);
    EXPECT_EQ(few[4].point, 0u);
    for (const KdNeighbor& n : kd_nearest(build_kdtree(Mesh{}), queries, 3))
        EXPECT_EQ(n.point, no_primitive);
    EXPECT_TRUE(kd_nearest(build_kdtree(Mesh{}), {}, 3).empty());
}

TEST(KdNearest, OverflowingDistancesStillNameThePoints) {
    const std::vector<Vec3> points{{5, 0, 0}, {1e12f, 0, 0}, {0, 0, 0}};
    const auto found =
        kd_nearest(build_kdtree(points, {.max_leaf = 1}), std::vector<Vec3>{{1e38f, 0, 0}}, 2);
    EXPECT_EQ(found[0].d2, infinity);
    EXPECT_EQ(found[0].point, 0u);
    EXPECT_EQ(found[1].point, 1u);
}

TEST(KdNearest, MeetsFewOfAMillionEqualPoints) {
    const std::size_t n = 50'000 * thorough;
    std::vector<Vec3> points(n, Vec3{0.3f, 0.4f, 0.5f});
    points.push_back({0, 0, 0});
    points.push_back({1, 1, 1});
    const KdTree tree = build_kdtree(points);
    const std::vector<Vec3> queries{{0.3f, 0.4f, 0.5f}, {0.9f, 0.1f, 0.7f}, {0.2f, 0.4f, 0.5f}};
    std::vector<KdNeighbor> found(3 * 8);
    const KdQueryCounts counts = kd_nearest(tree, queries, 8, found, {.counters = true});
    EXPECT_EQ(differences(found, nearest_of_all(points, queries, 8)), 0u);
    EXPECT_LT(counts.distances, 3 * 200u);
    EXPECT_LT(counts.node_visits, 3 * 200u);
}

TEST(KdNearest, VisitsGrowLikeTheDepth) {
    const auto sets = point_sets(5000 * thorough, kd_nearest_seed);
    const auto uniform =
        std::ranges::find(sets, std::string("uniform"), [](const PointSet& s) { return s.name; });
    const KdTree tree = build_kdtree(uniform->points);
    std::vector<KdNeighbor> found(uniform->points.size() * 8);
    const KdQueryCounts counts = kd_nearest(tree, uniform->points, 8, found, {.counters = true});
    EXPECT_LT(counts.distances, 150 * counts.queries);
    EXPECT_LT(counts.node_visits, 100 * counts.queries);
    EXPECT_GT(counts.node_visits, counts.queries);
}

TEST(KdNearest, RefusesWhatItCannotAnswer) {
    const KdTree points = build_kdtree(std::vector<Vec3>{{0, 0, 0}});
    const KdTree triangles = build_kdtree(random_soup(5, 1));
    const std::vector<Vec3> queries{{0, 0, 0}, {1, 1, 1}};
    std::vector<KdNeighbor> room(5);
    EXPECT_THROW((void)kd_nearest(points, queries, 0), InputError);
    EXPECT_THROW((void)kd_nearest(triangles, queries, 1), InputError);
    EXPECT_THROW((void)kd_nearest(points, queries, 2, room), InputError);
    EXPECT_THROW((void)kd_nearest(points, queries, 3, room), InputError);
}

}  // namespace
}  // namespace raydix::test
