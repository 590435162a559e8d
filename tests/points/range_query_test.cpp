// Radius, box and neighbour lists against a look at every point.
#include <gtest/gtest.h>
#include <raydix/error.h>
#include <raydix/points.h>

#include <cstring>
#include <iostream>
#include <random>

#include "support/message.h"
#include "support/point_reference.h"
#include "support/sanitized.h"
#include "support/support.h"

namespace raydix::test {
namespace {

constexpr std::uint64_t range_query_seed = 67;

template <class Index>
class Within : public ::testing::Test {};
using Indices = ::testing::Types<Points, Points2, PointsD, Points2D>;
TYPED_TEST_SUITE(Within, Indices);

/// Zero, and the distances of some queries to their 1st, 10th and last points, so that points lie
/// on the sphere exactly or nearly so.
template <class Index>
std::vector<typename Index::Scalar> radii_for(const EveryPoint<Index>& every,
                                              const std::vector<typename Index::Point>& queries) {
    using T = typename Index::Scalar;
    std::vector<T> radii{0, std::numeric_limits<T>::infinity()};
    for (std::size_t q = 2; q < queries.size() && radii.size() < 12; q += 5) {
        const auto all = every.by_distance(queries[q]);
        for (const std::size_t rank : {std::size_t{0}, std::size_t{10}, all.size()})
            if (!all.empty() && std::isfinite(all[std::min(rank, all.size() - 1)].d2))
                radii.push_back(std::sqrt(all[std::min(rank, all.size() - 1)].d2));
    }
    return radii;
}

/// Whether row q of `lists` is `wanted`, bit for bit.
template <class T>
bool is_row(const PointLists<T>& lists, std::size_t q, const std::vector<Near<T>>& wanted) {
    if (lists.offsets[q + 1] - lists.offsets[q] != wanted.size()) return false;
    for (std::size_t i = 0; i < wanted.size(); ++i) {
        const T distance = std::sqrt(wanted[i].d2);
        if (lists.indices[lists.offsets[q] + i] != wanted[i].id ||
            std::memcmp(&lists.distances[lists.offsets[q] + i], &distance, sizeof(T)) != 0)
            return false;
    }
    return true;
}

TYPED_TEST(Within, RadiusLikeEveryPoint) {
    using T = typename TypeParam::Scalar;
    std::size_t rows = 0;
    for (const PointSet& set : point_sets(20 * thorough, range_query_seed)) {
        const auto points = points_as<TypeParam>(set.points);
        const auto queries =
            points_as<TypeParam>(queries_for(set.points, 20 + thorough, range_query_seed + 1));
        const EveryPoint<TypeParam> every(points);
        const std::vector<std::string> isas = point_instruction_sets();
        for (const PointsTree tree : {PointsTree::kdtree, PointsTree::bvh}) {
            const TypeParam index = build_points(points, {.tree = tree});
            std::size_t turn = 0;
            for (const T radius : radii_for<TypeParam>(every, queries)) {
                const std::string& isa = isas[turn++ % isas.size()];
                for (const bool sort : {false, true}) {
                    const auto lists =
                        radius_search(index, queries, radius, {.sort = sort, .isa = isa});
                    std::vector<std::uint32_t> counts(queries.size());
                    radius_count(index, queries, radius, counts, {.isa = isa});
                    for (std::size_t q = 0; q < queries.size(); ++q) {
                        const auto wanted = every.within(queries[q], radius, sort);
                        ASSERT_TRUE(is_row(lists, q, wanted))
                            << set.name << ", query " << q << ", radius " << radius << ", "
                            << points_tree_name(tree) << ", " << isa << ", seed "
                            << range_query_seed;
                        ASSERT_EQ(counts[q], wanted.size());
                        ASSERT_EQ(radius_count(index, queries[q], radius), wanted.size());
                        ++rows;
                    }
                    EXPECT_EQ(lists.counts.found, lists.indices.size());
                    EXPECT_GE(lists.counts.invalid_queries, 2u);
                }
            }
        }
    }
    std::cout << rows << " rows compared, seed " << range_query_seed << "\n";
}

TYPED_TEST(Within, ARadiusForEachQuery) {
    using T = typename TypeParam::Scalar;
    std::mt19937_64 random(range_query_seed);
    for (const PointSet& set : point_sets(20 * thorough, range_query_seed + 2)) {
        const auto points = points_as<TypeParam>(set.points);
        const auto queries =
            points_as<TypeParam>(queries_for(set.points, 700, range_query_seed + 3));
        const EveryPoint<TypeParam> every(points);
        const std::vector<T> some = radii_for<TypeParam>(every, queries);
        std::vector<T> radii(queries.size());
        for (T& radius : radii) radius = some[random() % some.size()];
        const TypeParam index = build_points(points);
        for (const QueryOrder order : {QueryOrder::as_given, QueryOrder::sorted}) {
            const auto lists = radius_search(index, queries, radii, {.order = order});
            for (std::size_t q = 0; q < queries.size(); q += 13)
                ASSERT_TRUE(is_row(lists, q, every.within(queries[q], radii[q], false)))
                    << set.name << ", query " << q;
        }
    }
}

TYPED_TEST(Within, CallbacksMayStop) {
    using T = typename TypeParam::Scalar;
    for (const PointSet& set : point_sets(20 * thorough, range_query_seed + 4)) {
        const auto points = points_as<TypeParam>(set.points);
        const auto queries =
            points_as<TypeParam>(queries_for(set.points, 20, range_query_seed + 5));
        const EveryPoint<TypeParam> every(points);
        const TypeParam index = build_points(points);
        for (const T radius : radii_for<TypeParam>(every, queries))
            for (const auto& query : queries) {
                std::vector<Near<T>> found;
                EXPECT_TRUE(
                    for_each_in_radius(index, query, radius, [&](std::uint32_t id, T distance) {
                        found.push_back({distance, id});
                        return true;
                    }));
                std::ranges::sort(found, {}, &Near<T>::id);
                const auto wanted = every.within(query, radius, false);
                ASSERT_EQ(found.size(), wanted.size()) << set.name;
                for (std::size_t i = 0; i < found.size(); ++i) {
                    ASSERT_EQ(found[i].id, wanted[i].id);
                    ASSERT_EQ(found[i].d2, std::sqrt(wanted[i].d2));
                }
                std::size_t calls = 0;
                const auto stop = [&](std::uint32_t, T) { return ++calls < 3; };
                EXPECT_EQ(for_each_in_radius(index, query, radius, stop), wanted.size() < 3);
                EXPECT_EQ(calls, std::min<std::size_t>(wanted.size(), 3));
            }
    }
}

bool stop_at_once(std::uint32_t, float) { return false; }

TEST(Visitors, MayBeFunctions) {
    const std::vector<Vec3> points(3);
    const Points index = build_points(points);
    EXPECT_FALSE(for_each_in_radius(index, points[0], 1, stop_at_once));
    EXPECT_FALSE(for_each_in_radius(index, points[0], 1, &stop_at_once));
}

TYPED_TEST(Within, BoxLikeEveryPoint) {
    using Box = typename TypeParam::Box;
    for (const PointSet& set : point_sets(20 * thorough, range_query_seed + 6)) {
        const auto points = points_as<TypeParam>(set.points);
        const auto corners =
            points_as<TypeParam>(queries_for(set.points, 80, range_query_seed + 7));
        std::vector<Box> boxes;
        for (std::size_t i = 0; i + 1 < corners.size(); ++i) {
            Box box{corners[i], corners[i + 1]};  // many are inverted on some axis
            if (i % 2 == 0)
                for (int d = 0; d < TypeParam::dimension; ++d)
                    if ((&box.lo.x)[d] > (&box.hi.x)[d]) std::swap((&box.lo.x)[d], (&box.hi.x)[d]);
            boxes.push_back(box);
            boxes.push_back({corners[i], corners[i]});
        }
        const EveryPoint<TypeParam> every(points);
        for (const PointsTree tree : {PointsTree::kdtree, PointsTree::bvh})
            for (const std::string& isa : point_instruction_sets()) {
                const TypeParam index = build_points(points, {.tree = tree});
                const auto lists = box_search(index, boxes, {.isa = isa});
                for (std::size_t b = 0; b < boxes.size(); ++b) {
                    const auto wanted = every.in_box(boxes[b]);
                    const auto row = lists.indices.view().subspan(
                        lists.offsets[b], lists.offsets[b + 1] - lists.offsets[b]);
                    ASSERT_TRUE(std::ranges::equal(row, wanted)) << set.name << ", box " << b;
                }
                for (const auto distance : lists.distances.view()) ASSERT_EQ(distance, 0);
                EXPECT_GE(lists.counts.invalid_queries, 2u);
            }
    }
}

TYPED_TEST(Within, NeighbourListsAreHalfOrFull) {
    using T = typename TypeParam::Scalar;
    for (const PointSet& set : point_sets(6 * thorough, range_query_seed + 8)) {
        const auto points = points_as<TypeParam>(set.points);
        const EveryPoint<TypeParam> every(points);
        const TypeParam index = build_points(points);
        const auto queries =
            points_as<TypeParam>(queries_for(set.points, 20, range_query_seed + 9));
        for (const T radius : radii_for<TypeParam>(every, queries)) {
            const auto full = neighbour_lists(index, radius, PairRows::full, {.threads = 2});
            const auto half = neighbour_lists(index, radius, PairRows::half, {.sort = true});
            ASSERT_EQ(full.offsets.size(), points.size() + 1);
            ASSERT_EQ(half.offsets.size(), points.size() + 1);
            ASSERT_EQ(full.indices.size(), 2 * half.indices.size()) << set.name;
            for (std::uint32_t i = 0; i < points.size(); ++i) {
                const bool valid = EveryPoint<TypeParam>::is_valid(points[i]);
                auto wanted =
                    valid ? every.within(points[i], radius, false) : std::vector<Near<T>>{};
                std::erase_if(wanted, [&](const Near<T>& n) { return n.id == i; });
                ASSERT_TRUE(is_row(full, i, wanted)) << set.name << ", point " << i;
                std::erase_if(wanted, [&](const Near<T>& n) { return n.id < i; });
                std::ranges::stable_sort(wanted, {}, &Near<T>::d2);
                ASSERT_TRUE(is_row(half, i, wanted)) << set.name << ", point " << i;
            }
        }
    }
}

TYPED_TEST(Within, ThreadsChangeNothing) {
    using T = typename TypeParam::Scalar;
    for (const PointSet& set : point_sets(20 * thorough, range_query_seed + 10)) {
        const auto points = points_as<TypeParam>(set.points);
        const auto queries =
            points_as<TypeParam>(queries_for(set.points, 1500, range_query_seed + 11));
        const TypeParam index = build_points(points);
        const T radius = radii_for<TypeParam>(EveryPoint<TypeParam>(points), queries).back() / 2;
        if (!std::isfinite(radius)) continue;
        const auto wanted = radius_search(index, queries, radius, {.threads = 1});
        for (const int threads : {2, 7}) {
            const auto lists = radius_search(index, queries, radius, {.threads = threads});
            EXPECT_TRUE(std::ranges::equal(lists.offsets.view(), wanted.offsets.view()));
            EXPECT_TRUE(std::ranges::equal(lists.indices.view(), wanted.indices.view()));
            EXPECT_TRUE(std::ranges::equal(lists.distances.view(), wanted.distances.view()));
        }
    }
}

TYPED_TEST(Within, ResultsLargerThanMemoryAreRefused) {
    using Point = typename TypeParam::Point;
    const std::size_t n = 15'000 * thorough;
    const TypeParam index = build_points(std::vector<Point>(n));  // all pairs would be n * n
    const std::vector<Point> queries(n);
    const PointQueryOptions small{.max_result_bytes = 100'000'000};
    EXPECT_NE(message_of([&] {
                  (void)radius_search(index, queries, 0, small);
              }).find("radius_search: the result needs more than 100000000 bytes"),
              std::string::npos);
    for (const PairRows rows : {PairRows::half, PairRows::full})
        EXPECT_NE(message_of([&] {
                      (void)neighbour_lists(index, 0, rows, small);
                  }).find("neighbour_lists: the result needs more than 100000000 bytes"),
                  std::string::npos);
    std::vector<std::uint32_t> counts(n);  // counting them is quick all the same
    EXPECT_EQ(radius_count(index, queries, 0, counts).found, std::uint64_t{n} * n);
    EXPECT_EQ(counts[n / 2], n);
    const auto lists = radius_search(index, {queries.data(), 3}, 0);
    const std::uint64_t bytes =
        3 * n * (sizeof(std::uint32_t) + sizeof(typename TypeParam::Scalar)) +
        4 * sizeof(std::uint64_t);
    EXPECT_EQ(lists.indices.size(), 3 * n);
    EXPECT_EQ(
        message_of([&] {
            (void)radius_search(index, {queries.data(), 3}, 0, {.max_result_bytes = 8 * bytes});
        }),
        "no error");
    EXPECT_NE(
        message_of([&] {
            (void)radius_search(index, {queries.data(), 3}, 0, {.max_result_bytes = bytes - 1});
        }),
        "no error");
}

/// Rows are found in one walk and kept until their places are known. Where there is no memory for
/// that beside the result, and where a block finds very many, they are found by two walks instead.
TYPED_TEST(Within, RowsOfOneWalkAndOfTwo) {
    using T = typename TypeParam::Scalar;
    std::mt19937_64 random(range_query_seed + 10);
    const auto unit = [&] { return static_cast<float>(random() >> 40) * 0x1p-24f; };
    std::vector<Vec3> places(thorough > 1 ? 1000
                                          : fewer(200, 2));  // each room that is tried asks for all
    for (Vec3& p : places) p = {unit(), unit(), unit()};
    const auto points = points_as<TypeParam>(places);
    const auto queries = points_as<TypeParam>(
        queries_for(places, thorough > 1 ? 4500 : fewer(1200, 2), range_query_seed + 11));
    const TypeParam index = build_points(points);
    const auto same = [&](const auto& a, const auto& b) {
        return std::ranges::equal(a.offsets.view(), b.offsets.view()) &&
               std::ranges::equal(a.indices.view(), b.indices.view()) &&
               std::ranges::equal(a.distances.view(), b.distances.view());
    };
    for (const T radius : {T(0.05), T(0.2), std::numeric_limits<T>::infinity()}) {
        const auto wanted = radius_search(index, queries, radius);
        for (const QueryOrder order : {QueryOrder::as_given, QueryOrder::sorted}) {
            const auto lists_within = [&](std::uint64_t room) {
                return radius_search(index, queries, radius,
                                     {.threads = 1, .order = order, .max_result_bytes = room});
            };
            std::uint64_t refused = 0, least = std::uint64_t{1} << 40;
            while (least - refused > (sanitized ? least / 16 : 1)) {
                const std::uint64_t room = refused + (least - refused) / 2;
                const bool fits = message_of([&] { (void)lists_within(room); }) == "no error";
                (fits ? least : refused) = room;
            }
            for (const std::uint64_t room : {least, least * 5 / 4, least * 3})
                EXPECT_TRUE(same(lists_within(room), wanted))
                    << "radius " << radius << ", " << room << " bytes";
        }
    }
    // More than a block keeps: all of 5,000 points for each of many queries.
    const TypeParam large =
        build_points(points_as<TypeParam>(queries_for(places, 5000, range_query_seed + 12)));
    const std::vector<typename TypeParam::Point> some(queries.begin(),
                                                      queries.begin() + fewer(700, 2));
    const auto all = radius_search(large, some, std::numeric_limits<T>::infinity());
    for (std::size_t q = 0; q < some.size(); ++q) {
        const std::uint64_t n = all.offsets[q + 1] - all.offsets[q];
        ASSERT_TRUE(n == 0 || n == large.size());
        ASSERT_TRUE(std::ranges::is_sorted(all.indices.view().subspan(all.offsets[q], n)));
    }
    EXPECT_EQ(all.counts.found,
              (some.size() - all.counts.invalid_queries) * std::uint64_t{large.size()});
}

/// Where rows are counted first, boxes of the tree that lie inside a query's count as a whole: in
/// trees that are deep enough.
TYPED_TEST(Within, RowsInBoxesOfOneWalkAndOfTwo) {
    using Box = typename TypeParam::Box;
    std::mt19937_64 random(range_query_seed + 13);
    const auto unit = [&] { return static_cast<float>(random() >> 40) * 0x1p-24f; };
    std::vector<Vec3> places(fewer(30'000, 3));
    for (Vec3& p : places) p = {unit(), unit(), unit()};
    const auto points = points_as<TypeParam>(places);
    const auto corners =
        points_as<TypeParam>(queries_for(places, fewer(200, 4), range_query_seed + 14));
    std::vector<Box> boxes;
    for (std::size_t i = 0; i + 1 < corners.size(); ++i) {
        Box box{corners[i], corners[i + 1]};
        for (int d = 0; d < TypeParam::dimension; ++d)
            if ((&box.lo.x)[d] > (&box.hi.x)[d]) std::swap((&box.lo.x)[d], (&box.hi.x)[d]);
        boxes.push_back(box);
    }
    const EveryPoint<TypeParam> every(points);
    for (const PointsTree tree : {PointsTree::kdtree, PointsTree::bvh})
        for (const std::string& isa : point_instruction_sets()) {
            const TypeParam index = build_points(points, {.tree = tree});
            const auto lists_within = [&](std::uint64_t room) {
                return box_search(index, boxes,
                                  {.threads = 1, .max_result_bytes = room, .isa = isa});
            };
            std::uint64_t refused = 0, least = std::uint64_t{1} << 40;
            while (least - refused > least / 64) {
                const std::uint64_t room = refused + (least - refused) / 2;
                const bool fits = message_of([&] { (void)lists_within(room); }) == "no error";
                (fits ? least : refused) = room;
            }
            for (const std::uint64_t room : {least, least * 3}) {
                const auto lists = lists_within(room);
                for (std::size_t b = 0; b < boxes.size(); ++b)
                    ASSERT_TRUE(std::ranges::equal(
                        lists.indices.view().subspan(lists.offsets[b],
                                                     lists.offsets[b + 1] - lists.offsets[b]),
                        every.in_box(boxes[b])))
                        << isa << ", box " << b << ", " << room << " bytes";
            }
        }
}

TYPED_TEST(Within, LongRowsBesideShortOnes) {
    using Point = typename TypeParam::Point;
    std::vector<Point> points(150 * thorough);
    for (std::size_t i = 0; i < points.size() / 2; ++i)
        points[i].x = static_cast<typename TypeParam::Scalar>(i + 1);
    const TypeParam index = build_points(points);
    const auto lists = neighbour_lists(index, 0, PairRows::full);
    const std::size_t half = points.size() / 2;
    for (std::size_t i = 0; i < points.size(); ++i)
        ASSERT_EQ(lists.offsets[i + 1] - lists.offsets[i], i < half ? 0 : half - 1);
    for (std::size_t i = half; i < points.size(); i += 7) {
        const auto row = lists.indices.view().subspan(lists.offsets[i], half - 1);
        ASSERT_TRUE(std::ranges::is_sorted(row));
        ASSERT_EQ(std::ranges::count(row, i), 0);
    }
}

TYPED_TEST(Within, BadRadii) {
    using T = typename TypeParam::Scalar;
    using Point = typename TypeParam::Point;
    const TypeParam index = build_points(std::vector<Point>(10));
    const std::vector<Point> queries(3);
    std::vector<std::uint32_t> counts(3);
    const auto visit = [](std::uint32_t, T) { return true; };
    for (const T bad : {T{-1}, std::numeric_limits<T>::quiet_NaN()}) {
        const std::vector<T> radii{1, 2, bad};
        for (const std::string& message :
             {message_of([&] { (void)radius_search(index, queries, bad); }),
              message_of([&] { radius_count(index, queries, bad, counts); }),
              message_of([&] { (void)radius_count(index, queries[0], bad); }),
              message_of([&] { (void)neighbour_lists(index, bad, PairRows::half); }),
              message_of([&] { for_each_in_radius(index, queries[0], bad, visit); })})
            EXPECT_TRUE(message.starts_with("radius is ")) << message;
        const std::string message = message_of([&] { (void)radius_search(index, queries, radii); });
        EXPECT_TRUE(message.starts_with("radius 2 is ")) << message;
    }
    EXPECT_NE(message_of([&] { (void)radius_search(index, queries, std::vector<T>(2)); }),
              "no error");
    EXPECT_NE(message_of([&] { radius_count(index, queries, 1, std::span(counts).first(2)); }),
              "no error");
    EXPECT_EQ(message_of([&] { (void)radius_count(index, queries[0], T(-1e-9)); }),
              "radius is -1e-09; it must be 0 or more");
    // -0 is zero.
    EXPECT_EQ(radius_search(index, queries, -T{0}).indices.size(), 30u);
}

TYPED_TEST(Within, EmptyIndices) {
    using Point = typename TypeParam::Point;
    const TypeParam index;
    const std::vector<Point> queries(2);
    EXPECT_EQ(radius_search(index, queries, 1).offsets.view().back(), 0u);
    EXPECT_EQ(box_search(index, std::vector<typename TypeParam::Box>(2)).offsets.size(), 3u);
    EXPECT_EQ(neighbour_lists(index, 1, PairRows::full).offsets.size(), 1u);
    EXPECT_EQ(radius_count(index, queries[0], 1), 0u);
    EXPECT_TRUE(for_each_in_radius(index, queries[0], 1, [](auto, auto) { return false; }));
    EXPECT_EQ(radius_search(build_points(queries), {}, 1).offsets.size(), 1u);
}

}  // namespace
}  // namespace raydix::test
