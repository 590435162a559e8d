// End-point overlap against the definition: every triangle clipped to every node.
#include <gtest/gtest.h>
#include <raydix/error.h>

#include <bit>
#include <cmath>
#include <functional>
#include <map>
#include <set>

#include "support/sanitized.h"
#include "support/support.h"
#include "tree/clip.h"
#include "tree/epo.h"

namespace raydix::test {
namespace {

using Point = std::array<double, 3>;

/// One half-space after the other, with distances and nothing clever.
std::vector<Point> naive_clip(std::vector<Point> polygon, const Aabb& box) {
    const Point lo{box.lo.x, box.lo.y, box.lo.z}, hi{box.hi.x, box.hi.y, box.hi.z};
    for (std::size_t side = 0; side < 6; ++side) {
        const std::size_t axis = side / 2;
        const auto outside_by = [&](const Point& p) {
            return side % 2 == 0 ? lo[axis] - p[axis] : p[axis] - hi[axis];
        };
        std::vector<Point> kept;
        for (std::size_t i = 0; i < polygon.size(); ++i) {
            const Point &a = polygon[i], &b = polygon[(i + 1) % polygon.size()];
            const double from = outside_by(a), to = outside_by(b);
            if (from <= 0) kept.push_back(a);
            if ((from < 0 && to > 0) || (from > 0 && to < 0)) {
                const double t = from / (from - to);
                kept.push_back(
                    {a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]), a[2] + t * (b[2] - a[2])});
            }
        }
        polygon = kept;
    }
    return polygon;
}

double naive_area(const std::vector<Point>& polygon) {
    Point sum{};
    for (std::size_t i = 0; i < polygon.size();
         ++i) {  // Newell's formula: all edges about the origin
        const Point &a = polygon[i], &b = polygon[(i + 1) % polygon.size()];
        for (std::size_t k = 0; k < 3; ++k)
            sum[k] += a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3];
    }
    return 0.5 * std::hypot(sum[0], sum[1], sum[2]);
}

std::vector<Point> corners(const LeafTriangle& t) {
    return {{t.v0.x, t.v0.y, t.v0.z}, {t.v1.x, t.v1.y, t.v1.z}, {t.v2.x, t.v2.y, t.v2.z}};
}

/// A triangle may be in several leaves: it is outside of a node that holds none of them.
double naive_epo(const Bvh& bvh, const SahConstants& cost) {
    double overlap = 0, total = 0;
    std::map<std::uint32_t, LeafTriangle> triangles;
    for (std::size_t p = 0; p < bvh.triangles().size(); ++p)
        triangles[bvh.order()[p]] = bvh.triangles()[p];
    for (const auto& [prim, t] : triangles) total += naive_area(corners(t));
    // Returns the end of the positions below the node.
    const std::function<std::size_t(std::uint32_t, std::size_t)> visit = [&](std::uint32_t i,
                                                                             std::size_t begin) {
        const BvhNode& node = bvh.nodes()[i];
        const std::size_t end =
            node.is_leaf() ? begin + node.count : visit(node.first + 1, visit(node.first, begin));
        const double weight = node.is_leaf() ? cost.primitive * node.count : cost.node;
        const std::set<std::uint32_t> inside(bvh.order().begin() + std::ptrdiff_t(begin),
                                             bvh.order().begin() + std::ptrdiff_t(end));
        for (const auto& [prim, t] : triangles)
            if (!inside.contains(prim))
                overlap += weight * naive_area(naive_clip(corners(t), {node.lo, node.hi}));
        return end;
    };
    visit(0, 0);
    return overlap / total;
}

TEST(Clip, PartsOfATriangle) {
    const Polygon triangle = polygon_of({0, 0, 0}, {4, 0, 0}, {0, 4, 0});
    EXPECT_DOUBLE_EQ(triangle.area(), 8);
    EXPECT_DOUBLE_EQ(clip(triangle, {{-1, -1, -1}, {9, 9, 9}}).area(), 8);
    EXPECT_DOUBLE_EQ(clip(triangle, {{0, 0, 0}, {1, 1, 0}}).area(), 1)
        << "in the face of a flat box";
    EXPECT_DOUBLE_EQ(clip(triangle, {{0, 0, 0}, {2, 9, 1}}).area(), 6);
    EXPECT_DOUBLE_EQ(clip(triangle, {{1, 1, -1}, {3, 3, 1}}).area(), 2);
    EXPECT_EQ(clip(triangle, {{0, 0, 1}, {4, 4, 2}}).count, 0u);
    EXPECT_EQ(clip(triangle, {{3, 3, -1}, {4, 4, 1}}).count, 0u)
        << "in the box of the triangle, not in it";
}

TEST(Clip, SixPlanesThroughOneTriangle) {
    const Polygon triangle =
        polygon_of({-3, -3, 6}, {6, -3, -3}, {-3, 6, -3});  // in the plane x + y + z = 0
    const Polygon hexagon = clip(triangle, {{-1, -1, -1}, {1, 1, 1}});
    EXPECT_EQ(hexagon.count, 6u);
    EXPECT_NEAR(hexagon.area(), 6 * std::sqrt(3.0) / 4 * 2, 1e-12);
}

/// A thousand triangles; fewer where every step is slow, for the naive way is quadratic.
TEST(EndPointOverlap, EqualsNaiveClippingOnAThousandTriangles) {
    const std::size_t count = thorough == 1 ? fewer(300, 2) : 1000;
    for (const int max_leaf : {1, 4}) {
        for (const float size : {0.05f, 0.5f}) {
            const Bvh bvh = build_bvh(random_soup(count, 12, size), {.max_leaf = max_leaf});
            for (const SahConstants& cost : {SahConstants{}, SahConstants{2.5, 0.25}}) {
                const double expected = naive_epo(bvh, cost);
                EXPECT_GT(expected, sanitized ? 0.02 : 0.1);
                EXPECT_NEAR(*end_point_overlap(bvh, cost, 1.0), expected, 1e-10 * expected);
            }
        }
    }
}

TEST(EndPointOverlap, OfTreesWithPartsOfTrianglesCountsEachOnce) {
    Mesh mesh = random_soup(fewer(200, 2), 12, 0.5f);
    for (std::size_t k = 0; k < mesh.vertices.size(); k += 30) mesh.vertices[k].x += 9;  // slivers
    const Bvh bvh = build_bvh(mesh, {.builder = Builder::sbvh, .max_leaf = 1});
    ASSERT_GT(bvh.triangles().size(), mesh.triangles.size());
    const double expected = naive_epo(bvh, {});
    EXPECT_NEAR(*end_point_overlap(bvh, {}, 1.0), expected, 1e-10 * expected);
}

TEST(EndPointOverlap, FlatGridTouchesOnlyAtEdges) {
    Mesh mesh;  // 16 x 16 squares in a plane, two triangles each: boxes of squares meet in lines
    for (int y = 0; y <= 16; ++y)
        for (int x = 0; x <= 16; ++x)
            mesh.vertices.push_back({static_cast<float>(x), static_cast<float>(y), 3});
    for (std::uint32_t y = 0; y < 16; ++y)
        for (std::uint32_t x = 0; x < 16; ++x) {
            const std::uint32_t v = y * 17 + x;
            mesh.triangles.push_back({v, v + 1, v + 18});
            mesh.triangles.push_back({v, v + 18, v + 17});
        }
    EXPECT_NEAR(*end_point_overlap(build_bvh(mesh, {.max_leaf = 2}), {}, 1.0), 0, 1e-12);
    // Two triangles share each square's box. A leaf of one then holds the other's area: 1 on each
    // side.
    EXPECT_NEAR(*end_point_overlap(build_bvh(mesh, {.max_leaf = 1}), {}, 1.0), 1, 1e-12);
}

TEST(EndPointOverlap, SameForEveryThreadCountAndCloseWhenSampled) {
    const Bvh bvh = build_bvh(random_soup(4000, 13));
    const double full = *tree_stats(bvh, {.with_epo = true, .threads = 1}).epo;
    for (const int threads : {2, 7}) {
        const double again = *tree_stats(bvh, {.with_epo = true, .threads = threads}).epo;
        EXPECT_EQ(std::bit_cast<std::uint64_t>(again), std::bit_cast<std::uint64_t>(full));
    }
    const double sampled = *tree_stats(bvh, {.with_epo = true, .epo_sample = 0.25}).epo;
    EXPECT_NE(sampled, full);
    EXPECT_NEAR(sampled, full, 0.1 * full);
    EXPECT_TRUE(tree_stats(bvh, {.with_epo = true, .epo_sample = 1e-9}).epo)
        << "one triangle at least";
}

TEST(EndPointOverlap, NoneWithoutArea) {
    EXPECT_FALSE(end_point_overlap(build_bvh(Mesh{}), {}, 1.0));
    EXPECT_FALSE(end_point_overlap(build_bvh(std::vector<Vec3>{{0, 0, 0}, {1, 1, 1}}), {}, 1.0));
    EXPECT_FALSE(
        end_point_overlap(build_bvh(Mesh{"line", {{0, 0, 0}, {1, 1, 1}}, {{0, 1, 1}}}), {}, 1.0));
    EXPECT_EQ(*end_point_overlap(build_bvh(random_soup(1, 1)), {}, 1.0), 0.0);
}

TEST(EndPointOverlap, SampleOutOfRange) {
    const Bvh bvh = build_bvh(random_soup(10, 1));
    for (const double sample : {0.0, -1.0, 1.5, std::nan("")})
        EXPECT_THROW(static_cast<void>(end_point_overlap(bvh, {}, sample)), InputError);
}

}  // namespace
}  // namespace raydix::test
