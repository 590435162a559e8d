// closest_points against a look at every triangle (bit for bit), and against another algorithm in
// higher precision (within rounding).
#include <gtest/gtest.h>
#include <raydix/closest.h>
#include <raydix/error.h>
#include <raydix/model.h>

#include <cmath>
#include <iostream>
#include <limits>

#include "base/same_bits.h"
#include "primitives/zero_area.h"
#include "proximity/closest_on_triangle.h"
#include "support/mesh_triangles.h"
#include "support/message.h"
#include "support/random.h"
#include "support/region_distance.h"
#include "support/sanitized.h"
#include "support/scenes.h"
#include "support/support.h"

namespace raydix {
namespace {

constexpr std::uint64_t closest_seed = 20051019;
constexpr float closest_nan = std::numeric_limits<float>::quiet_NaN();

using test::corners, test::Random;

bool same(const ClosestPoint& a, const ClosestPoint& b) {
    return a.prim == b.prim && same_bits(a.distance, b.distance) && same_bits(a.u, b.u) &&
           same_bits(a.v, b.v) && same_bits(a.position.x, b.position.x) &&
           same_bits(a.position.y, b.position.y) && same_bits(a.position.z, b.position.z);
}

ClosestPoint look_at_all(const Mesh& mesh, Vec3 q, float max_distance = infinity) {
    ClosestPoint best;
    float d2 = max_distance * max_distance;
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
        const LeafTriangle t = corners(mesh, i);
        if (!in_range(t.v0) || !in_range(t.v1) || !in_range(t.v2)) continue;
        const TrianglePoint p = closest_on_triangle(t, q);
        if (!(p.d2 < d2 || (p.d2 == d2 && !best.found()))) continue;
        d2 = p.d2;
        best = {p.position, std::sqrt(p.d2), static_cast<std::uint32_t>(i), p.u, p.v};
    }
    return best;
}

/// Around the mesh, near its surface, at its corners and far away.
std::vector<Vec3> queries_around(const Mesh& mesh, std::size_t count, std::uint64_t start) {
    Random random(start);
    const Aabb box = inspect(mesh).bounds;
    const Vec3 size = box.hi - box.lo;
    const float extent = std::max({size.x, size.y, size.z});
    std::vector<Vec3> queries;
    const auto offset = [&](float by) {
        return Vec3{random.between(-by, by), random.between(-by, by), random.between(-by, by)};
    };
    while (queries.size() < count) {
        const Vec3 anywhere{random.between(box.lo.x, box.hi.x), random.between(box.lo.y, box.hi.y),
                            random.between(box.lo.z, box.hi.z)};
        const Vec3 corner = mesh.vertices[random.below(mesh.vertices.size())];
        queries.push_back(anywhere);
        queries.push_back(corner);
        queries.push_back(corner + offset(0.01f * extent));
        queries.push_back(anywhere + offset(100.0f * extent));
    }
    return queries;
}

Mesh slivers_and_giants(std::uint64_t start) {
    Random random(start);
    Mesh mesh;
    const auto add = [&](Vec3 a, Vec3 b, Vec3 c) {
        const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
        mesh.vertices.insert(mesh.vertices.end(), {a, b, c});
        mesh.triangles.push_back({first, first + 1, first + 2});
    };
    const auto point = [&](float by) {
        return Vec3{random.between(-by, by), random.between(-by, by), random.between(-by, by)};
    };
    for (int i = 0; i < 100; ++i) {
        const Vec3 a = point(1), b = point(1), p = point(1);
        add(a, b, 0.5f * (a + b));                 // collinear up to rounding
        add(a, b, 0.5f * (a + b) + point(1e-6f));  // a needle
        add(a, a + point(1e-6f), b);               // a blade
        add(a, b, b);                              // a segment
        add(p, p, p);                              // a point
        add(point(1), point(1), point(1));
    }
    for (int i = 0; i < 5; ++i) add(point(1e6f), point(1e6f), point(1e6f));
    return mesh;
}

void expect_same(const std::string& name, const Mesh& mesh, const std::vector<Vec3>& queries) {
    std::vector<ClosestPoint> expected;
    for (const Vec3 q : queries) expected.push_back(look_at_all(mesh, q));
    for (const char* builder : {"karras", "apetrei", "ploc", "binned", "sweep", "split", "sbvh"}) {
        const Bvh bvh = build_bvh(mesh, {.builder = builder_from_name(builder)});
        for (const int threads : {1, 2, 7}) {
            const auto found = closest_points(bvh, queries, {.threads = threads});
            std::size_t wrong = 0;
            for (std::size_t i = 0; i < queries.size(); ++i) wrong += !same(found[i], expected[i]);
            EXPECT_EQ(wrong, 0u) << name << ", " << builder << ", " << threads << " threads, seed "
                                 << closest_seed;
        }
    }
}

TEST(Closest, IsBruteForceBitForBit) {
    for (const Model& scene : test::builtin_triangle_scenes(test::fewer(1000, 4)))
        expect_same(
            scene.name, scene.mesh(),
            queries_around(scene.mesh(), test::fewer(150 * test::thorough, 3), closest_seed));
    expect_same("soup", test::random_soup(1000, closest_seed),
                queries_around(test::random_soup(1000, closest_seed),
                               test::fewer(150 * test::thorough, 3), closest_seed));
    const Mesh odd = slivers_and_giants(closest_seed);
    expect_same("slivers and giants", odd,
                queries_around(odd, test::fewer(100 * test::thorough, 2), closest_seed));
    const Mesh lattice = test::lattice_mesh(500, 4, closest_seed);
    expect_same("lattice", lattice,
                queries_around(lattice, test::fewer(100 * test::thorough, 2), closest_seed));
    const Mesh far = test::moved(test::random_soup(500, closest_seed), {1e5f, 1e5f, -1e5f});
    expect_same("far away", far,
                queries_around(far, test::fewer(100 * test::thorough, 2), closest_seed));
}

TEST(Closest, DistancesAreRightToTheRoundingOfCoordinates) {
    std::size_t compared = 0;
    for (const Mesh& mesh :
         {test::random_soup(50, closest_seed), slivers_and_giants(closest_seed + 1),
          test::lattice_mesh(50, 3, closest_seed),
          test::moved(test::random_soup(50, closest_seed), {1e5f, 0, 1e5f})}) {
        for (const Vec3 q : queries_around(mesh, 200 * test::thorough, closest_seed)) {
            const std::size_t i = (compared * 2654435761u) % mesh.triangles.size();
            const LeafTriangle t = corners(mesh, i);
            const TrianglePoint p = closest_on_triangle(t, q);
            if (has_zero_area(t)) continue;  // the judge divides by it
            const auto exact = static_cast<double>(test::region_distance(t, q));
            const double size =
                std::max({std::fabs(double(p.position.x)), std::fabs(double(p.position.y)),
                          std::fabs(double(p.position.z)), exact});
            const double off = std::fabs(std::sqrt(double(p.d2)) - exact);
            EXPECT_LE(off, 3e-7 * size)
                << "triangle " << i << " query " << q.x << ' ' << q.y << ' ' << q.z;
            // The weights give the point back.
            const double w = 1.0 - double(p.u) - p.v;
            const double x = w * t.v0.x + double(p.u) * t.v1.x + double(p.v) * t.v2.x;
            const double reach = std::max(
                {std::fabs(double(t.v0.x)), std::fabs(double(t.v1.x)), std::fabs(double(t.v2.x))});
            EXPECT_NEAR(x, p.position.x, 3e-7 * reach);
            ++compared;
        }
    }
    std::cout << compared << " distances compared\n";
    EXPECT_GT(compared, 300u);
}

TEST(Closest, PositionsRepeatTheDistance) {
    const Mesh mesh = test::random_soup(500, closest_seed);
    const Bvh bvh = build_bvh(mesh);
    const std::vector<Vec3> queries = queries_around(mesh, 2000, closest_seed);
    const auto found = closest_points(bvh, queries);
    for (std::size_t i = 0; i < queries.size(); ++i) {
        ASSERT_TRUE(found[i].found());
        const Vec3 d = found[i].position - queries[i];
        EXPECT_TRUE(same_bits(found[i].distance, std::sqrt((d.x * d.x + d.y * d.y) + d.z * d.z)));
        EXPECT_TRUE(same(closest_point(bvh, queries[i]), found[i]));
    }
}

TEST(Closest, TiesGoToTheLowerId) {
    // A fan around one corner, and the query above the corner: all six are equally far.
    Mesh mesh;
    mesh.vertices.push_back({0.1f, 0.2f, 0.3f});
    for (int k = 0; k < 6; ++k)
        mesh.vertices.push_back({0.1f + std::cos(float(k)), 0.2f + std::sin(float(k)), -1.0f});
    for (std::uint32_t k = 0; k < 6; ++k) mesh.triangles.push_back({0, 1 + k, 1 + (k + 1) % 6});
    const ClosestPoint found = closest_point(build_bvh(mesh), {0.1f, 0.2f, 1.0f});
    EXPECT_EQ(found.prim, 0u);
    EXPECT_EQ(found.position.z, 0.3f);
    // On an edge that two share, whichever way each has it.
    const Mesh two{
        "", {{0, 0, 0}, {1, 0.3f, 0}, {0.2f, 1, -1}, {0.7f, -1, -1}}, {{1, 0, 3}, {0, 1, 2}}};
    const Bvh bvh = build_bvh(two);
    Random random(closest_seed);
    int on_the_edge = 0;
    for (int i = 0; i < 1000; ++i) {
        const float s = random.unit();
        const Vec3 q{s, 0.3f * s, random.between(0.5f, 1.0f)};
        const ClosestPoint p = closest_point(bvh, q);
        on_the_edge += p.v == 0.0f;
        EXPECT_EQ(p.prim, 0u);
    }
    EXPECT_GT(on_the_edge, 900);
}

TEST(Closest, MaxDistanceIsClosed) {
    const Mesh mesh{"", {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}};
    const Bvh bvh = build_bvh(mesh);
    const std::vector<Vec3> queries{{0.25f, 0.25f, 2}, {0.25f, 0.25f, 0}};
    EXPECT_TRUE(closest_point(bvh, queries[0], 2.0f).found());
    EXPECT_FALSE(closest_point(bvh, queries[0], 1.999f).found());
    EXPECT_TRUE(closest_point(bvh, queries[1], 0.0f).found());
    EXPECT_FALSE(closest_point(bvh, queries[0], 0.0f).found());
    std::vector<ClosestPoint> results(2);
    const QueryCounts counts = closest_points(bvh, queries, results, {.max_distance = 1.0f});
    EXPECT_EQ(counts.queries, 2u);
    EXPECT_EQ(counts.found, 1u);
    EXPECT_EQ(results[0].distance, infinity);
    for (const float bad : {-1.0f, closest_nan})
        EXPECT_THROW(static_cast<void>(closest_point(bvh, queries[0], bad)), InputError);

    const Mesh soup = test::random_soup(400, closest_seed);
    const Bvh tree = build_bvh(soup);
    for (const Vec3 q : queries_around(soup, 400, closest_seed))
        EXPECT_TRUE(same(closest_point(tree, q, 0.05f), look_at_all(soup, q, 0.05f)));
}

TEST(Closest, OddInput) {
    const Bvh none;
    EXPECT_FALSE(closest_point(none, {0, 0, 0}).found());
    Mesh mesh{"", {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {closest_nan, 0, 0}}, {{0, 1, 3}, {0, 1, 2}}};
    const Bvh bvh = build_bvh(mesh);
    const std::vector<Vec3> queries{
        {closest_nan, 0, 0}, {0, infinity, 0}, {0, 0, -infinity}, {0, 0, 1}, {0, 0, 1e30f}};
    std::vector<ClosestPoint> results(queries.size());
    const QueryCounts counts = closest_points(bvh, queries, results);
    EXPECT_EQ(counts.invalid_queries, 3u);
    EXPECT_EQ(counts.found, 2u);
    for (int i = 0; i < 3; ++i) {
        EXPECT_EQ(results[i].prim, no_primitive);
        EXPECT_EQ(results[i].distance, infinity);
    }
    EXPECT_EQ(results[3].prim, 1u) << "the broken triangle is left out";
    EXPECT_EQ(results[4].prim, 1u) << "the square overflows, but the point is there";
    EXPECT_EQ(results[4].distance, infinity);
    EXPECT_THROW(closest_points(bvh, queries, std::span(results).first(2)), InputError);
    const Bvh points = build_bvh(std::span<const Vec3>(mesh.vertices).first(3));
    EXPECT_THROW(static_cast<void>(closest_point(points, {0, 0, 0})), InputError);
    EXPECT_EQ(test::message_of([&] { (void)closest_points(bvh, queries, {-1e-9f}); }),
              "closest points: max_distance is -1e-09; it must be 0 or more");
    // Thousands of equal points as triangles: the lowest id.
    Mesh equal;
    equal.vertices.push_back({1, 2, 3});
    equal.triangles.assign(5000, {0, 0, 0});
    EXPECT_EQ(closest_point(build_bvh(equal), {4, 5, 6}).prim, 0u);
    EXPECT_EQ(closest_point(build_bvh(equal), {1, 2, 3}).distance, 0.0f);
}

}  // namespace
}  // namespace raydix
