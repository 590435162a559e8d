// Inside and outside: against winding numbers summed in double over all triangles, against what is
// known of boxes, and against the same question asked along other axes.
#include <gtest/gtest.h>
#include <raydix/error.h>
#include <raydix/model.h>
#include <raydix/solid.h>

#include <bit>
#include <cmath>
#include <iostream>
#include <limits>
#include <numbers>

#include "proximity/winding_tree.h"
#include "support/random.h"
#include "support/scenes.h"
#include "support/support.h"

namespace raydix {
namespace {

constexpr std::uint64_t solid_seed = 20050501;
constexpr float solid_nan = std::numeric_limits<float>::quiet_NaN();

using test::Random;

/// Over all triangles, in double; no tree.
double exact_winding(const Mesh& mesh, Vec3 q) {
    double sum = 0;
    for (const Triangle& t : mesh.triangles)
        sum += triangle_winding({mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]]}, q);
    return sum;
}

/// A cone over a star, with a needle for a tip: every edge is sharp, every other one is a valley.
Mesh spiky_cone() {
    constexpr std::uint32_t corners = 22;
    Mesh mesh;
    mesh.vertices = {{0.03f, -0.02f, 3.1f}, {0.0f, 0.0f, 0.1f}};
    for (std::uint32_t k = 0; k < corners; ++k) {
        const float angle = 2 * std::numbers::pi_v<float> * float(k) / corners;
        const float radius = k % 2 ? 0.35f : 1.0f;
        mesh.vertices.push_back({radius * std::cos(angle), radius * std::sin(angle), 0.0f});
    }
    for (std::uint32_t k = 0; k < corners; ++k) {
        const std::uint32_t a = 2 + k, b = 2 + (k + 1) % corners;
        mesh.triangles.push_back({0, a, b});
        mesh.triangles.push_back({1, b, a});
    }
    return mesh;
}

Mesh box_mesh(Vec3 lo, Vec3 hi) {
    Mesh mesh;
    for (int k = 0; k < 8; ++k)
        mesh.vertices.push_back({k & 1 ? hi.x : lo.x, k & 2 ? hi.y : lo.y, k & 4 ? hi.z : lo.z});
    mesh.triangles = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                      {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
    return mesh;
}

Mesh joined(Mesh a, const Mesh& b) {
    const auto first = static_cast<std::uint32_t>(a.vertices.size());
    a.vertices.insert(a.vertices.end(), b.vertices.begin(), b.vertices.end());
    for (const Triangle& t : b.triangles)
        a.triangles.push_back({first + t[0], first + t[1], first + t[2]});
    return a;
}

Mesh turned_over(Mesh mesh) {
    for (Triangle& t : mesh.triangles) std::swap(t[1], t[2]);
    return mesh;
}

/// Corners by themselves: nothing is shared but places.
Mesh loose(const Mesh& mesh) {
    Mesh out;
    for (const Triangle& t : mesh.triangles) {
        const auto first = static_cast<std::uint32_t>(out.vertices.size());
        for (const std::uint32_t v : t) out.vertices.push_back(mesh.vertices[v]);
        out.triangles.push_back({first, first + 1, first + 2});
    }
    return out;
}

Vec3 turned_axes(Vec3 p) { return {p.y, p.z, p.x}; }
Mesh turned_axes(Mesh mesh) {
    for (Vec3& p : mesh.vertices) p = turned_axes(p);
    return mesh;
}

std::vector<std::uint8_t> inside_of(const Mesh& mesh, const std::vector<Vec3>& queries) {
    const Bvh bvh = build_bvh(mesh);
    std::vector<std::uint8_t> inside(queries.size());
    contains(Solid(bvh), queries, inside);
    return inside;
}

/// Places beside edges and vertices, from very near to far, whose closest feature is one.
std::vector<Vec3> points_at_sharp_features(const Mesh& mesh, const Bvh& bvh, std::size_t count) {
    Random random(solid_seed);
    std::vector<Vec3> points;
    while (points.size() < count) {
        const Triangle& t = mesh.triangles[random.below(mesh.triangles.size())];
        const float s = random.below(2) ? 0.0f : random.unit();
        const Vec3 at = (1 - s) * mesh.vertices[t[0]] + s * mesh.vertices[t[random.below(2) + 1]];
        const float scale = std::pow(10.0f, random.between(-5.0f, 0.0f));
        const Vec3 p = at + scale * random.in({{-1, -1, -1}, {1, 1, 1}});
        const ClosestPoint c = closest_point(bvh, p);
        if ((c.u == 0 || c.v == 0 || c.u + c.v == 1) && c.distance > 1e-7f) points.push_back(p);
    }
    return points;
}

TEST(Solid, SignsAreRightAtTheSharpEdgesOfASpikyCone) {
    const Mesh mesh = spiky_cone();
    for (const char* builder : {"karras", "sbvh", "split", "binned"}) {
        const Bvh bvh = build_bvh(mesh, {.builder = builder_from_name(builder), .max_leaf = 2});
        const Solid solid(bvh);
        ASSERT_EQ(solid.closure(), Closure::oriented);
        const std::vector<Vec3> points =
            points_at_sharp_features(mesh, bvh, 100000 * test::thorough / 20);
        const std::vector<float> distances = signed_distances(solid, points);
        std::size_t wrong = 0, inside = 0;
        for (std::size_t i = 0; i < points.size(); ++i) {
            const bool is_inside = exact_winding(mesh, points[i]) > 0.5;
            inside += is_inside;
            wrong += (distances[i] < 0) != is_inside;
        }
        std::cout << builder << ": " << points.size() << " points beside edges and vertices, "
                  << inside << " inside, " << wrong << " wrong, seed " << solid_seed << '\n';
        EXPECT_EQ(wrong, 0u);
        EXPECT_GT(inside, points.size() / 100);
    }
}

TEST(Solid, AFigureFarAwayAgreesWithItselfAlongOtherAxes) {
    Mesh mesh = load_model("builtin:figure?triangles=20000").mesh();
    for (Vec3& p : mesh.vertices) p = 37.5f * p + Vec3{1e5f, -1e5f, 1e5f};
    // Rounding may have closed faces to lines or folded them: the surface is still closed.
    const Bvh bvh = build_bvh(mesh);
    ASSERT_EQ(Solid(bvh).closure(), Closure::oriented);
    Random random(solid_seed);
    std::vector<Vec3> points(1000000 * test::thorough / 20), other;
    for (Vec3& p : points) {  // one half on the lattice of floats right at the surface
        p = random.in(bvh.bounds());
        if (random.below(2)) continue;
        const Vec3 near = mesh.vertices[random.below(mesh.vertices.size())];
        p = near + random.in({{-0.05f, -0.05f, -0.05f}, {0.05f, 0.05f, 0.05f}});
    }
    const std::vector<std::uint8_t> along_x = inside_of(mesh, points);
    std::size_t inside = 0, differ = 0, wrong = 0, judged = 0;
    const auto compare_turned = [&](Mesh& turned) {
        turned = turned_axes(std::move(turned));
        for (Vec3& p : points) p = turned_axes(p);
        const std::vector<std::uint8_t> along = inside_of(turned, points);
        for (std::size_t i = 0; i < points.size(); ++i) differ += along[i] != along_x[i];
    };
    for (std::size_t i = 0; i < points.size(); ++i) {
        inside += along_x[i];
        if (i % 5000 != 0) continue;
        const double winding = exact_winding(mesh, points[i]);
        if (std::fabs(winding - std::round(winding)) > 0.01) continue;  // on the surface
        ++judged;
        wrong += (std::round(winding) != 0) != (along_x[i] != 0);
    }
    Mesh turned = mesh;
    compare_turned(turned);
    compare_turned(turned);
    std::cout << points.size() << " points, " << inside << " inside, " << differ
              << " differ along y or z; " << judged << " winding numbers, " << wrong
              << " wrong, seed " << solid_seed << '\n';
    EXPECT_EQ(differ, 0u);
    EXPECT_EQ(wrong, 0u);
    EXPECT_GT(inside, points.size() / 20);
    EXPECT_GT(judged, 5u);
}

/// Sheets of 30 x 30 squares of two triangles, one over the other within a thousandth.
Mesh layers(std::uint32_t count) {
    constexpr std::uint32_t side = 31;
    Mesh mesh;
    for (std::uint32_t layer = 0; layer < count; ++layer)
        for (std::uint32_t i = 0; i < side * side; ++i) {
            const auto at = static_cast<std::uint32_t>(mesh.vertices.size());
            mesh.vertices.push_back({float(i % side) / (side - 1), float(i / side) / (side - 1),
                                     0.5f + 0.001f * float(layer) / float(count)});
            if (i % side == side - 1 || i / side == side - 1) continue;
            mesh.triangles.push_back({at, at + 1, at + side + 1});
            mesh.triangles.push_back({at, at + side + 1, at + side});
        }
    return mesh;
}

/// What the two terms leave out grows with the area that is seen: a hundredth bounds one sheet.
TEST(Solid, LayersAddUpTheirErrorsOfWindingNumbers) {
    for (const std::uint32_t count : {1u, 40u}) {
        const Mesh mesh = layers(count);
        const Bvh bvh = build_bvh(mesh);
        const Solid solid(bvh);
        ASSERT_EQ(solid.rule(), InsideRule::winding);
        Random random(solid_seed);
        std::vector<Vec3> points(300);
        for (Vec3& p : points) p = random.in({{0, 0, -1}, {1, 1, 2}});
        const std::vector<double> numbers = winding_numbers(solid, points);
        double worst = 0;
        for (std::size_t i = 0; i < points.size(); ++i)
            worst = std::max(worst, std::fabs(numbers[i] - exact_winding(mesh, points[i])));
        std::cout << count << " layers: error " << worst << ", seed " << solid_seed << '\n';
        EXPECT_LT(worst, 0.01 * count);
    }
}

TEST(Solid, BoxesHoldTheirSurface) {
    const Mesh mesh = joined(box_mesh({0, 0, 0}, {4, 4, 4}), box_mesh({6, 1, 1}, {9, 3, 3}));
    std::vector<Vec3> points;
    for (int x = -2; x <= 20; ++x)
        for (int y = -2; y <= 10; ++y)
            for (int z = -2; z <= 10; ++z)
                points.push_back({0.5f * float(x), 0.5f * float(y), 0.5f * float(z)});
    const auto in = [](Vec3 p, Vec3 lo, Vec3 hi) {
        return p.x >= lo.x && p.x <= hi.x && p.y >= lo.y && p.y <= hi.y && p.z >= lo.z &&
               p.z <= hi.z;
    };
    for (const Mesh& m : {mesh, loose(mesh), turned_over(mesh)}) {
        const std::vector<std::uint8_t> inside = inside_of(m, points);
        for (std::size_t i = 0; i < points.size(); ++i) {
            const Vec3 p = points[i];
            EXPECT_EQ(inside[i] != 0, in(p, {0, 0, 0}, {4, 4, 4}) || in(p, {6, 1, 1}, {9, 3, 3}))
                << p.x << ' ' << p.y << ' ' << p.z;
        }
    }
    const Bvh bvh = build_bvh(mesh);
    const Solid solid(bvh);
    EXPECT_EQ(signed_distance(solid, {2, 2, 2}), -2.0f);
    EXPECT_EQ(signed_distance(solid, {5, 2, 2}), 1.0f);
    EXPECT_EQ(signed_distance(solid, {4, 4, 4}), 0.0f);
    EXPECT_EQ(signed_distance(solid, {4, 4, 5}), 1.0f);
}

TEST(Solid, WindingNumbersCount) {
    const Mesh hollow =
        joined(box_mesh({0, 0, 0}, {9, 9, 9}), turned_over(box_mesh({3, 3, 3}, {6, 6, 6})));
    const Mesh twice = joined(box_mesh({0, 0, 0}, {9, 9, 9}), box_mesh({3, 3, 3}, {6, 6, 6}));
    const std::vector<Vec3> points{{4, 5, 5}, {1, 1, 1}, {10, 1, 1}};
    const Bvh a = build_bvh(hollow), b = build_bvh(twice);
    EXPECT_EQ(winding_numbers(Solid(a), points), (std::vector<double>{0, 1, 0}));
    EXPECT_EQ(winding_numbers(Solid(b), points), (std::vector<double>{2, 1, 0}));
    EXPECT_EQ(winding_numbers(Solid(b, {.rule = InsideRule::parity}), points),
              (std::vector<double>{0, 1, 0}));
    EXPECT_TRUE(contains(Solid(b), points[0]));
    EXPECT_FALSE(contains(Solid(a), points[0]));
}

TEST(Solid, NeighboursThatTurnAgainstEachOtherAreCountedByParity) {
    Mesh mesh = spiky_cone();
    for (std::size_t i = 0; i < mesh.triangles.size(); i += 3)
        std::swap(mesh.triangles[i][0], mesh.triangles[i][1]);
    const Bvh bvh = build_bvh(mesh);
    const Solid solid(bvh);
    EXPECT_EQ(solid.closure(), Closure::closed);
    EXPECT_EQ(solid.rule(), InsideRule::parity);
    EXPECT_EQ(solid.open_edges(), 0u);
    Random random(solid_seed);
    const Mesh good = spiky_cone();
    for (int i = 0; i < 2000; ++i) {
        const Vec3 p = random.in(bvh.bounds());
        EXPECT_EQ(contains(solid, p), exact_winding(good, p) > 0.5);
    }
}

TEST(Solid, MeshesWithHolesGoByTheGeneralizedWindingNumber) {
    Mesh mesh = load_model("builtin:figure?triangles=20000").mesh();
    Random random(solid_seed);
    for (int hole = 0; hole < 40; ++hole)
        mesh.triangles.erase(mesh.triangles.begin() +
                             static_cast<std::ptrdiff_t>(random.below(mesh.triangles.size())));
    const Bvh bvh = build_bvh(mesh), split = build_bvh(mesh, {.builder = Builder::sbvh});
    const Solid solid(bvh), of_split(split);
    EXPECT_EQ(solid.closure(), Closure::open);
    EXPECT_EQ(solid.rule(), InsideRule::winding);
    EXPECT_EQ(solid.open_edges(), of_split.open_edges());
    EXPECT_GT(solid.open_edges(), 40u);
    std::vector<Vec3> points(30 * test::thorough);
    for (Vec3& p : points) p = random.in(bvh.bounds());
    const auto numbers = winding_numbers(solid, points), again = winding_numbers(of_split, points);
    double worst = 0;
    std::size_t inside = 0;
    for (std::size_t i = 0; i < points.size(); ++i) {
        const double exact = exact_winding(mesh, points[i]);
        worst = std::max({worst, std::fabs(numbers[i] - exact), std::fabs(again[i] - exact)});
        inside += exact > 0.5;
        EXPECT_EQ(contains(solid, points[i]), numbers[i] >= 0.5);
    }
    std::cout << points.size() << " winding numbers, " << inside << " above 1/2, off by at most "
              << worst << '\n';
    EXPECT_LT(worst, 0.01);
}

TEST(Solid, SameForEveryBuilderAndThreadCount) {
    const Mesh mesh = spiky_cone();
    Random random(solid_seed);
    std::vector<Vec3> points(5000);
    for (Vec3& p : points) p = random.in({{-1.2f, -1.2f, -0.5f}, {1.2f, 1.2f, 3.5f}});
    std::vector<float> first;
    for (const char* builder :
         {"karras", "lauterbach", "ploc", "hploc", "binned", "sweep", "split", "sbvh"})
        for (const int threads : {1, 2, 7}) {
            const Bvh bvh = build_bvh(mesh, {.builder = builder_from_name(builder)});
            const auto found =
                signed_distances(Solid(bvh, {.threads = threads}), points, {.threads = threads});
            if (first.empty()) first = found;
            for (std::size_t i = 0; i < points.size(); ++i)
                ASSERT_EQ(std::bit_cast<std::uint32_t>(found[i]),
                          std::bit_cast<std::uint32_t>(first[i]));
        }
}

TEST(Solid, OddInput) {
    const Bvh none;
    const Solid nothing(none);
    EXPECT_EQ(nothing.closure(), Closure::oriented);
    EXPECT_FALSE(contains(nothing, {0, 0, 0}));
    EXPECT_EQ(signed_distance(nothing, {0, 0, 0}), infinity);
    const Bvh bvh = build_bvh(spiky_cone());
    const Solid solid(bvh);
    const std::vector<Vec3> points{
        {solid_nan, 0, 0}, {0, infinity, 0}, {0, 0, 1}, {50, 0, 0}, {3e38f, -3e38f, 3e38f}};
    std::vector<std::uint8_t> inside(points.size());
    const QueryCounts counts = contains(solid, points, inside);
    EXPECT_EQ(counts.invalid_queries, 2u);
    EXPECT_EQ(counts.found, 1u);
    EXPECT_EQ(inside, (std::vector<std::uint8_t>{0, 0, 1, 0, 0}));
    const std::vector<float> distances = signed_distances(solid, points, {.max_distance = 0.01f});
    EXPECT_EQ(distances, (std::vector<float>{infinity, infinity, -infinity, infinity, infinity}));
    EXPECT_THROW(contains(solid, points, std::span(inside).first(1)), InputError);
    EXPECT_THROW(static_cast<void>(signed_distances(solid, points, {.max_distance = -1})),
                 InputError);
    const std::vector<Aabb> boxes{{{0, 0, 0}, {1, 1, 1}}};
    const Bvh of_boxes = build_bvh(boxes);
    EXPECT_THROW(Solid{of_boxes}, InputError);
    // Lines and points close nothing and open nothing.
    Mesh mesh = spiky_cone();
    mesh.triangles.push_back({0, 0, 0});
    mesh.triangles.push_back({0, 1, 1});
    const Bvh more = build_bvh(mesh);
    EXPECT_EQ(Solid(more).closure(), Closure::oriented);
    EXPECT_TRUE(contains(Solid(more), {0, 0, 1}));
}

}  // namespace
}  // namespace raydix
