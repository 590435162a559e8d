// Scenes over ranks against one scene of all meshes, bit for bit.
#include <raydix/double.h>
#include <raydix/solid.h>

#include "mpi/ranks.h"

namespace raydix::mpi::test {
namespace {

template <class T>
struct Of;
template <>
struct Of<float> {
    using Bvh = raydix::Bvh;
    using Solid = raydix::Solid;
};
template <>
struct Of<double> {
    using Bvh = BvhD;
    using Solid = SolidD;
};

/// Triangles anywhere, some twice so that hits tie across ranks, some without area or not finite;
/// and closed boxes, so that points are inside.
template <class T>
BasicMesh<T> make_soup(std::size_t n, unsigned seed) {
    BasicMesh<T> mesh;
    std::mt19937 random(seed);
    std::uniform_real_distribution<T> unit(0, 1);
    const auto add = [&](const std::vector<BasicVec3<T>>& corners) {
        const auto v = static_cast<std::uint32_t>(mesh.vertices.size());
        mesh.vertices.insert(mesh.vertices.end(), corners.begin(), corners.end());
        mesh.triangles.push_back({v, v + 1, v + 2});
    };
    for (std::size_t i = 0; i < n; ++i) {
        const T x = unit(random) * 4, y = unit(random) * 4, z = unit(random) * 4;
        const auto near = [&]() -> BasicVec3<T> {
            return {x + unit(random), y + unit(random), z + unit(random)};
        };
        add({near(), near(), near()});
        if (i % 7 == 3) mesh.triangles.push_back(mesh.triangles[random() % mesh.triangles.size()]);
        if (i % 31 == 5) mesh.vertices.back() = mesh.vertices[mesh.vertices.size() - 2];
        if (i % 53 == 8) mesh.vertices.back().y = std::numeric_limits<T>::infinity();
    }
    return mesh;
}

template <class T>
void add_box(BasicMesh<T>& mesh, T lo, T hi) {
    const auto v = static_cast<std::uint32_t>(mesh.vertices.size());
    for (int i = 0; i < 8; ++i)
        mesh.vertices.push_back({i & 1 ? hi : lo, i & 2 ? hi : lo, i & 4 ? hi : lo});
    constexpr std::uint32_t faces[6][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4},
                                           {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
    for (const auto& f : faces) {
        mesh.triangles.push_back({v + f[0], v + f[1], v + f[2]});
        mesh.triangles.push_back({v + f[0], v + f[2], v + f[3]});
    }
}

template <class T>
std::vector<BasicRay<T>> make_rays(std::size_t n, unsigned seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<T> unit(0, 1);
    std::vector<BasicRay<T>> rays(n);
    for (std::size_t i = 0; i < n; ++i) {
        auto& ray = rays[i];
        for (T* x : {&ray.origin.x, &ray.origin.y, &ray.origin.z}) *x = unit(random) * 6 - T(0.5);
        for (T* x : {&ray.direction.x, &ray.direction.y, &ray.direction.z})
            *x = unit(random) - T(0.5);
        if (i % 5 == 0) ray.direction = {0, 0, T(3)};
        if (i % 11 == 0) ray.tmax = T(1.5);
        if (i % 13 == 0) ray.tmin = T(0.5);
        if (i % 17 == 0) ray.direction = {0, 0, 0};
        if (i % 19 == 0) ray.origin.x = std::numeric_limits<T>::quiet_NaN();
    }
    return rays;
}

/// The number of a triangle in the whole: what `prim` is where there is one geometry.
template <class Hit>
std::uint64_t whole_prim(const Hit& hit) {
    return hit.hit() ? std::uint64_t(hit.prim) : no_global;
}

template <class T>
struct SceneOfBoth {
    using Mesh = BasicMesh<T>;
    using View = BasicMeshView<T>;
    using Point = BasicVec3<T>;
    using Ray = BasicRay<T>;

    SceneOfBoth(const Mesh& whole, Division division, const SceneOptions& options, unsigned seed)
        : mesh(whole), one(whole), begins(division_of(whole.triangles.size(), division, seed)) {
        const View part(whole.vertices, mine(whole.triangles, begins));
        many.emplace(MPI_COMM_WORLD, std::span<const View>(&part, 1), options);
    }

    void expect_same_hits(std::span<const Ray> rays) const {
        const auto expected = trace(one, rays);
        const auto found = many->trace(rays);
        ASSERT_EQ(found.values.size(), expected.size());
        std::size_t different = 0, hits = 0;
        for (std::size_t i = 0; i < rays.size(); ++i) {
            const auto& f = found.values[i];
            const auto& e = expected[i];
            different += std::memcmp(&f.t, &e.t, sizeof(T)) != 0 || f.u != e.u || f.v != e.v ||
                         f.prim != whole_prim(e) || f.geometry != e.geometry;
            hits += e.hit();
        }
        EXPECT_EQ(different, 0u);
        EXPECT_EQ(found.counts.hits, hits);
        expect_same_occlusion(rays, hits);
        expect_same_rows(rays);
    }
    void expect_same_occlusion(std::span<const Ray> rays, std::size_t hits) const {
        std::vector<std::uint8_t> expected(rays.size());
        const TraceCounts counts = trace_any(one, rays, std::span(expected));
        const auto found = many->trace_any(rays);
        EXPECT_TRUE(same_bits(expected, found.values));
        EXPECT_EQ(found.counts.hits, hits);
        EXPECT_EQ(found.counts.invalid_rays, counts.invalid_rays);
    }
    void expect_same_rows(std::span<const Ray> rays) const {
        const auto expected = trace_all(one, rays);
        const auto found = many->trace_all(rays);
        EXPECT_TRUE(same_bits(expected.offsets, found.offsets));
        ASSERT_EQ(expected.hits.size(), found.hits.size());
        std::size_t different = 0;
        for (std::size_t i = 0; i < expected.hits.size(); ++i) {
            const auto& f = found.hits[i];
            const auto& e = expected.hits[i];
            different += f.t != e.t || f.u != e.u || f.v != e.v || f.prim != e.prim ||
                         f.geometry != e.geometry;
        }
        EXPECT_EQ(different, 0u);
        EXPECT_EQ(found.counts.hits, expected.counts.hits);
    }
    void expect_same_closest(std::span<const Point> points, T max_distance) const {
        BasicSceneClosestOptions<T> options;
        options.max_distance = max_distance;
        const auto expected = raydix::closest_points(one, points, options);
        const auto found = many->closest_points(points, max_distance);
        ASSERT_EQ(found.values.size(), expected.size());
        std::size_t different = 0;
        for (std::size_t i = 0; i < points.size(); ++i) {
            const auto& f = found.values[i];
            const auto& e = expected[i];
            different += std::memcmp(&f.position, &e.position, sizeof(e.position)) != 0 ||
                         std::memcmp(&f.distance, &e.distance, sizeof(T)) != 0 || f.u != e.u ||
                         f.v != e.v || f.prim != (e.found() ? std::uint64_t(e.prim) : no_global);
        }
        EXPECT_EQ(different, 0u);
    }
    void expect_same_inside(std::span<const Point> points) const {
        SolidOptions options;
        options.rule = InsideRule::parity;
        const auto tree = build_bvh(mesh);
        const typename Of<T>::Solid solid(tree, options);
        std::vector<std::uint8_t> expected(points.size());
        const QueryCounts counts = raydix::contains(solid, points, std::span(expected));
        const auto found = many->contains(points);
        EXPECT_TRUE(same_bits(expected, found.values));
        EXPECT_EQ(found.counts.found, counts.found);
        EXPECT_EQ(found.counts.invalid_queries, counts.invalid_queries);
    }

    const Mesh& mesh;
    BasicScene<T> one;
    std::vector<std::size_t> begins;
    std::optional<BasicDistributedScene<T>> many;
};

template <class T>
class ScenesOverRanks : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(ScenesOverRanks, Scalars);

TYPED_TEST(ScenesOverRanks, AnswerAsOneProcess) {
    using T = TypeParam;
    unsigned seed = 100;
    for (const Partition partition : {Partition::as_given, Partition::curve})
        for (const Division division : divisions) {
            SCOPED_TRACE("division " + std::to_string(int(division)) + ", seed " +
                         std::to_string(++seed));
            auto mesh = make_soup<T>(500, seed);
            add_box<T>(mesh, T(0.5), T(3.5));
            add_box<T>(mesh, T(1), T(2));
            SceneOptions options;
            options.partition = partition;
            options.one_geometry = true;
            options.threads = 1;
            const SceneOfBoth<T> both(mesh, division, options, seed);
            const auto rays = make_rays<T>(400, seed);
            both.expect_same_hits(mine(rays, division_of(rays.size(), division, seed + 1)));
            std::vector<BasicVec3<T>> points;
            for (const auto& ray : rays) points.push_back(ray.origin);
            points[3] = {T(0.5), T(1), T(1)};  // on a face, an edge and a corner
            points[4] = {T(1), T(1), T(1.5)};
            points[5] = {T(2), T(2), T(2)};
            const auto queries = mine(points, division_of(points.size(), division, seed + 2));
            both.expect_same_closest(queries, T(infinity));
            both.expect_same_closest(queries, T(0.05));
            both.expect_same_inside(queries);
        }
}

TYPED_TEST(ScenesOverRanks, GeometriesNumberThroughTheRanks) {
    using T = TypeParam;
    using View = BasicMeshView<T>;
    // Rank r gives r % 3 meshes, all with the same triangles: every hit ties.
    const auto mesh = make_soup<T>(60, 7);
    const auto rays = make_rays<T>(100, 8);
    BasicScene<T> one;
    std::vector<View> given;
    for (int r = 0; r < ranks(); ++r)
        for (int m = 0; m < r % 3; ++m) {
            one.add(mesh);
            if (r == rank()) given.emplace_back(mesh);
        }
    one.commit();
    for (const Partition partition : {Partition::as_given, Partition::curve}) {
        SceneOptions options;
        options.partition = partition;
        const BasicDistributedScene<T> many(MPI_COMM_WORLD, given, options);
        const auto expected = trace_all(one, std::span(rays));
        const auto found = many.trace_all(rays);
        ASSERT_TRUE(same_bits(expected.offsets, found.offsets));
        std::size_t different = 0;
        for (std::size_t i = 0; i < expected.hits.size(); ++i)
            different += found.hits[i].geometry != expected.hits[i].geometry ||
                         found.hits[i].prim != expected.hits[i].prim ||
                         found.hits[i].t != expected.hits[i].t;
        EXPECT_EQ(different, 0u);
        const auto closest = trace(one, std::span(rays));
        const auto nearest = many.trace(rays);
        for (std::size_t i = 0; i < rays.size(); ++i)
            ASSERT_EQ(nearest.values[i].geometry, closest[i].geometry);
    }
}

}  // namespace
}  // namespace raydix::mpi::test
