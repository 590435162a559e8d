// Closest points, inside tests, overlaps and pairs in double: against every triangle, against exact
// arithmetic, and against the same scene at the origin where float is exact.
#include <gtest/gtest.h>
#include <raydix/raydix.h>

#include <algorithm>
#include <cmath>
#include <iostream>

#include "primitives/double_sources.h"
#include "primitives/exact_overlap.h"
#include "proximity/closest_on_triangle.h"
#include "proximity/winding_tree.h"
#include "support/double_scenes.h"
#include "support/exact.h"
#include "support/mesh_triangles.h"
#include "support/random.h"
#include "support/sanitized.h"
#include "support/support.h"

namespace raydix::test {
namespace {

constexpr std::uint64_t double_queries_seed = 20051213;
constexpr Builder all_builders[] = {
    Builder::karras, Builder::lauterbach, Builder::garanzha, Builder::apetrei, Builder::ploc,
    Builder::hploc,  Builder::binned,     Builder::sweep,    Builder::split,   Builder::sbvh};

bool same(const ClosestPointD& a, const ClosestPointD& b) {
    return a.prim == b.prim && a.position == b.position && a.distance == b.distance && a.u == b.u &&
           a.v == b.v;
}

ClosestPointD closest_of_all(const MeshD& mesh, Vec3d q) {
    ClosestPointD best;
    double d2 = infinity;
    for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i) {
        const TrianglePointD p = closest_on_triangle(corners(mesh, i), q);
        if (!(p.d2 < d2)) continue;
        d2 = p.d2;
        best = {p.position, std::sqrt(d2), i, p.u, p.v};
    }
    return best;
}

/// Around the box of the mesh, on its corners and edges, and far away.
std::vector<Vec3d> queries_for(const MeshD& mesh, std::size_t count) {
    RandomD random(double_queries_seed);
    AabbD box = box_of_mesh(mesh);
    const Vec3d margin = 0.2 * (box.hi - box.lo);
    box = {box.lo - margin, box.hi + margin};
    std::vector<Vec3d> queries(count);
    for (std::size_t i = 0; i < count; ++i) {
        const LeafTriangleD t = corners(mesh, random.below(mesh.triangles.size()));
        queries[i] = i % 8 == 0   ? t.v0
                     : i % 8 == 1 ? 0.5 * (t.v1 + t.v2)
                     : i % 8 == 2 ? 1000.0 * random.in(box)
                                  : random.in(box);
    }
    return queries;
}

TEST(DoubleQueries, ClosestPointsLikeEveryTriangle) {
    for (const MeshD& mesh :
         {random_soup_d(500, 1), in_double(random_soup(500, 2), 100.0, utm_place),
          in_double(random_soup(500, 3), 1.4e12, {-0.7e12, -0.7e12, -0.7e12}),
          in_double(random_soup(500, 4), 1e-9), slivers_d(500, 12),
          with_stray(slivers_d(500, 12), {}), slivers_d(500, 13, {})}) {
        const std::vector<Vec3d> queries = queries_for(mesh, 300 * thorough);
        std::vector<ClosestPointD> wanted;
        for (const Vec3d& q : queries) wanted.push_back(closest_of_all(mesh, q));
        for (const Builder builder : all_builders)
            for (const int threads : {1, 3}) {
                const BvhD bvh = build_bvh(mesh, {.builder = builder, .threads = threads});
                const auto found = closest_points(bvh, queries, {.threads = threads});
                EXPECT_TRUE(std::ranges::equal(found, wanted, same)) << builder_name(builder);
            }
        const BvhD bvh = build_bvh(mesh);
        EXPECT_TRUE(same(closest_point(bvh, queries[3]), wanted[3]));
        const double reach = wanted[3].distance;
        EXPECT_TRUE(closest_point(bvh, queries[3], reach * 1.0001).found());
        EXPECT_FALSE(closest_point(bvh, queries[3], reach * 0.9999).found());
    }
}

Exact square_to_segment(const ExactPoint& a, const ExactPoint& b, const ExactPoint& q) {
    const ExactPoint along = b - a;
    Exact t = dot(q - a, along) / dot(along, along);
    t = t < 0 ? Exact(0) : t > 1 ? Exact(1) : t;
    const ExactPoint off = q - a;
    const ExactPoint rest{off.x - t * along.x, off.y - t * along.y, off.z - t * along.z};
    return dot(rest, rest);
}

/// Square of the distance, without rounding.
Exact square_to_triangle(const LeafTriangleD& t, Vec3d query) {
    const ExactPoint a = exact(t.v0), b = exact(t.v1), c = exact(t.v2), q = exact(query);
    const ExactPoint normal = cross(b - a, c - a);
    if (dot(cross(b - a, q - a), normal) >= 0 && dot(cross(c - b, q - b), normal) >= 0 &&
        dot(cross(a - c, q - c), normal) >= 0) {
        const Exact height = dot(normal, q - a);
        return height * height / dot(normal, normal);
    }
    return std::min(
        {square_to_segment(a, b, q), square_to_segment(b, c, q), square_to_segment(c, a, q)});
}

TEST(DoubleQueries, ClosestPointsOfSliversAreRight) {
    RandomD random(double_queries_seed);
    double worst = 0;
    for (int i = 0; i < static_cast<int>(60 * thorough); ++i) {
        const Vec3d a = utm_place + 100.0 * random.direction();
        const Vec3d along = 100.0 * random.direction();
        const double thin = std::ldexp(1.0, -static_cast<int>(random.below(45)));
        const LeafTriangleD t{a, a + along, a + 0.4 * along + thin * 50.0 * random.direction()};
        const double off = std::ldexp(1.0, 6 - static_cast<int>(random.below(30)));
        const double u = random.unit() * 0.5, v = random.unit() * 0.5;
        const Vec3d q = t.v0 + u * (t.v1 - t.v0) + v * (t.v2 - t.v0) + off * random.direction();
        const TrianglePointD p = closest_on_triangle(t, q);
        const double wanted = std::sqrt(static_cast<double>(square_to_triangle(t, q)));
        // Steps of doubles are 9e-10 there; positions have three coordinates.
        ASSERT_NEAR(std::sqrt(p.d2), wanted, 4e-9) << "case " << i;
        const Vec3d weighed = (p.u * (t.v1 - t.v0) + p.v * (t.v2 - t.v0)) + (t.v0 - p.position);
        ASSERT_LT(std::sqrt(squared_distance(weighed, {0.0, 0.0, 0.0})), 4e-9) << "case " << i;
        worst = std::max(worst, std::fabs(std::sqrt(p.d2) - wanted));
    }
    std::cout << "distances off by up to " << worst << "\n";
}

/// A closed figure whose corners float holds exactly, at home and in double at a UTM place.
struct Pair {
    Mesh home;
    MeshD away;
};
Pair figure_pair() {
    Pair pair{load_model("builtin:figure?triangles=10000").mesh(), {}};
    for (Vec3& v : pair.home.vertices) {
        const auto snap = [](float x) { return std::round(x * 0x1p18f) * 0x1p-18f; };
        v = {snap(v.x), snap(v.y), snap(v.z)};
    }
    pair.away = in_double(pair.home, 1.0, utm_place);
    return pair;
}

std::vector<Vec3> exact_queries(const Mesh& mesh, std::size_t count) {
    Random random(double_queries_seed);
    const Aabb box = inspect(mesh).bounds;
    std::vector<Vec3> queries(count);
    for (std::size_t i = 0; i < count; ++i) {
        const Triangle& t = mesh.triangles[random.below(mesh.triangles.size())];
        const Vec3 p = i % 4 == 0   ? mesh.vertices[t[0]]
                       : i % 4 == 1 ? 0.5f * (mesh.vertices[t[1]] + mesh.vertices[t[2]])
                                    : random.in(box);
        const auto snap = [](float x) { return std::round(x * 0x1p19f) * 0x1p-19f; };
        queries[i] = {snap(p.x), snap(p.y), snap(p.z)};
    }
    return queries;
}

/// So near a corner that rounding leaves nothing of the weights: no NaN, and the corner.
TEST(DoubleQueries, ACornerOfANeedleHasAPlace) {
    const Vec3d corner{-0x1.9c84p-135, 0.0, 0x1.11a7dap-117};
    const BvhD bvh = build_bvh(MeshD{
        "", {corner, {0x1.7032dap-17, 0.0, 0x1.40d71ep-22}, {-0x1p-147, 0.0, 0.0}}, {{0, 1, 2}}});
    const ClosestPointD found = closest_point(bvh, corner);
    EXPECT_TRUE(found.position == corner);
    EXPECT_EQ(found.distance, 0.0);
    EXPECT_EQ(found.u, 0.0);
    EXPECT_EQ(found.v, 0.0);
}

TEST(DoubleQueries, InsideFarAwayAsAtHome) {
    const auto [home, away] = figure_pair();
    const Bvh home_bvh = build_bvh(home);
    const BvhD away_bvh = build_bvh(away);
    const Solid home_solid(home_bvh);
    const SolidD away_solid(away_bvh);
    EXPECT_EQ(away_solid.closure(), home_solid.closure());
    EXPECT_EQ(away_solid.rule(), home_solid.rule());
    EXPECT_EQ(away_solid.open_edges(), home_solid.open_edges());
    const std::vector<Vec3> queries = exact_queries(home, 5000 * thorough);
    std::vector<Vec3d> moved;
    for (const Vec3& q : queries) moved.push_back(Vec3d{q.x, q.y, q.z} + utm_place);
    std::vector<std::uint8_t> wanted(queries.size()), inside(queries.size());
    contains(home_solid, queries, wanted);
    const QueryCounts counts = contains(away_solid, moved, inside, 3);
    EXPECT_EQ(inside, wanted);
    EXPECT_GT(counts.found, queries.size() / 4);
    EXPECT_LT(counts.found, queries.size());
    const auto distances = signed_distances(away_solid, moved);
    const auto closest = closest_points(away_bvh, moved);
    const auto home_distances = signed_distances(home_solid, queries);
    for (std::size_t i = 0; i < moved.size(); ++i) {
        ASSERT_EQ(std::fabs(distances[i]), closest[i].distance);
        ASSERT_EQ(distances[i] < 0.0, inside[i] != 0 && distances[i] != 0.0) << i;
        ASSERT_NEAR(distances[i], home_distances[i], 1e-5) << i;
    }
    EXPECT_EQ(signed_distance(away_solid, moved[7]), distances[7]);
    EXPECT_EQ(contains(away_solid, moved[7]), inside[7] != 0);
    std::cout << queries.size() << " points, " << counts.found << " inside\n";
}

/// A ball drawn out along a diagonal: where the builder cuts, each triangle still counts once.
TEST(DoubleQueries, SolidsFromTreesOfParts) {
    MeshD mesh = in_double(load_model("builtin:figure?triangles=10000").mesh());
    for (Vec3d& p : mesh.vertices)
        p = Vec3d{p.x + 20 * p.y, p.y + 15 * p.z, p.z + 20 * p.x} + utm_place;
    const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
    const std::vector<Vec3d> queries = queries_for(mesh, 1000 * thorough);
    for (const Vec3d p : {Vec3d{0, 0, 0}, Vec3d{1, 0, 0}, Vec3d{0, 1, 0}, Vec3d{0, 0, 1}})
        mesh.vertices.push_back(utm_place + Vec3d{0.0, 150.0, 0.0} + p);  // a stray tetrahedron
    for (const Triangle t : {Triangle{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}})
        mesh.triangles.push_back({first + t[0], first + t[1], first + t[2]});
    const BvhD whole = build_bvh(mesh, {.builder = Builder::sweep});
    const SolidD plain(whole);
    EXPECT_EQ(plain.closure(), Closure::oriented);
    std::vector<std::uint8_t> wanted(queries.size()), inside(queries.size());
    EXPECT_GT(contains(plain, queries, wanted).found, queries.size() / 20);
    const auto distances = signed_distances(plain, queries);
    for (const Builder builder : {Builder::split, Builder::sbvh}) {
        const BvhD bvh = build_bvh(mesh, {.builder = builder, .max_leaf = 1});
        EXPECT_EQ(bvh.order().size() > mesh.triangles.size(), builder == Builder::sbvh);
        const SolidD solid(bvh), winding(bvh, {.rule = InsideRule::winding});
        EXPECT_EQ(solid.closure(), Closure::oriented);
        EXPECT_EQ(solid.open_edges(), 0u);
        EXPECT_EQ(&solid.bvh(), &bvh);
        contains(solid, queries, inside, 3);
        EXPECT_EQ(inside, wanted) << builder_name(builder);
        EXPECT_EQ(signed_distances(solid, queries), distances) << builder_name(builder);
        const std::vector<double> numbers = winding_numbers(winding, queries);
        for (std::size_t i = 0; i < queries.size(); ++i)
            if (i % 8 > 1) {  // on corners and edges solid angles jump
                ASSERT_NEAR(std::fabs(numbers[i]), wanted[i], 0.01) << i;
            }
    }
}

TEST(DoubleQueries, WindingNumbersOfAnOpenMesh) {
    auto [home, away] = figure_pair();
    away.triangles.resize(away.triangles.size() * 9 / 10);
    const BvhD bvh = build_bvh(away);
    const SolidD solid(bvh);
    EXPECT_EQ(solid.closure(), Closure::open);
    EXPECT_EQ(solid.rule(), InsideRule::winding);
    const std::vector<Vec3d> queries = queries_for(away, 20 * thorough);
    const std::vector<double> numbers = winding_numbers(solid, queries);
    for (std::size_t i = 0; i < queries.size(); ++i) {
        double wanted = 0;
        for (std::size_t k = 0; k < away.triangles.size(); ++k) {
            const LeafTriangleD t = corners(away, k);
            wanted += triangle_winding({Double3(t.v0 - queries[i]), Double3(t.v1 - queries[i]),
                                        Double3(t.v2 - queries[i])},
                                       Double3(0, 0, 0));
        }
        // On corners and edges solid angles jump.
        if (i % 8 > 1) {
            ASSERT_NEAR(numbers[i], wanted, 0.01) << i;
        }
    }
}

/// Farther away than squares of distances go, and nearer to a triangle without area.
TEST(DoubleQueries, WindingNumbersAreNumbersAtAnyDistance) {
    MeshD open;
    open.vertices = {{-1, -1, -1}, {1, -1, -1}, {0, 1, -1}, {0, 0, 1}, {0, 0, 0}};
    open.triangles = {{0, 1, 3}, {1, 2, 3}, {4, 4, 4}};
    const BvhD bvh = build_bvh(open, {.max_leaf = 1});
    const SolidD solid(bvh);
    ASSERT_EQ(solid.rule(), InsideRule::winding);
    std::vector<Vec3d> far, near;
    for (const double away : {1e102, 1e104, 1e153, 1e155, 1e160, 1e300, 1.7e308})
        for (const Vec3d& at :
             {Vec3d{away, 0.5, 0}, Vec3d{-0.5, away, -away}, Vec3d{away, away, -away}})
            far.push_back(at);
    for (const double away : {1e-30, 1e-100, 1e-105, 1e-140, 1e-300, 0.0})
        near.push_back({away, 0, 0});
    for (const double number : winding_numbers(solid, far)) EXPECT_NEAR(number, 0, 1e-100);
    const double wanted = winding_numbers(solid, near)[0];
    for (const double number : winding_numbers(solid, near)) EXPECT_NEAR(number, wanted, 1e-12);
    for (const Vec3d& at : far) EXPECT_FALSE(contains(solid, at));
}

TEST(DoubleQueries, SegmentsAndSpheresLikeEveryTriangle) {
    for (const MeshD& mesh :
         {random_soup_d(400, 5, 0.2), in_double(random_soup(400, 6, 0.2f), 100.0, utm_place),
          in_double(random_soup(400, 7, 0.2f), 1.2e12, {-0.6e12, -0.6e12, -0.6e12}),
          slivers_d(400, 14), with_stray(slivers_d(400, 14), {}), slivers_d(400, 15, {})}) {
        RandomD random(double_queries_seed);
        const AabbD box = box_of_mesh(mesh);
        const double size = box.hi.x - box.lo.x;
        std::vector<SegmentD> segments;
        std::vector<SphereD> spheres;
        for (std::size_t i = 0; i < 100 * thorough; ++i) {
            const LeafTriangleD t = corners(mesh, random.below(mesh.triangles.size()));
            const Vec3d from = random.in(box);
            segments.push_back(i % 4 == 0   ? SegmentD{t.v0, from}  // ends at a corner
                               : i % 4 == 1 ? SegmentD{t.v0, t.v1}
                               : i % 4 == 2 ? SegmentD{from, from + 1e-9 * (t.v0 - from)}
                                            : SegmentD{from, random.in(box)});
            spheres.push_back({from, i % 3 == 0 ? 0.0 : 0.1 * size * random.unit()});
            if (i % 5 == 0) spheres.back().center = t.v2;
        }
        std::vector<std::vector<std::uint32_t>> by_segment(segments.size()),
            by_sphere(spheres.size());
        for (std::size_t i = 0; i < segments.size(); ++i)
            for (std::uint32_t k = 0; k < mesh.triangles.size(); ++k) {
                const LeafTriangleD t = corners(mesh, k);
                const SphereD& s = spheres[i];
                if (segment_touches_triangle(segments[i].a, segments[i].b, t))
                    by_segment[i].push_back(k);
                if (closest_on_triangle(t, s.center).d2 <= s.radius * s.radius)
                    by_sphere[i].push_back(k);
            }
        for (const Builder builder :
             {Builder::karras, Builder::hploc, Builder::sweep, Builder::split, Builder::sbvh})
            for (const int threads : {1, 3}) {
                const BvhD bvh = build_bvh(mesh, {.builder = builder});
                const auto expect_rows = [&](const OverlapLists& lists, const auto& wanted) {
                    for (std::size_t i = 0; i < wanted.size(); ++i)
                        ASSERT_TRUE(std::equal(
                            lists.prims.begin() + static_cast<std::ptrdiff_t>(lists.offsets[i]),
                            lists.prims.begin() + static_cast<std::ptrdiff_t>(lists.offsets[i + 1]),
                            wanted[i].begin(), wanted[i].end()))
                            << builder_name(builder) << ' ' << i;
                };
                const OverlapOptions options{.threads = threads};
                expect_rows(touch_all(bvh, segments, options), by_segment);
                expect_rows(touch_all(bvh, spheres, options), by_sphere);
                std::vector<std::uint8_t> touched(segments.size());
                EXPECT_GT(touch_any(bvh, segments, touched, options).found, segments.size() / 4);
                for (std::size_t i = 0; i < segments.size(); ++i)
                    ASSERT_EQ(touched[i] != 0, !by_segment[i].empty());
                EXPECT_GT(touch_any(bvh, spheres, touched, options).found, 0u);
                EXPECT_EQ(touches(bvh, spheres[1]), touched[1] != 0);
                EXPECT_EQ(touches(bvh, segments[1]), !by_segment[1].empty());
            }
    }
}

std::vector<PrimitivePair> every_pair(const MeshD& a, const MeshD& b, bool within, bool narrow) {
    std::vector<PrimitivePair> pairs;
    for (std::uint32_t i = 0; i < a.triangles.size(); ++i)
        for (std::uint32_t j = within ? i + 1 : 0; j < b.triangles.size(); ++j) {
            const LeafTriangleD s = corners(a, i), t = corners(b, j);
            if (!boxes_touch(box_of(s.v0, s.v1, s.v2), box_of(t.v0, t.v1, t.v2))) continue;
            if (within && share_a_corner(s, t)) continue;
            if (narrow && !triangles_touch(s, t)) continue;
            pairs.push_back({i, j});
        }
    return pairs;
}

void expect_every_pair(const MeshD& a, const MeshD& b) {
    for (const bool narrow : {false, true}) {
        const auto within = every_pair(a, a, true, narrow);
        const auto between = every_pair(a, b, false, narrow);
        EXPECT_GT(within.size(), narrow ? 0 : fewer(100, 10));
        for (const Builder builder :
             {Builder::karras, Builder::ploc, Builder::sweep, Builder::split, Builder::sbvh})
            for (const int threads : {1, 3}) {
                const PairOptions options{.narrow = narrow, .threads = threads};
                const BvhD bvh = build_bvh(a, {.builder = builder});
                const BvhD other = build_bvh(b, {.builder = builder});
                EXPECT_EQ(overlapping_pairs(bvh, options), within) << builder_name(builder);
                EXPECT_EQ(overlapping_pairs(bvh, other, options), between);
                EXPECT_EQ(count_overlapping_pairs(bvh, options), within.size());
                EXPECT_EQ(count_overlapping_pairs(bvh, other, options), between.size());
            }
    }
}

TEST(DoubleQueries, PairsLikeEveryPair) {
    // A metre of detail at 4,500,000: in float most of these boxes are one.
    const MeshD a = in_double(random_soup(600, 8, 0.2f), 1.0, utm_place);
    MeshD b = in_double(random_soup(300, 9, 0.3f), 1.3, utm_place);
    b.vertices.insert(b.vertices.end(), {{-1e6, 0, 0}, {-1e6, 1, 0}, {-1e6, 0, 1}});
    b.triangles.push_back({900, 901, 902});  // so that its center is elsewhere
    expect_every_pair(a, b);
    expect_every_pair(slivers_d(2000, 16), with_stray(slivers_d(400, 17), {}));
}

TEST(DoubleQueries, NeighboursOfOneMeshAreNoPairs) {
    const auto [home, away] = figure_pair();
    EXPECT_EQ(overlapping_pairs(build_bvh(away), {.narrow = true}),
              overlapping_pairs(build_bvh(home), {.narrow = true}));
    EXPECT_EQ(overlapping_pairs(build_bvh(away)), overlapping_pairs(build_bvh(home)));
}

TEST(DoubleQueries, BadInput) {
    const double nan = std::numeric_limits<double>::quiet_NaN(), inf = infinity;
    const MeshD mesh = random_soup_d(50, 10);
    const BvhD bvh = build_bvh(mesh), empty;
    const std::vector<Vec3d> queries{{nan, 0, 0}, {0, inf, 0}, {0.5, 0.5, 0.5}, {1e300, 0, 0}};
    std::vector<ClosestPointD> points(4);
    EXPECT_EQ(closest_points(bvh, queries, points).invalid_queries, 2u);
    EXPECT_FALSE(points[0].found() || points[1].found());
    EXPECT_TRUE(points[2].found() && points[3].found());
    EXPECT_EQ(points[3].distance, inf);  // its square is beyond doubles
    EXPECT_EQ(closest_points(empty, queries, points).found, 0u);
    EXPECT_THROW(closest_points(bvh, queries, std::span(points).first(1)), InputError);
    EXPECT_THROW(closest_points(bvh, queries, points, {.max_distance = nan}), InputError);
    EXPECT_THROW(closest_points(bvh, queries, points, {.max_distance = -1.0}), InputError);
    const SolidD solid(bvh), nothing(empty);
    std::vector<std::uint8_t> flags(4, 7);
    EXPECT_EQ(contains(solid, queries, flags).invalid_queries, 2u);
    EXPECT_EQ(contains(nothing, queries, flags).found, 0u);
    EXPECT_EQ(flags, std::vector<std::uint8_t>(4, 0));
    EXPECT_TRUE(std::isnan(winding_numbers(solid, queries)[0]));
    const std::vector<SegmentD> segments{{{nan, 0, 0}, {1, 1, 1}}, {{0, 0, 0}, {1e13, 0, 0}}};
    const std::vector<SphereD> spheres{{{0, 0, 0}, -1.0}, {{0, 0, 0}, inf}, {{nan, 0, 0}, 1.0}};
    EXPECT_EQ(touch_any(bvh, segments, std::span(flags).first(2)).invalid_queries, 2u);
    EXPECT_EQ(touch_any(bvh, spheres, std::span(flags).first(3)).invalid_queries, 3u);
    EXPECT_TRUE(overlapping_pairs(empty).empty());
    EXPECT_TRUE(overlapping_pairs(bvh, empty).empty());
    EXPECT_THROW(static_cast<void>(overlapping_pairs(bvh, bvh, {.max_result_bytes = 8})),
                 InputError);
}

}  // namespace
}  // namespace raydix::test
