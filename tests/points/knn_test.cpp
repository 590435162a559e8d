// knn against a look at every point: order, ties, missing ones, every kind of index and instruction
// set.
#include <gtest/gtest.h>
#include <raydix/error.h>
#include <raydix/points.h>

#include <bit>
#include <cstring>
#include <iostream>
#include <numeric>
#include <random>

#include "support/point_reference.h"
#include "support/support.h"

namespace raydix::test {
namespace {

constexpr std::uint64_t knn_seed = 61;

template <class Index>
class Knn : public ::testing::Test {};
using Indices = ::testing::Types<Points, Points2, PointsD, Points2D>;
TYPED_TEST_SUITE(Knn, Indices);

/// Rows of k as the index should give them, of points with d2 <= limit * limit.
template <class Index>
NearestPoints<typename Index::Scalar> expected(const std::vector<typename Index::Point>& points,
                                               const std::vector<typename Index::Point>& queries,
                                               std::uint32_t k,
                                               typename Index::Scalar limit = infinity) {
    using T = typename Index::Scalar;
    NearestPoints<T> rows{
        Buffer<std::uint32_t>(queries.size() * k), Buffer<T>(queries.size() * k), {}};
    const EveryPoint<Index> every(points);
    for (std::size_t q = 0; q < queries.size(); ++q) {
        std::vector<Near<T>> all = every.by_distance(queries[q]);
        std::erase_if(all, [&](const Near<T>& near) { return !(near.d2 <= limit * limit); });
        for (std::size_t i = 0; i < k; ++i) {
            rows.indices[q * k + i] = i < all.size() ? all[i].id : no_primitive;
            rows.distances[q * k + i] =
                i < all.size() ? std::sqrt(all[i].d2) : std::numeric_limits<T>::infinity();
            rows.counts.found += i < all.size();
        }
    }
    return rows;
}

template <class T>
std::size_t differences(const NearestPoints<T>& a, const NearestPoints<T>& b) {
    std::size_t count = a.indices.size() != b.indices.size();
    for (std::size_t i = 0; i < std::min(a.indices.size(), b.indices.size()); ++i)
        count += a.indices[i] != b.indices[i] ||
                 std::memcmp(&a.distances[i], &b.distances[i], sizeof(T)) != 0;
    return count;
}

TYPED_TEST(Knn, LikeEveryPoint) {
    std::size_t rows = 0;
    for (const PointSet& set : point_sets(20 * thorough, knn_seed)) {
        const auto points = points_as<TypeParam>(set.points);
        const auto queries =
            points_as<TypeParam>(queries_for(set.points, 20 + 2 * thorough, knn_seed + 1));
        for (const std::uint32_t k : {1u, 2u, 8u, 9u, 16u, 17u, 32u, 33u, 1000u}) {
            const auto wanted = expected<TypeParam>(points, queries, k);
            for (const PointsTree tree : {PointsTree::kdtree, PointsTree::bvh}) {
                const TypeParam index = build_points(points, {.tree = tree});
                for (const std::string& isa : point_instruction_sets()) {
                    const auto found = knn(index, queries, k, {.isa = isa});
                    EXPECT_EQ(differences(found, wanted), 0u)
                        << set.name << ", " << points.size() << " points, k " << k << ", "
                        << points_tree_name(tree) << ", " << isa << ", seed " << knn_seed;
                    EXPECT_EQ(found.counts.queries, queries.size());
                    EXPECT_EQ(found.counts.found, wanted.counts.found);
                    EXPECT_GE(found.counts.invalid_queries, 2u);
                    rows += queries.size();
                }
            }
        }
    }
    std::cout << rows << " rows compared, seed " << knn_seed << "\n";
}

TYPED_TEST(Knn, FarPointsDoNotCount) {
    using T = typename TypeParam::Scalar;
    std::size_t rows = 0, cut = 0;
    for (const PointSet& set : point_sets(20 * thorough, knn_seed + 8)) {
        const auto points = points_as<TypeParam>(set.points);
        const auto queries =
            points_as<TypeParam>(queries_for(set.points, 20 + 2 * thorough, knn_seed + 9));
        const TypeParam index = build_points(points);
        // A distance that is met is a limit that includes it.
        auto third = knn(index, queries, 3);
        std::vector<T> limits{0, T(0.01), std::numeric_limits<T>::max()};
        for (const T met : third.distances.span())
            if (met < infinity && limits.size() < 6) limits.push_back(met);
        for (const std::uint32_t k : {1u, 8u, 9u, 17u, 33u, 1000u})
            for (const T limit : limits) {
                const auto wanted = expected<TypeParam>(points, queries, k, limit);
                cut += wanted.counts.found < expected<TypeParam>(points, queries, k).counts.found;
                for (const std::string& isa : point_instruction_sets()) {
                    const auto found = knn(index, queries, k, {.isa = isa, .max_distance = limit});
                    EXPECT_EQ(differences(found, wanted), 0u)
                        << set.name << ", " << points.size() << " points, k " << k << ", within "
                        << limit << ", " << isa << ", seed " << knn_seed + 8;
                    EXPECT_EQ(found.counts.found, wanted.counts.found);
                    rows += queries.size();
                }
                NearestPoints<T> single{
                    Buffer<std::uint32_t>(queries.size() * k), Buffer<T>(queries.size() * k), {}};
                std::uint64_t found = 0;
                for (std::size_t q = 0; q < queries.size(); ++q)
                    found += knn(index, queries[q], single.indices.span().subspan(q * k, k),
                                 single.distances.span().subspan(q * k, k), limit);
                EXPECT_EQ(differences(single, wanted), 0u) << set.name << ", within " << limit;
                EXPECT_EQ(found, wanted.counts.found);
            }
    }
    EXPECT_GT(cut, 20u);
    std::cout << rows << " rows compared, seed " << knn_seed + 8 << "\n";
}

TYPED_TEST(Knn, ThreadsAndOrderChangeNothing) {
    for (const PointSet& set : point_sets(200 * thorough, knn_seed + 2)) {
        auto points = points_as<TypeParam>(set.points);
        auto queries = points_as<TypeParam>(queries_for(set.points, 200 * thorough, knn_seed + 3));
        std::shuffle(queries.begin(), queries.end(), std::mt19937_64(knn_seed));
        const TypeParam index = build_points(points);
        const auto wanted = knn(index, queries, 8, {.threads = 1, .order = QueryOrder::as_given});
        for (const int threads : {1, 2, 7}) {
            const TypeParam again = build_points(points, {.threads = threads});
            EXPECT_EQ(again.order(), index.order()) << set.name;
            for (const QueryOrder order :
                 {QueryOrder::automatic, QueryOrder::as_given, QueryOrder::sorted}) {
                const auto found = knn(again, queries, 8, {.threads = threads, .order = order});
                EXPECT_EQ(differences(found, wanted), 0u) << set.name << ", seed " << knn_seed;
                EXPECT_EQ(found.counts.invalid_queries, wanted.counts.invalid_queries);
            }
        }
    }
}

TYPED_TEST(Knn, OneByOneLikeTheBatch) {
    using T = typename TypeParam::Scalar;
    for (const PointSet& set : point_sets(20 * thorough, knn_seed + 4)) {
        const TypeParam index = build_points(points_as<TypeParam>(set.points));
        const auto queries =
            points_as<TypeParam>(queries_for(set.points, 20 + 2 * thorough, knn_seed + 5));
        for (const std::uint32_t k : {1u, 5u, 20u, 50u}) {
            const auto batch = knn(index, queries, k);
            NearestPoints<T> single{
                Buffer<std::uint32_t>(queries.size() * k), Buffer<T>(queries.size() * k), {}};
            std::uint64_t found = 0;
            for (std::size_t q = 0; q < queries.size(); ++q)
                found += knn(index, queries[q], single.indices.span().subspan(q * k, k),
                             single.distances.span().subspan(q * k, k));
            EXPECT_EQ(differences(single, batch), 0u) << set.name;
            EXPECT_EQ(found, batch.counts.found);
        }
    }
}

TYPED_TEST(Knn, HundredsOfThousandsOfEqualPoints) {
    using Point = typename TypeParam::Point;
    const std::size_t n = 15'000 * thorough;
    const auto at = [](double x, double y) {
        Point p{};
        p.x = static_cast<typename TypeParam::Scalar>(x);
        p.y = static_cast<typename TypeParam::Scalar>(y);
        return p;
    };
    std::vector<Point> points(n, at(0.3, 0.4));
    points.push_back(at(0, 0));
    points.push_back(at(1, 1));
    const std::vector<Point> queries(2000, at(0.9, 0.1));
    for (const PointsTree tree : {PointsTree::kdtree, PointsTree::bvh}) {
        const TypeParam index = build_points(points, {.tree = tree});
        for (const std::uint32_t k : {1u, 8u, 40u}) {
            // 2000 queries that looked at every point would take minutes.
            const auto found = knn(index, queries, k);
            for (std::size_t i = 0; i < found.indices.size(); ++i)
                ASSERT_EQ(found.indices[i], i % k) << points_tree_name(tree);
        }
        const auto on_them = knn(index, std::vector<Point>(2000, at(0.3, 0.4)), 8);
        for (std::size_t i = 0; i < on_them.indices.size(); ++i) {
            ASSERT_EQ(on_them.indices[i], i % 8);
            ASSERT_EQ(on_them.distances[i], 0);
        }
    }
}

TYPED_TEST(Knn, BadCalls) {
    using T = typename TypeParam::Scalar;
    using Point = typename TypeParam::Point;
    const TypeParam index = build_points(std::vector<Point>(10));
    const std::vector<Point> queries(3);
    std::vector<std::uint32_t> ids(6);
    std::vector<T> distances(6);
    const auto message = [&](const auto& call) {
        try {
            call();
        } catch (const InputError& error) {
            return std::string(error.what());
        }
        return std::string("no error");
    };
    EXPECT_EQ(message([&] { (void)knn(index, queries, 0); }), "knn: k is 0; it must be at least 1");
    EXPECT_EQ(message([&] { knn(index, Point{}, {}, {}); }), "knn: k is 0; it must be at least 1");
    EXPECT_NE(message([&] { knn(index, queries, 3, ids, distances); }).find("room for 6"),
              std::string::npos);
    EXPECT_NE(message([&] {
                  knn(index, queries, 2, ids, std::span(distances).first(5));
              }).find("room for 5"),
              std::string::npos);
    EXPECT_NE(
        message([&] { (void)knn(index, queries, 0xFFFFFFFFu); }).find("bytes; max_result_bytes"),
        std::string::npos);
    EXPECT_NE(
        message([&] { (void)knn(index, queries, 2, {.max_result_bytes = 40}); }).find("have 40"),
        std::string::npos);
    EXPECT_NE(message([&] { (void)knn(index, queries, 2, {.isa = "mmx"}); }).find("mmx"),
              std::string::npos);
    for (const double wrong : {-1.0, std::numeric_limits<double>::quiet_NaN()})
        for (const bool to_arrays : {false, true})
            EXPECT_NE(message([&] {
                          const PointQueryOptions options{.max_distance = wrong};
                          if (to_arrays)
                              knn(index, queries, 2, ids, distances, options);
                          else
                              (void)knn(index, queries, 2, options);
                      }).find("max_distance is"),
                      std::string::npos);
    EXPECT_EQ(message([&] { knn(index, Point{}, ids, distances, -1e-9); }),
              "max_distance is -1e-09; it must be 0 or more");
    EXPECT_EQ(knn(index, queries, 2, ids, distances).found, 6u);
}

TYPED_TEST(Knn, EmptyIndicesAndBatches) {
    using Point = typename TypeParam::Point;
    const std::vector<Point> queries(2);
    TypeParam index;
    for (int round = 0; round < 3; ++round) {
        const auto found = knn(index, queries, 3);
        for (std::size_t i = 0; i < 6; ++i) {
            EXPECT_EQ(found.indices[i], no_primitive);
            EXPECT_TRUE(std::isinf(found.distances[i]));
        }
        EXPECT_EQ(found.counts.found, 0u);
        EXPECT_TRUE(knn(index, {}, 3).indices.empty());
        if (round == 0) index = build_points(std::vector<Point>{});
        if (round == 1) const TypeParam taken = std::move(index);  // what is left is empty
    }
    EXPECT_EQ(knn(build_points(queries), {}, 3).counts.queries, 0u);
}

}  // namespace
}  // namespace raydix::test
