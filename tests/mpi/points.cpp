// Points over ranks against an index of all points in one process, bit for bit.
#include "mpi/ranks.h"

namespace raydix::mpi::test {
namespace {

template <class T>
struct Cloud {
    using Point = typename PointIndex<T, 3>::Point;
    std::vector<Point> points, queries;
};

/// kind 0: uniform; 1: on a coarse grid, so that distances tie and points are equal; 2: clusters
/// with points that are not taken.
template <class T>
Cloud<T> make_cloud(int kind, std::size_t n, std::size_t queries, unsigned seed) {
    using Point = typename Cloud<T>::Point;
    std::mt19937 random(seed);
    std::uniform_real_distribution<T> unit(0, 1);
    const auto next = [&]() -> Point {
        Point p{unit(random), unit(random), unit(random)};
        if (kind == 1)
            for (T* x : {&p.x, &p.y, &p.z}) *x = T(int(*x * 6));
        if (kind == 2) {
            const T center = T(random() % 5);
            for (T* x : {&p.x, &p.y, &p.z}) *x = center + *x * *x * T(0.1);
        }
        return p;
    };
    Cloud<T> cloud;
    for (std::size_t i = 0; i < n; ++i) cloud.points.push_back(next());
    for (std::size_t i = 0; i < queries; ++i) cloud.queries.push_back(next());
    constexpr T nan = std::numeric_limits<T>::quiet_NaN();
    if (kind == 2 && n > 4) {
        cloud.points[n / 2].y = nan;
        cloud.points[n / 3].x = T(2e12);
    }
    if (queries > 4) {
        cloud.queries[queries / 2].z = nan;
        cloud.queries[queries / 3].x = T(50);
        if (n > 0) cloud.queries[1] = cloud.points[0];
    }
    return cloud;
}

template <class List>
std::vector<std::uint64_t> wide_ids(const List& ids) {
    std::vector<std::uint64_t> all;
    for (std::size_t i = 0; i < ids.size(); ++i)
        all.push_back(ids[i] == no_primitive ? no_global : ids[i]);
    return all;
}

/// One process and many, for this rank's queries.
template <class T>
struct Both {
    using Point = typename Cloud<T>::Point;

    Both(const Cloud<T>& cloud, Division division, const Options& options, unsigned seed)
        : one(build_points(std::span<const Point>(cloud.points))),
          many(MPI_COMM_WORLD, mine(cloud.points, division_of(cloud.points.size(), division, seed)),
               options),
          queries(mine(cloud.queries, division_of(cloud.queries.size(), division, seed + 1))) {}

    void expect_same_nearest(std::uint32_t k) const {
        const auto expected = knn(one, queries, k);
        const auto found = many.knn(queries, k);
        EXPECT_TRUE(same_bits(wide_ids(expected.indices), found.indices));
        EXPECT_TRUE(same_bits(expected.distances, found.distances));
        EXPECT_EQ(expected.counts.found, found.counts.found);
        EXPECT_EQ(expected.counts.invalid_queries, found.counts.invalid_queries);
    }
    void expect_same_within(T radius, bool sort) const {
        PointQueryOptions options;
        options.sort = sort;
        expect_same_lists(radius_search(one, queries, radius, options),
                          many.radius(queries, radius, {sort}));
    }
    void expect_same_boxes() const {
        std::vector<typename PointIndex<T, 3>::Box> boxes;
        for (const Point& q : queries)
            boxes.push_back({{q.x - T(0.2), q.y - T(0.3), q.z - T(0.4)}, {q.x, q.y, q.z + 1}});
        expect_same_lists(box_search(one, std::span<const typename PointIndex<T, 3>::Box>(boxes)),
                          many.box(boxes));
    }
    template <class Expected, class Found>
    static void expect_same_lists(const Expected& expected, const Found& found) {
        EXPECT_TRUE(same_bits(expected.offsets, found.offsets));
        EXPECT_TRUE(same_bits(wide_ids(expected.indices), found.indices));
        EXPECT_TRUE(same_bits(expected.distances, found.distances));
        EXPECT_EQ(expected.counts.found, found.counts.found);
        EXPECT_EQ(expected.counts.invalid_queries, found.counts.invalid_queries);
    }

    PointIndex<T, 3> one;
    BasicDistributedPoints<T> many;
    std::span<const Point> queries;
};

template <class T>
void expect_same(const Cloud<T>& cloud, Division division, const Options& options, unsigned seed) {
    const Both<T> both(cloud, division, options, seed);
    EXPECT_EQ(both.many.holding().size, cloud.points.size());
    EXPECT_EQ(both.many.holding().left_out, both.one.left_out());
    for (const std::uint32_t k : {1u, 5u, 20u, 40u}) both.expect_same_nearest(k);
    both.expect_same_within(T(0.25), false);
    both.expect_same_within(T(1), true);
    both.expect_same_within(T(0), false);
    both.expect_same_boxes();
}

template <class T>
class PointsOverRanks : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(PointsOverRanks, Scalars);

TYPED_TEST(PointsOverRanks, AnswerAsOneProcess) {
    unsigned seed = 1;
    for (const Partition partition : {Partition::as_given, Partition::curve})
        for (const Division division : divisions) {
            const int kind = int(++seed % 3);
            SCOPED_TRACE("kind " + std::to_string(kind) + ", division " +
                         std::to_string(int(division)) + ", seed " + std::to_string(seed));
            Options options;
            options.partition = partition;
            options.threads = 1;
            expect_same(make_cloud<TypeParam>(kind, 700, 90, seed), division, options, seed);
        }
}

/// Whatever comes: few points or none, any k, more ranks than points.
TYPED_TEST(PointsOverRanks, AnswerAsOneProcessInAnyCase) {
    for (unsigned seed = 1; seed <= 8; ++seed) {
        SCOPED_TRACE("seed " + std::to_string(seed));
        std::mt19937 random(seed);
        Options options;
        options.partition = random() % 2 == 0 ? Partition::curve : Partition::as_given;
        options.boxes_per_rank = static_cast<std::uint32_t>(1 + random() % 40);
        options.exchange_bytes = random() % 2 == 0 ? 4096 : std::uint64_t{1} << 20;
        options.message_bytes = 1 + random() % 200;
        options.threads = 1;
        const std::size_t n = random() % (seed % 3 == 0 ? 4 : 300), queries = random() % 40;
        const auto division = divisions[random() % 4];
        const auto cloud = make_cloud<TypeParam>(int(random() % 3), n, queries, seed);
        const Both<TypeParam> both(cloud, division, options, seed);
        both.expect_same_nearest(static_cast<std::uint32_t>(1 + random() % 60));
        both.expect_same_within(TypeParam(random() % 10) / 8, random() % 2 == 0);
    }
}

}  // namespace
}  // namespace raydix::mpi::test
