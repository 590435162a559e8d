// What goes wrong on one rank comes out on all, and nobody waits for ever.
#include <functional>

#include "mpi/ranks.h"

namespace raydix::mpi::test {
namespace {

/// The message of the error of type E that `call` throws on this rank.
template <class E>
std::string message_of(const std::function<void()>& call) {
    try {
        call();
    } catch (const E& error) {
        return error.what();
    } catch (const std::exception& error) {
        return std::string("another error: ") + error.what();
    }
    return "no error";
}

bool begins_with(const std::string& text, const std::string& start) {
    return text.compare(0, start.size(), start) == 0;
}

std::vector<Vec3> some_points(std::size_t n) {
    std::vector<Vec3> points(n);
    std::mt19937 random(5);
    std::uniform_real_distribution<float> unit(0, 1);
    for (Vec3& p : points) p = {unit(random), unit(random), unit(random)};
    return points;
}

TEST(ErrorsOverRanks, ARankThatThrowsIsNamedOnAll) {
    const auto points = some_points(20);
    Options options;
    options.strict = true;
    auto bad = points;
    if (rank() == last_rank()) bad[4].y = infinity;
    const std::string message =
        message_of<InputError>([&] { const DistributedPoints made(MPI_COMM_WORLD, bad, options); });
    EXPECT_TRUE(
        begins_with(message, "rank " + std::to_string(last_rank()) + ": point 4 of this rank"))
        << message;
    // The communicator still works.
    const DistributedPoints made(MPI_COMM_WORLD, points, options);
    EXPECT_EQ(made.holding().size, 20u * unsigned(ranks()));
}

TEST(ErrorsOverRanks, AMeshWithAWrongIndexIsNamedOnAll) {
    Mesh mesh;
    mesh.vertices = some_points(3);
    mesh.triangles = {{0, 1, rank() == last_rank() ? 3u : 2u}};
    const MeshView view(mesh);
    const std::string message = message_of<InputError>(
        [&] { const DistributedScene made(MPI_COMM_WORLD, std::span(&view, 1)); });
    EXPECT_TRUE(
        begins_with(message, "rank " + std::to_string(last_rank()) + ": mesh 0, triangle 0"))
        << message;
}

TEST(ErrorsOverRanks, ResultsThatAreTooLargeAreRefusedOnAll) {
    const auto points = some_points(100);
    const DistributedPoints made(MPI_COMM_WORLD, points);
    QueryOptions options;
    options.max_result_bytes = rank() == last_rank() ? 1000 : 0;
    const std::string start = "rank " + std::to_string(last_rank()) + ": ";
    std::string message = message_of<ResultTooLarge>([&] { (void)made.knn(points, 50, options); });
    EXPECT_TRUE(begins_with(message, start + "knn: the result needs 60000 bytes")) << message;
    message = message_of<ResultTooLarge>([&] { (void)made.radius(points, 2.0f, options); });
    EXPECT_NE(message.find("max_result_bytes lets it have 1000"), std::string::npos) << message;
    EXPECT_EQ(made.knn(points, 1).counts.found, 100u);
}

// Rank 0 asks one question. The others, which only answer, allow themselves next to nothing.
constexpr std::uint64_t little = 100;

TEST(ErrorsOverRanks, ARankThatOnlyAnswersRefusesNoRows) {
    const bool asks = rank() == 0;
    const auto points = some_points(100);
    const DistributedPoints made(MPI_COMM_WORLD, points);
    QueryOptions options;
    options.max_result_bytes = asks ? 0 : little;
    const auto mine = std::span<const Vec3>(points).first(asks ? 1 : 0);
    EXPECT_EQ(made.radius(mine, 2.0f, options).counts.found, asks ? 100u * unsigned(ranks()) : 0u);
}

TEST(ErrorsOverRanks, ARankThatOnlyAnswersRefusesNoHits) {
    const bool asks = rank() == 0;
    Mesh layers;
    for (std::uint32_t i = 0; i < 50; ++i) {
        const float z = float(i);
        layers.vertices.insert(layers.vertices.end(), {{0, 0, z}, {1, 0, z}, {0, 1, z}});
        layers.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
    }
    const MeshView view(layers);
    const DistributedScene scene(MPI_COMM_WORLD, std::span(&view, 1));
    TraceOptions of_rays;
    of_rays.max_result_bytes = asks ? 0 : little;
    const std::vector<Ray> rays(asks ? 1 : 0, Ray{{0.25f, 0.25f, -1}, 0, {0, 0, 1}, infinity});
    EXPECT_EQ(scene.trace_all(rays, of_rays).counts.hits, asks ? 50u * unsigned(ranks()) : 0u);
}

TEST(ErrorsOverRanks, RanksThatDifferAreFound) {
    const auto points = some_points(10);
    const bool other = rank() == last_rank() && ranks() > 1;
    const auto expect_difference = [&](const std::function<void()>& call) {
        if (ranks() == 1) return call();
        const std::string message = message_of<InputError>(call);
        EXPECT_TRUE(begins_with(message, "the ranks differ: rank 0 calls ")) << message;
        EXPECT_NE(message.find(", rank " + std::to_string(last_rank()) + " calls "),
                  std::string::npos)
            << message;
    };
    expect_difference([&] {
        Options options;
        options.partition = other ? Partition::curve : Partition::as_given;
        const DistributedPoints made(MPI_COMM_WORLD, points, options);
    });
    const DistributedPoints made(MPI_COMM_WORLD, points);
    expect_difference([&] { (void)made.knn(points, other ? 3 : 4); });
    expect_difference([&] { (void)made.radius(points, other ? 0.1f : 0.2f); });
    expect_difference([&] {
        if (other)
            (void)made.knn(points, 3);
        else
            (void)made.radius(points, 0.2f);
    });
    EXPECT_EQ(made.knn(points, 1).counts.found, 10u);
}

TEST(ErrorsOverRanks, OptionsOutOfRangeAreRefused) {
    const auto points = some_points(10);
    const auto refusal = [&](const Options& options) {
        return message_of<InputError>([&] {
            const DistributedPoints made(MPI_COMM_WORLD, points, options);
            (void)made.knn(points, 2);
        });
    };
    Options options;
    options.message_bytes = 0;
    EXPECT_NE(refusal(options).find("message_bytes"), std::string::npos);
    options = {};
    options.boxes_per_rank = 0;
    EXPECT_NE(refusal(options).find("boxes_per_rank"), std::string::npos);
    options = {};
    options.threads = -1;
    EXPECT_NE(refusal(options).find("threads"), std::string::npos);
    options = {};
    options.exchange_bytes = 15;
    EXPECT_NE(refusal(options).find("exchange_bytes is 15"), std::string::npos);
    const DistributedPoints made(MPI_COMM_WORLD, points);
    EXPECT_NE(message_of<InputError>([&] { (void)made.knn(points, 0); }).find("k is 0"),
              std::string::npos);
    EXPECT_NE(message_of<InputError>([&] {
                  (void)made.radius(points, -1e-9f);
              }).find("radius is -1e-09; it must be 0 or more"),
              std::string::npos);
    EXPECT_EQ(message_of<InputError>(
                  [] { const DistributedPoints none(MPI_COMM_NULL, std::span<const Vec3>()); }),
              "the communicator is MPI_COMM_NULL");
}

TEST(ErrorsOverRanks, SmallMessagesAndRoundsChangeNoAnswer) {
    const auto points = some_points(200);
    const DistributedPoints large(MPI_COMM_WORLD, points);
    Options options;
    options.exchange_bytes = 25 * std::uint64_t(ranks());  // one question between two ranks
    options.message_bytes = 7;
    const DistributedPoints small(MPI_COMM_WORLD, points, options);
    const auto queries = std::span<const Vec3>(points).first(30);
    const auto a = large.knn(queries, 9), b = small.knn(queries, 9);
    EXPECT_TRUE(same_bits(a.indices, b.indices));
    EXPECT_TRUE(same_bits(a.distances, b.distances));
    EXPECT_GT(b.report.rounds, a.report.rounds);
    const auto c = large.radius(queries, 0.4f), d = small.radius(queries, 0.4f);
    EXPECT_TRUE(same_bits(c.offsets, d.offsets));
    EXPECT_TRUE(same_bits(c.indices, d.indices));
    EXPECT_TRUE(same_bits(c.distances, d.distances));
}

TEST(ErrorsOverRanks, AnswersThatFillARoundAreGivenInSeveral) {
    // The questions of a rank fit into a round, their answers do not.
    const auto points = some_points(40), queries = some_points(1300);
    const DistributedPoints large(MPI_COMM_WORLD, points);
    Options options;
    options.exchange_bytes = 16384 * std::uint64_t(ranks());
    const DistributedPoints small(MPI_COMM_WORLD, points, options);
    const auto a = large.radius(queries, 0.5f), b = small.radius(queries, 0.5f);
    EXPECT_TRUE(same_bits(a.offsets, b.offsets));
    EXPECT_TRUE(same_bits(a.indices, b.indices));
    EXPECT_TRUE(same_bits(a.distances, b.distances));
    EXPECT_EQ(a.report.rounds, 1u);
    EXPECT_GT(b.report.rounds, 1u);
}

TEST(ErrorsOverRanks, AnswersOfAFixedSizeFitIntoARound) {
    // The questions of a rank fit into a round, their answers of 4 + 12 k bytes do not.
    constexpr std::uint32_t k = 50, asked = 60;
    const auto points = some_points(100);
    const auto queries = std::span<const Vec3>(points).first(asked);
    const DistributedPoints large(MPI_COMM_WORLD, points);
    Options options;
    options.exchange_bytes = 2000 * std::uint64_t(ranks());  // of each rank: 3 answers
    const DistributedPoints small(MPI_COMM_WORLD, points, options);
    const auto a = large.knn(queries, k), b = small.knn(queries, k);
    EXPECT_TRUE(same_bits(a.indices, b.indices));
    EXPECT_TRUE(same_bits(a.distances, b.distances));
    EXPECT_GE(b.report.rounds, asked / 3 / unsigned(ranks()));
    EXPECT_GT(b.report.rounds, a.report.rounds);
    // No rank took in more than it may, so all of them together did not, in either direction.
    std::uint64_t bytes = b.report.traffic.bytes;
    MPI_Allreduce(MPI_IN_PLACE, &bytes, 1, MPI_UINT64_T, MPI_SUM, MPI_COMM_WORLD);
    EXPECT_LE(bytes, 2 * b.report.rounds * options.exchange_bytes * unsigned(ranks()));
}

TEST(CurveOverRanks, RanksHoldEquallyManyAndQueriesReachFew) {
    const auto points = some_points(4000);  // the same on all ranks: each is there `ranks` times
    const DistributedPoints made(MPI_COMM_WORLD, points);
    const double fair = 4000;
    EXPECT_LE(double(made.holding().local), 1.1 * fair);
    EXPECT_GE(double(made.holding().local), 0.9 * fair);
    const std::vector<Vec3> equal(100, Vec3{1, 2, 3});
    const DistributedPoints same(MPI_COMM_WORLD, equal);
    EXPECT_EQ(same.holding().local, 100u);
}

}  // namespace
}  // namespace raydix::mpi::test
