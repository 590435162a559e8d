// Queries as a GPU asks them (gpu/device_queries.h), run on the host: by its loops, and in shuffled
// order on real threads. Every row is that of points.h, closest.h and pairs.h, bit for bit.
#include "gpu/device_queries.h"

#include <raydix/error.h>
#include <raydix/model.h>
#include <raydix/points.h>

#include <cmath>
#include <iostream>
#include <numeric>

#include "support/launched_core.h"
#include "support/launched_queries.h"
#include "support/message.h"
#include "support/point_sets.h"
#include "support/scenes.h"
#include "support/support.h"

namespace raydix::test {
namespace {

constexpr std::uint64_t device_queries_seed = 2012;
constexpr const char* device_builders[] = {"karras", "lauterbach", "garanzha", "apetrei", "hploc"};

/// Calls with(launcher) for the loops of the host and for shuffled ones.
template <class With>
void with_launchers(std::uint64_t order_seed, const With& with) {
    HostLauncher<> host;
    with(host);
    ShuffledLauncher shuffled(order_seed);
    with(shuffled);
}

std::vector<PointSet> all_point_sets() {
    std::vector<PointSet> sets = point_sets(15 * thorough, device_queries_seed);
    sets.push_back({"all equal", std::vector<Vec3>(400, Vec3{1, -2, 3})});
    return sets;
}

TEST(DeviceQueries, NearestPointsAreThoseOfTheIndex) {
    std::size_t rows = 0;
    for (const PointSet& set : all_point_sets()) {
        const std::vector<Vec3> queries =
            queries_for(set.points, 10 + 2 * thorough, device_queries_seed + 1);
        const Points index = build_points(set.points);
        for (const int max_leaf : {1, 8, 40}) {
            const KdTree tree =
                build_kdtree(std::span<const Vec3>(set.points), {.max_leaf = max_leaf});
            for (const std::uint32_t k : {1u, 2u, 7u, 8u, 33u, 64u, 200u}) {
                SCOPED_TRACE(set.name + ", " + std::to_string(set.points.size()) + " points, k " +
                             std::to_string(k) + ", leaves of " + std::to_string(max_leaf) +
                             ", seed " + std::to_string(device_queries_seed));
                const NearestPoints<float> wanted = knn(index, queries, k);
                with_launchers(k, [&](auto& launcher) {
                    GuardedArray<std::uint32_t> indices(queries.size() * k);
                    GuardedArray<float> distances(queries.size() * k);
                    std::uint32_t invalid = 0;
                    check_knn(host_points(tree), queries, k, indices.span(), distances.span());
                    launch_knn(launcher, host_points(tree), queries, k, indices.span(),
                               distances.span(), &invalid);
                    EXPECT_EQ(indices.differences(wanted.indices), 0u);
                    EXPECT_EQ(distances.differences(wanted.distances), 0u);
                    EXPECT_EQ(invalid, wanted.counts.invalid_queries);
                    rows += queries.size();
                });
            }
        }
    }
    std::cout << rows << " rows compared, seed " << device_queries_seed << "\n";
}

template <class Launcher>
void expect_radius(Launcher& launcher, const KdTree& tree, std::span<const Vec3> queries,
                   float radius, const PointLists<float>& wanted, bool by_distance) {
    const DevicePoints points = host_points(tree);
    GuardedArray<std::uint64_t> offsets(queries.size() + 1);
    std::uint32_t invalid = 0;
    check_radius(points, queries, radius, offsets.span().size());
    launch_radius_count(launcher, points, queries, radius, offsets.span(), &invalid);
    ASSERT_EQ(offsets.differences(wanted.offsets), 0u);
    EXPECT_EQ(invalid, wanted.counts.invalid_queries);
    GuardedArray<std::uint32_t> indices(wanted.indices.size());
    GuardedArray<float> distances(wanted.indices.size());
    launch_radius_fill(launcher, points, queries, radius, offsets.span(), by_distance,
                       indices.span(), distances.span());
    EXPECT_EQ(indices.differences(wanted.indices), 0u);
    EXPECT_EQ(distances.differences(wanted.distances), 0u);
}

TEST(DeviceQueries, PointsWithinARadiusAreThoseOfTheIndex) {
    std::uint64_t found = 0;
    for (const PointSet& set : all_point_sets()) {
        const std::vector<Vec3> queries =
            queries_for(set.points, 10 + 2 * thorough, device_queries_seed + 2);
        const Points index = build_points(set.points);
        const KdTree tree = build_kdtree(std::span<const Vec3>(set.points));
        const Aabb box = index.bounds();
        const float size = index.empty() ? 1.0f : std::max(box.hi.x - box.lo.x, 1e-6f);
        for (const float radius : {0.0f, 0.03f * size, 0.4f * size, 3e19f, infinity})
            for (const bool by_distance : {false, true}) {
                SCOPED_TRACE(set.name + ", radius " + std::to_string(radius));
                const PointLists<float> wanted =
                    radius_search(index, queries, radius, {.sort = by_distance});
                found += wanted.counts.found;
                with_launchers(device_queries_seed, [&](auto& launcher) {
                    expect_radius(launcher, tree, queries, radius, wanted, by_distance);
                });
            }
    }
    std::cout << found << " points compared\n";
    EXPECT_GT(found, 1000u);
}

TEST(DeviceQueries, RowsThatDoNotFitAreLeftAsTheyAre) {
    const std::vector<Vec3> points = random_soup(100, 3).vertices;
    const KdTree tree = build_kdtree(std::span<const Vec3>(points));
    HostLauncher<> host;
    GuardedArray<std::uint64_t> offsets(points.size() + 1);
    launch_radius_count(host, host_points(tree), points, 0.2f, offsets.span(), nullptr);
    const std::uint64_t room = offsets[points.size() / 2] + 1;  // ends inside a row, or behind one
    ASSERT_LT(room, offsets[points.size()]);
    GuardedArray<std::uint32_t> indices(room);
    GuardedArray<float> distances(room);
    launch_radius_fill(host, host_points(tree), points, 0.2f, offsets.span(), false, indices.span(),
                       distances.span());
    std::uint64_t written = 0;
    for (std::size_t i = 0; i < points.size(); ++i)
        if (offsets[i + 1] <= room) written = offsets[i + 1];
    EXPECT_GT(written, 0u);
    for (std::uint64_t k = 0; k < room; ++k) EXPECT_EQ(indices.is_garbage(k), k >= written) << k;
}

std::vector<Vec3> queries_around(const Mesh& mesh, std::size_t count) {
    std::vector<Vec3> queries = queries_for(mesh.vertices, count, device_queries_seed + 3);
    for (std::size_t i = 0; i < std::min<std::size_t>(count, mesh.triangles.size()); ++i) {
        const Triangle& t = mesh.triangles[i];
        queries.push_back(0.5f * (mesh.vertices[t[0]] + mesh.vertices[t[1]]));  // ties of two
    }
    return queries;
}

void expect_closest(const std::string& name, const Mesh& mesh, std::size_t count) {
    const std::vector<Vec3> queries = queries_around(mesh, count);
    for (const char* builder : device_builders)
        for (const float reach : {infinity, 0.25f, 0.0f}) {
            const Bvh bvh = build_bvh(mesh, {.builder = builder_from_name(builder)});
            SCOPED_TRACE(name + ", " + builder + ", reach " + std::to_string(reach));
            std::vector<ClosestPoint> wanted(queries.size());
            const QueryCounts counts =
                closest_points(bvh, queries, wanted, {.max_distance = reach});
            with_launchers(device_queries_seed, [&](auto& launcher) {
                GuardedArray<ClosestPoint> results(queries.size());
                std::uint32_t invalid = 0;
                check_closest(host_primitives(bvh), queries, reach, results.span().size());
                launch_closest(launcher, host_primitives(bvh), queries, reach, results.span(),
                               &invalid);
                EXPECT_EQ(results.differences(wanted), 0u);
                EXPECT_EQ(invalid, counts.invalid_queries);
            });
        }
}

TEST(DeviceQueries, ClosestPointsAreThoseOfTheHost) {
    for (const Model& scene : builtin_triangle_scenes(100 * thorough))
        expect_closest(scene.name, scene.mesh(), 10 * thorough);
    expect_closest("lattice", lattice_mesh(20 * thorough, 5, device_queries_seed), 20 * thorough);
    for (const std::size_t n : {0u, 1u, 2u, 5u})
        expect_closest(std::to_string(n) + " triangles", random_soup(n, n + 1), 20);
    Mesh laced = random_soup(100, 5);
    for (std::size_t i = 0; i < laced.vertices.size(); i += 7) laced.vertices[i].x = std::nanf("");
    expect_closest("some left out", laced, 50);
    expect_closest("huge", scaled(random_soup(100, 6), 1e11f), 50);
}

template <class Launcher>
void expect_pairs(Launcher& launcher, const DevicePairQuery& query,
                  const std::vector<PrimitivePair>& wanted) {
    GuardedArray<std::uint64_t> offsets(query.a.input_count + std::size_t{1});
    check_pairs(query, offsets.span().size());
    launch_pairs_count(launcher, query, offsets.span());
    ASSERT_EQ(offsets[query.a.input_count], wanted.size());
    for (std::size_t i = 0; i < wanted.size(); ++i) {
        EXPECT_LE(offsets[wanted[i].first], i);
        EXPECT_GT(offsets[wanted[i].first + 1], i);
    }
    GuardedArray<PrimitivePair> pairs(wanted.size());
    launch_pairs_fill(launcher, query, offsets.span(), pairs.span());
    EXPECT_EQ(pairs.differences(wanted), 0u);
}

void expect_all_pairs(const std::string& name, const Bvh& a, const Bvh& b, bool narrow) {
    SCOPED_TRACE(name + (narrow ? ", narrow" : ""));
    const std::vector<PrimitivePair> self = overlapping_pairs(a, {.narrow = narrow}),
                                     cross = overlapping_pairs(a, b, {.narrow = narrow});
    std::cout << name << (narrow ? ", narrow: " : ": ") << self.size() << " within, "
              << cross.size() << " between\n";
    with_launchers(device_queries_seed, [&](auto& launcher) {
        expect_pairs(launcher, {.a = host_primitives(a), .narrow = narrow}, self);
        expect_pairs(
            launcher,
            {.a = host_primitives(a), .b = host_primitives(b), .between = true, .narrow = narrow},
            cross);
    });
}

TEST(DeviceQueries, PairsAreThoseOfTheHost) {
    const std::size_t n = 100 + 40 * thorough;
    Mesh laced = random_soup(n, 9, 0.2f);
    for (std::size_t i = 0; i < laced.vertices.size(); i += 11) laced.vertices[i].z = infinity;
    const std::pair<std::string, Mesh> meshes[] = {
        {"soup", random_soup(n, device_queries_seed, 0.2f)},
        {"lattice", lattice_mesh(n / 4, 6, device_queries_seed)},
        {"ball", ball_mesh({0, 0, 0})},
        {"some left out", laced},
        {"one", random_soup(1, 1)},
        {"none", random_soup(0, 1)}};
    const Bvh other = build_bvh(moved(ball_mesh({0, 0, 0}), {60, 10, -20}), {.max_leaf = 1});
    const Bvh soup = build_bvh(random_soup(n, device_queries_seed + 1, 0.1f), {.max_leaf = 7});
    for (const auto& [name, mesh] : meshes)
        for (const char* builder : device_builders) {
            const Bvh a = build_bvh(mesh, {.builder = builder_from_name(builder)});
            for (const bool narrow : {false, true})
                expect_all_pairs(name + ", " + builder, a, name == "ball" ? other : soup, narrow);
        }
}

TEST(DeviceQueries, PairsOfBoxesAndPoints) {
    const Mesh mesh = random_soup(200, 4, 0.3f);
    std::vector<Aabb> boxes;
    for (const Triangle& t : mesh.triangles)
        boxes.push_back(box_of(mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]]));
    boxes[7].lo.x = boxes[7].hi.x + 1;  // inverted: left out
    const Bvh of_boxes = build_bvh(boxes),
              of_points = build_bvh(std::span<const Vec3>(mesh.vertices)),
              of_triangles = build_bvh(mesh);
    expect_all_pairs("boxes", of_boxes, of_points, false);
    expect_all_pairs("points", of_points, of_triangles, false);
    expect_all_pairs("triangles", of_triangles, of_boxes, false);
}

TEST(DeviceQueries, AskTreesThatLaunchesBuilt) {
    const Mesh mesh = random_soup(60 * thorough, 12);
    Mesh points = mesh;
    points.triangles.clear();
    ShuffledLauncher shuffled(5);
    const LaunchedBuild built = launched_build(shuffled, mesh, {.builder = Builder::hploc});
    const Bvh bvh = build_bvh(mesh, {.builder = Builder::karras});
    expect_pairs(shuffled, {.a = host_primitives(built.bvh)}, overlapping_pairs(bvh));
    const KdTree tree = launched_kdtree(shuffled, points, {});
    const std::vector<Vec3> queries = queries_for(mesh.vertices, 100, 1);
    const Points index = build_points(mesh.vertices);
    expect_radius(shuffled, tree, queries, 0.1f, radius_search(index, queries, 0.1f), false);
}

TEST(DeviceQueries, WhatTheyRefuseIsNamed) {
    const std::vector<Vec3> queries(4);
    DevicePoints points;
    std::vector<std::uint32_t> indices(8);
    std::vector<float> distances(8);
    const auto knn_message = [&](std::uint32_t k) {
        return message_of([&] { check_knn(points, queries, k, indices, distances); });
    };
    EXPECT_EQ(knn_message(2), "no error");
    EXPECT_EQ(knn_message(0), "nearest points on a device: k is 0; it must be at least 1");
    EXPECT_EQ(knn_message(3), "nearest points on a device: 12 results, but room for 8");
    points.max_depth = 97;
    EXPECT_EQ(knn_message(2), "the tree is 97 levels deep; queries on a device have stacks for 96");
    points.max_depth = 0;
    for (const float radius : {-1.0f, std::nanf("")})
        EXPECT_THROW(check_radius(points, queries, radius, 5), InputError);
    EXPECT_THROW(check_radius(points, queries, 1.0f, 4), InputError);
    EXPECT_THROW(check_rows(3, 4), InputError);
    DevicePrimitives primitives;
    primitives.references = primitives.input_count = 3;
    EXPECT_EQ(message_of([&] { check_closest(primitives, queries, 1.0f, 4); }),
              "closest points on a device need triangles");
    EXPECT_THROW(check_closest({}, queries, -1.0f, 4), InputError);
    EXPECT_THROW(check_closest({}, queries, 1.0f, 3), InputError);
    const Aabb box{};
    primitives.boxes = &box;
    EXPECT_NO_THROW(check_pairs({.a = primitives}, 4));
    EXPECT_EQ(message_of([&] { check_pairs({.a = primitives, .narrow = true}, 4); }),
              "pairs on a device: narrow needs triangles");
    EXPECT_THROW(check_pairs({.a = primitives}, 3), InputError);
    EXPECT_THROW(check_offsets_scratch({}, 256), InputError);
    EXPECT_THROW(static_cast<void>(device_row_total({}, nullptr)), InputError);
}

TEST(DeviceQueries, WithoutADeviceEveryCallSaysSo) {
    if (device_available()) GTEST_SKIP() << "there is a device: " << device_name();
    EXPECT_THROW(static_cast<void>(device_points({})), BackendUnavailable);
    EXPECT_THROW(static_cast<void>(device_primitives({}, PrimitiveKind::boxes)),
                 BackendUnavailable);
    EXPECT_THROW(static_cast<void>(device_offsets_scratch_bytes(4)), BackendUnavailable);
    EXPECT_THROW(knn_on_device({}, {}, 1, {}, {}, nullptr, nullptr), BackendUnavailable);
    EXPECT_THROW(radius_count_on_device({}, {}, 1, {}, nullptr, {}, nullptr), BackendUnavailable);
    EXPECT_THROW(radius_fill_on_device({}, {}, 1, {}, false, {}, {}, nullptr), BackendUnavailable);
    EXPECT_THROW(closest_points_on_device({}, {}, 1, {}, nullptr, nullptr), BackendUnavailable);
    EXPECT_THROW(pairs_count_on_device({}, {}, {}, nullptr), BackendUnavailable);
    EXPECT_THROW(pairs_fill_on_device({}, {}, {}, nullptr), BackendUnavailable);
}

}  // namespace
}  // namespace raydix::test
