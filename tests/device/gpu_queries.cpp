// Queries by the public calls of raydix/device_queries.h over trees that the device built, against
// points.h, closest.h and pairs.h on the host: bit for bit, for more queries than fill a grid.
// Skipped where there is no device.
#include <gtest/gtest.h>
#include <raydix/device.h>
#include <raydix/device_queries.h>
#include <raydix/device_trees.h>
#include <raydix/raydix.h>

#include <cmath>
#include <cstring>

#include "device/device_test.h"
#include "support/point_sets.h"
#include "support/scenes.h"
#include "support/support.h"

namespace raydix::test {
namespace {

constexpr std::uint64_t seed = 31;

class GpuQueries : public DeviceTest {};

template <class T>
std::vector<T> downloaded(const DeviceBuffer<T>& buffer) {
    std::vector<T> values(buffer.size());
    buffer.download(values);
    return values;
}
template <class T>
std::span<T> span_of(const DeviceBuffer<T>& buffer) {
    return {buffer.data(), buffer.size()};
}
template <class T, class Other>
std::size_t differences(const DeviceBuffer<T>& buffer, const Other& wanted) {
    const std::vector<T> found = downloaded(buffer);
    std::size_t count = found.size() != wanted.size();
    for (std::size_t i = 0; i < std::min(found.size(), std::size_t{wanted.size()}); ++i)
        count += std::memcmp(&found[i], &wanted[i], sizeof(T)) != 0;
    return count;
}

/// Points, a k-d tree of them on the device, and an index on the host.
struct PointCase {
    DeviceBuffer<Vec3> points;
    DeviceKdTree built;
    DevicePoints tree;
    Points index;
    std::vector<Vec3> queries;
    DeviceBuffer<Vec3> on_device;
    DeviceBuffer<std::uint32_t> invalid{1};

    PointCase(const std::vector<Vec3>& given, std::size_t query_count)
        : points(std::span<const Vec3>(given)),
          built(PrimitiveKind::points, static_cast<std::uint32_t>(given.size()), {}),
          index(build_points(given)),
          queries(queries_for(given, query_count, seed)),
          on_device(std::span<const Vec3>(queries)) {
        built.build({points.data(), static_cast<std::uint32_t>(given.size())});
        tree = device_points(built.tree());
    }
    void clear_invalid() {
        const std::uint32_t zero = 0;
        invalid.upload({&zero, 1});
    }
};

void compare_points(const std::string& name, const std::vector<Vec3>& points, std::size_t queries) {
    SCOPED_TRACE(name + ", seed " + std::to_string(seed));
    PointCase c(points, queries);
    for (const std::uint32_t k : {1u, 8u, 64u}) {
        const NearestPoints<float> wanted = knn(c.index, c.queries, k);
        const DeviceBuffer<std::uint32_t> indices(c.queries.size() * k);
        const DeviceBuffer<float> distances(c.queries.size() * k);
        c.clear_invalid();
        knn_on_device(c.tree, span_of(c.on_device), k, span_of(indices), span_of(distances),
                      c.invalid.data(), nullptr);
        EXPECT_EQ(differences(indices, wanted.indices), 0u) << "k " << k;
        EXPECT_EQ(differences(distances, wanted.distances), 0u) << "k " << k;
        EXPECT_EQ(downloaded(c.invalid)[0], wanted.counts.invalid_queries);
    }
    for (const bool by_distance : {false, true}) {
        const PointLists<float> wanted =
            radius_search(c.index, c.queries, 0.02f, {.sort = by_distance});
        const DeviceBuffer<std::uint64_t> offsets(c.queries.size() + 1);
        const auto rows = static_cast<std::uint32_t>(c.queries.size());
        const DeviceBuffer<std::byte> scratch(device_offsets_scratch_bytes(rows));
        radius_count_on_device(c.tree, span_of(c.on_device), 0.02f, span_of(offsets), nullptr,
                               span_of(scratch), nullptr);
        EXPECT_EQ(differences(offsets, wanted.offsets), 0u);
        const std::uint64_t total = device_row_total(span_of(offsets), nullptr);
        ASSERT_EQ(total, wanted.indices.size());
        const DeviceBuffer<std::uint32_t> indices(total);
        const DeviceBuffer<float> distances(total);
        radius_fill_on_device(c.tree, span_of(c.on_device), 0.02f, span_of(offsets), by_distance,
                              span_of(indices), span_of(distances), nullptr);
        EXPECT_EQ(differences(indices, wanted.indices), 0u);
        EXPECT_EQ(differences(distances, wanted.distances), 0u);
    }
}

TEST_F(GpuQueries, PointsLikeTheIndex) {
    compare_points("uniform", random_soup(fitting(100'000), 1).vertices, fitting(200'000));
    for (const PointSet& set : point_sets(5000, seed)) compare_points(set.name, set.points, 3000);
    compare_points("all equal", std::vector<Vec3>(fitting(100'000), Vec3{1, 2, 3}), fitting(2000));
}

TEST_F(GpuQueries, FewPoints) {
    for (std::size_t n = 0; n <= 9; ++n)
        compare_points(std::to_string(n), random_soup(3, n).vertices, 100 + n);
}

/// A mesh and its tree on the device.
struct MeshCase {
    DeviceBuffer<Vec3> vertices;
    DeviceBuffer<Triangle> triangles;
    DeviceBvh built;
    DevicePrimitives tree;

    MeshCase(const Mesh& mesh, Builder builder)
        : vertices(std::span<const Vec3>(mesh.vertices)),
          triangles(std::span<const Triangle>(mesh.triangles)),
          built(PrimitiveKind::triangles, static_cast<std::uint32_t>(mesh.triangles.size()),
                {.builder = builder}) {
        built.build({vertices.data(), static_cast<std::uint32_t>(mesh.vertices.size()),
                     triangles.data(), static_cast<std::uint32_t>(mesh.triangles.size())});
        tree = device_primitives(built.tree(), PrimitiveKind::triangles);
    }
};

void compare_closest(const std::string& name, const Mesh& mesh, std::size_t count) {
    const std::vector<Vec3> queries = queries_for(mesh.vertices, count, seed);
    const DeviceBuffer<Vec3> on_device{std::span<const Vec3>(queries)};
    const std::vector<ClosestPoint> wanted = closest_points(build_bvh(mesh), queries);
    for (const Builder builder : {Builder::apetrei, Builder::hploc}) {
        SCOPED_TRACE(name + ", " + std::string(builder_name(builder)));
        const MeshCase c(mesh, builder);
        const DeviceBuffer<ClosestPoint> results(queries.size());
        closest_points_on_device(c.tree, span_of(on_device), infinity, span_of(results), nullptr,
                                 nullptr);
        EXPECT_EQ(differences(results, wanted), 0u);
    }
}

TEST_F(GpuQueries, ClosestPointsLikeTheHost) {
    for (const Model& scene : fitting(builtin_triangle_scenes(fitting(100'000))))
        compare_closest(scene.name, scene.mesh(), fitting(100'000));
    compare_closest("lattice", lattice_mesh(2000, 8, seed), fitting(50'000));
}

TEST_F(GpuQueries, FewTriangles) {
    for (const std::size_t n : {1u, 2u, 5u, 12u})
        compare_closest(std::to_string(n), random_soup(n, n), 300);
}

void compare_pairs(const DevicePairQuery& query, const std::vector<PrimitivePair>& wanted) {
    const DeviceBuffer<std::uint64_t> offsets(query.a.input_count + std::size_t{1});
    const DeviceBuffer<std::byte> scratch(device_offsets_scratch_bytes(query.a.input_count));
    pairs_count_on_device(query, span_of(offsets), span_of(scratch), nullptr);
    const std::uint64_t total = device_row_total(span_of(offsets), nullptr);
    ASSERT_EQ(total, wanted.size());
    const DeviceBuffer<PrimitivePair> pairs(total);
    pairs_fill_on_device(query, span_of(offsets), span_of(pairs), nullptr);
    EXPECT_EQ(differences(pairs, wanted), 0u);
}

void compare_pairs(const std::string& name, const Mesh& x, const Mesh& y) {
    const Bvh host_x = build_bvh(x), host_y = build_bvh(y);
    for (const Builder builder : {Builder::apetrei, Builder::hploc}) {
        const MeshCase a(x, builder), b(y, builder);
        for (const bool narrow : {false, true}) {
            SCOPED_TRACE(name + ", " + std::string(builder_name(builder)) +
                         (narrow ? ", narrow" : ""));
            const PairOptions options{.narrow = narrow};
            compare_pairs({.a = a.tree, .narrow = narrow}, overlapping_pairs(host_x, options));
            compare_pairs({.a = a.tree, .b = b.tree, .between = true, .narrow = narrow},
                          overlapping_pairs(host_x, host_y, options));
        }
    }
}

TEST_F(GpuQueries, PairsLikeTheHost) {
    compare_pairs("soups", random_soup(fitting(50'000), 1, 0.03f),
                  random_soup(fitting(40'000), 2, 0.02f));
    compare_pairs("lattices", lattice_mesh(fitting(3000), 12, seed),
                  lattice_mesh(fitting(2000), 12, seed + 1));
}

TEST_F(GpuQueries, FewPairs) {
    compare_pairs("few", random_soup(30, 1, 0.5f), random_soup(20, 2, 0.5f));
    compare_pairs("balls", ball_mesh({0, 0, 0}), ball_mesh({60, 10, -20}));
}

}  // namespace
}  // namespace raydix::test
