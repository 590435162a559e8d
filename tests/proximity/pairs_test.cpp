// Pairs against a look at all of them, and against whole numbers.
#include <gtest/gtest.h>
#include <raydix/error.h>
#include <raydix/model.h>
#include <raydix/pairs.h>

#include <iostream>
#include <limits>

#include "primitives/exact_overlap.h"
#include "support/exact_overlap_reference.h"
#include "support/mesh_triangles.h"
#include "support/sanitized.h"
#include "support/scenes.h"
#include "support/support.h"

namespace raydix {
namespace {

using test::corners;
constexpr std::uint64_t pairs_seed = 20000517;
constexpr float pairs_nan = std::numeric_limits<float>::quiet_NaN();
constexpr const char* all_builders[] = {"karras", "lauterbach", "garanzha", "apetrei", "ploc",
                                        "hploc",  "binned",     "sweep",    "split",   "sbvh"};
using Pairs = std::vector<PrimitivePair>;

Aabb box_of(const LeafTriangle& t) { return raydix::box_of(t.v0, t.v1, t.v2); }

bool shares(const LeafTriangle& a, const LeafTriangle& b) {
    for (const Vec3 p : {a.v0, a.v1, a.v2})
        for (const Vec3 q : {b.v0, b.v1, b.v2})
            if (p == q) return true;
    return false;
}

/// Narrow by `touch`.
template <class Touch>
Pairs self_pairs(const Mesh& mesh, bool narrow, const Touch& touch) {
    Pairs pairs;
    for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i)
        for (std::uint32_t j = i + 1; j < mesh.triangles.size(); ++j) {
            const LeafTriangle a = corners(mesh, i), b = corners(mesh, j);
            if (boxes_touch(box_of(a), box_of(b)) && !shares(a, b) && (!narrow || touch(a, b)))
                pairs.push_back({i, j});
        }
    return pairs;
}

template <class Touch>
Pairs cross_pairs(const Mesh& x, const Mesh& y, bool narrow, const Touch& touch) {
    Pairs pairs;
    for (std::uint32_t i = 0; i < x.triangles.size(); ++i)
        for (std::uint32_t j = 0; j < y.triangles.size(); ++j) {
            const LeafTriangle a = corners(x, i), b = corners(y, j);
            if (boxes_touch(box_of(a), box_of(b)) && (!narrow || touch(a, b)))
                pairs.push_back({i, j});
        }
    return pairs;
}

template <class Touch>
void expect_all(const std::string& name, const Mesh& x, const Mesh& y, const Touch& touch) {
    for (const bool narrow : {false, true}) {
        const Pairs self = self_pairs(x, narrow, touch), cross = cross_pairs(x, y, narrow, touch);
        std::cout << name << (narrow ? ", narrow: " : ", boxes: ") << self.size() << " within, "
                  << cross.size() << " between\n";
        EXPECT_EQ(self.empty(), name == "balls" && narrow);  // a ball does not meet itself
        EXPECT_FALSE(cross.empty());
        for (const char* builder : all_builders) {
            const Bvh a = build_bvh(x, {.builder = builder_from_name(builder)});
            const Bvh b = build_bvh(y, {.builder = builder_from_name(builder), .max_leaf = 1});
            for (const int threads : {1, 2, 7}) {
                const PairOptions options{.narrow = narrow, .threads = threads};
                EXPECT_TRUE(overlapping_pairs(a, options) == self) << name << ' ' << builder;
                EXPECT_TRUE(overlapping_pairs(a, b, options) == cross) << name << ' ' << builder;
            }
            EXPECT_EQ(count_overlapping_pairs(a, {.narrow = narrow}), self.size());
            EXPECT_EQ(count_overlapping_pairs(a, b, {.narrow = narrow}), cross.size());
        }
    }
}

TEST(Pairs, AreBruteForce) {
    const std::size_t n = test::sanitized ? 120 : 200 + 60 * test::thorough;
    expect_all("soups", test::random_soup(n, pairs_seed, 0.15f),
               test::random_soup(n, pairs_seed + 1, 0.1f), triangles_touch<LeafTriangle>);
    expect_all("lattices", test::lattice_mesh(n / 4, 6, pairs_seed),
               test::lattice_mesh(n / 4, 5, pairs_seed + 1), test::whole_triangles_touch);
    const Mesh ball = test::ball_mesh({0, 0, 0}), other = test::ball_mesh({60, 10, -20});
    expect_all("balls", ball, other,
               [&](const LeafTriangle& a, const LeafTriangle& b) { return triangles_touch(b, a); });
}

TEST(Pairs, OfBoxesAndPoints) {
    std::mt19937_64 random(pairs_seed);
    const auto unit = [&] { return static_cast<float>(random() % 17) / 16.0f; };
    std::vector<Aabb> boxes;
    std::vector<Vec3> points;
    for (std::size_t i = 0; i < 25 * test::thorough; ++i) {
        const Vec3 lo{unit(), unit(), unit()};
        boxes.push_back({lo, lo + Vec3{0.125f, 0.0625f, 0.25f}});
        points.push_back({unit(), unit(), unit()});
    }
    boxes[3] = {{0, 0, 0}, {pairs_nan, 1, 1}};
    Pairs within, between, equal;
    for (std::uint32_t i = 0; i < boxes.size(); ++i)
        for (std::uint32_t j = 0; j < boxes.size(); ++j) {
            if (i < j && points[i] == points[j]) equal.push_back({i, j});
            if (i == 3) continue;
            if (boxes_touch(boxes[i], {points[j], points[j]})) between.push_back({i, j});
            if (j == 3) continue;
            if (i < j && boxes_touch(boxes[i], boxes[j])) within.push_back({i, j});
        }
    for (const Builder builder : {Builder::karras, Builder::binned, Builder::sbvh}) {
        const Bvh of_boxes = build_bvh(boxes, {.builder = builder}),
                  of_points = build_bvh(points, {.builder = builder});
        EXPECT_TRUE(overlapping_pairs(of_boxes) == within);
        EXPECT_TRUE(overlapping_pairs(of_boxes, of_points) == between);
        EXPECT_TRUE(overlapping_pairs(of_points) == equal);
        EXPECT_THROW(static_cast<void>(overlapping_pairs(of_boxes, {.narrow = true})), InputError);
        EXPECT_THROW(static_cast<void>(overlapping_pairs(of_boxes, of_points, {.narrow = true})),
                     InputError);
    }
    EXPECT_FALSE(within.empty());
    EXPECT_FALSE(between.empty());
}

TEST(Pairs, OfDeepTrees) {
    // A chain of boxes, each twice as large as the one before: as deep as trees get.
    std::vector<Aabb> boxes;
    float x = 1;
    for (int i = 0; i < 100; ++i, x *= 1.3f)
        boxes.push_back({{x, x, x}, {1.3f * x, 1.3f * x, 1.3f * x}});
    for (const char* builder : all_builders) {
        const Bvh bvh = build_bvh(boxes, {.builder = builder_from_name(builder), .max_leaf = 1});
        const Pairs pairs = overlapping_pairs(bvh);
        std::size_t expected = 0;
        for (std::size_t i = 0; i < boxes.size(); ++i)
            for (std::size_t j = i + 1; j < boxes.size(); ++j)
                expected += boxes_touch(boxes[i], boxes[j]);
        EXPECT_EQ(pairs.size(), expected) << builder;
    }
}

TEST(Pairs, OfAClosedMesh) {
    // A ball meets itself nowhere; two that overlap meet along a curve.
    const Bvh ball = build_bvh(test::ball_mesh({0, 0, 0})),
              other = build_bvh(test::ball_mesh({50, 0, 0})),
              far = build_bvh(test::ball_mesh({500, 0, 0}));
    EXPECT_EQ(count_overlapping_pairs(ball, {.narrow = true}), 0u);
    EXPECT_GT(count_overlapping_pairs(ball, other, {.narrow = true}), 20u);
    EXPECT_TRUE(overlapping_pairs(ball, far).empty());
}

TEST(Pairs, TooManyAreAnErrorBeforeThereIsRoomForThem) {
    const std::vector<Aabb> equal(200000, Aabb{{0, 0, 0}, {1, 1, 1}});  // 2e10 pairs
    const Bvh bvh = build_bvh(equal);
    for (const int threads : {1, 2, 7}) {
        EXPECT_THROW(static_cast<void>(overlapping_pairs(
                         bvh, {.max_result_bytes = 1u << 20, .threads = threads})),
                     InputError);
        EXPECT_THROW(static_cast<void>(overlapping_pairs(
                         bvh, bvh, {.max_result_bytes = 1u << 20, .threads = threads})),
                     InputError);
    }
    const Bvh few = build_bvh(std::span(equal).first(10));
    EXPECT_THROW(static_cast<void>(overlapping_pairs(few, {.max_result_bytes = 45 * 8 - 1})),
                 ResultTooLarge);
    EXPECT_EQ(count_overlapping_pairs(few, {.max_result_bytes = 8}), 45u);  // keeps none
}

TEST(Pairs, OddInput) {
    const Bvh none, one = build_bvh(Mesh{"", {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}});
    EXPECT_TRUE(overlapping_pairs(none).empty());
    EXPECT_TRUE(overlapping_pairs(one).empty());
    EXPECT_TRUE(overlapping_pairs(none, one).empty());
    EXPECT_TRUE(overlapping_pairs(one, none, {.narrow = true}).empty());
    EXPECT_EQ(overlapping_pairs(one, one), (Pairs{{0, 0}})) << "between trees nothing is left out";
    // The broken triangle is in no pair.
    const Bvh three = build_bvh(Mesh{"",
                                     {{0, 0, 0},
                                      {1, 0, 0},
                                      {0, 1, 0},
                                      {pairs_nan, 0, 0},
                                      {0.2f, 0.2f, -1},
                                      {0.2f, 0.2f, 1},
                                      {0.3f, 0.2f, 1}},
                                     {{0, 1, 2}, {0, 1, 3}, {4, 5, 6}}});
    EXPECT_EQ(overlapping_pairs(three, {.narrow = true}), (Pairs{{0, 2}}));
}

}  // namespace
}  // namespace raydix
