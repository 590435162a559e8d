// Cubes of nodes, point location and box queries against brute force over all nodes and points.
#include <gtest/gtest.h>
#include <raydix/error.h>
#include <raydix/octree.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "support/octree_inputs.h"
#include "support/support.h"

#if defined(__SSE2__)
#include <xmmintrin.h>
#endif

namespace raydix::test {
namespace {

using Random = std::mt19937_64;

constexpr std::uint64_t octree_query_seed = 77;
constexpr float nan = std::numeric_limits<float>::quiet_NaN();

float unit(Random& random) { return static_cast<float>(random() >> 40) * 0x1p-24f; }

/// Coordinate by coordinate: (node cell of its level, lo, hi).
struct Side {
    std::uint32_t cell;
    float lo, hi;
};
std::array<Side, 3> sides_of(const OctreeNode& node, const Aabb& box) {
    std::array<Side, 3> sides{
        {{0, box.lo.x, box.hi.x}, {0, box.lo.y, box.hi.y}, {0, box.lo.z, box.hi.z}}};
    for (std::uint32_t bit = 0; bit < node.level; ++bit)
        for (std::size_t axis = 0; axis < 3; ++axis)
            sides[axis].cell |= static_cast<std::uint32_t>(node.code >> (3 * bit + 2 - axis) & 1)
                                << bit;
    return sides;
}

/// What octree.h says of node_box, word for word.
bool holds(const OctreeNode& node, const Aabb& box, Vec3 p) {
    const auto sides = sides_of(node, box);
    const std::array<float, 3> at{p.x, p.y, p.z};
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const auto [cell, lo, hi] = sides[axis];
        const bool touches = cell + 1 == 1u << node.level;
        if (!(lo <= at[axis] && (at[axis] < hi || (touches && at[axis] == hi)))) return false;
    }
    return true;
}

std::vector<Aabb> boxes_of(const Octree& octree) {
    std::vector<Aabb> boxes;
    for (std::uint32_t i = 0; i < octree.nodes().size(); ++i) boxes.push_back(node_box(octree, i));
    return boxes;
}

/// In and around the root, on faces of nodes, one float beside them, and far outside.
std::vector<Vec3> places(const Octree& octree, const std::vector<Aabb>& boxes, std::size_t count) {
    Random r(octree_query_seed);
    std::vector<Vec3> list(octree.points().begin(), octree.points().end());
    const Aabb root = boxes.empty() ? Aabb{{0, 0, 0}, {1, 1, 1}} : boxes[0];
    const auto within = [&](float lo, float hi) {
        return lo + (hi - lo) * (1.2f * unit(r) - 0.1f);
    };
    for (std::size_t i = 0; i < count; ++i)
        list.push_back({within(root.lo.x, root.hi.x), within(root.lo.y, root.hi.y),
                        within(root.lo.z, root.hi.z)});
    for (std::size_t i = 0; i < count && !boxes.empty(); ++i) {
        const Aabb& box = boxes[r() % boxes.size()];
        const auto beside = [&](float lo, float hi) {
            const float face = (r() & 1) != 0 ? lo : hi;
            const auto way = r() % 3;
            return way == 0 ? face : std::nextafter(face, way == 1 ? -infinity : infinity);
        };
        list.push_back(
            {beside(box.lo.x, box.hi.x), beside(box.lo.y, box.hi.y), beside(box.lo.z, box.hi.z)});
    }
    for (const float far : {3e38f, -3e38f, infinity, -infinity, nan}) {
        list.push_back({far, root.lo.y, root.lo.z});
        list.push_back({root.lo.x, far, root.lo.z});
        list.push_back({far, far, far});
    }
    return list;
}

template <class Try>
void for_each_tree(std::size_t size, const Try& attempt) {
    for (const NamedPoints& input : octree_inputs(size, octree_query_seed))
        for (const int bits : {30, 63})
            for (const int max_leaf : {1, 8})
                for (const int max_level : {-1, 3}) {
                    SCOPED_TRACE(input.name + ", bits " + std::to_string(bits) + ", max_leaf " +
                                 std::to_string(max_leaf) + ", max_level " +
                                 std::to_string(max_level) + ", seed " +
                                 std::to_string(octree_query_seed));
                    attempt(
                        build_octree(input.points,
                                     {.bits = bits, .max_level = max_level, .max_leaf = max_leaf}));
                }
}

TEST(OctreeQuery, LocatesTheDeepestNodeWhoseCubeHoldsThePoint) {
    std::size_t found_leaves = 0, found_inner = 0, outside = 0;
    for_each_tree(60, [&](const Octree& octree) {
        const std::vector<Aabb> boxes = boxes_of(octree);
        const std::vector<Vec3> list = places(octree, boxes, 60);
        const std::vector<std::uint32_t> found = locate(octree, list, 2);
        ASSERT_EQ(found.size(), list.size());
        for (std::size_t i = 0; i < list.size(); ++i) {
            std::uint32_t expected = no_node;  // level order: the last one is the deepest
            for (std::uint32_t node = 0; node < boxes.size(); ++node)
                if (holds(octree.nodes()[node], boxes[node], list[i])) expected = node;
            ASSERT_EQ(found[i], expected)
                << i << ": " << list[i].x << " " << list[i].y << " " << list[i].z;
            ASSERT_EQ(locate(octree, list[i]), expected);
            if (expected == no_node)
                ++outside;
            else
                ++(octree.nodes()[expected].is_leaf() ? found_leaves : found_inner);
        }
    });
    EXPECT_GT(found_leaves, 1000u);
    EXPECT_GT(found_inner, 1000u);
    EXPECT_GT(outside, 1000u);
}

TEST(OctreeQuery, APointOfTheTreeIsInItsOwnLeaf) {
    for_each_tree(300, [&](const Octree& octree) {
        for (std::uint32_t node = 0; node < octree.nodes().size(); ++node) {
            const OctreeNode& leaf = octree.nodes()[node];
            if (!leaf.is_leaf()) continue;
            for (std::uint32_t k = 0; k < leaf.point_count; ++k)
                ASSERT_EQ(locate(octree, octree.points()[leaf.first_point + k]), node);
        }
    });
}

/// Octants share faces bit for bit, and cubes are where the grid has them.
TEST(OctreeQuery, CubesOfNodesTileTheRoot) {
    for_each_tree(300, [&](const Octree& octree) {
        if (octree.empty()) return;
        const Aabb root = node_box(octree, 0), scene = octree.bounds();
        EXPECT_TRUE(std::ranges::equal(std::array{root.lo.x, root.lo.y, root.lo.z},
                                       std::array{scene.lo.x, scene.lo.y, scene.lo.z}));
        EXPECT_TRUE(root.hi.x >= scene.hi.x && root.hi.y >= scene.hi.y && root.hi.z >= scene.hi.z);
        const double edge =
            std::max({double(scene.hi.x) - scene.lo.x, double(scene.hi.y) - scene.lo.y,
                      double(scene.hi.z) - scene.lo.z});
        const std::array<double, 3> origin{scene.lo.x, scene.lo.y, scene.lo.z};
        const std::array<double, 3> far{root.hi.x, root.hi.y, root.hi.z};
        const std::vector<Aabb> boxes = boxes_of(octree);
        for (std::size_t i = 0; i < boxes.size(); ++i) {
            const OctreeNode& node = octree.nodes()[i];
            const auto sides = sides_of(node, boxes[i]);
            for (std::size_t axis = 0; axis < 3; ++axis) {
                const auto [cell, lo, hi] = sides[axis];
                EXPECT_LT(lo, edge > 0 ? hi : std::nextafter(hi, infinity));
                if (edge < 1e-30) continue;  // the grid itself is cut off there (keys/morton.h)
                const double nominal = origin[axis] + cell * std::ldexp(edge, -int(node.level));
                const double around = std::max(std::abs(origin[axis]), std::abs(far[axis]));
                EXPECT_NEAR(lo, nominal, 0x1p-22 * edge + 0x1p-23 * around);
            }
            for (std::uint32_t octant = 0; octant < 8; ++octant) {
                if (node.child(octant) == no_node) continue;
                const auto parts =
                    sides_of(octree.nodes()[node.child(octant)], boxes[node.child(octant)]);
                for (std::size_t axis = 0; axis < 3; ++axis) {
                    if ((octant >> (2 - axis) & 1) != 0)
                        EXPECT_EQ(parts[axis].hi, sides[axis].hi);
                    else
                        EXPECT_EQ(parts[axis].lo, sides[axis].lo);
                }
            }
        }
    });
}

std::vector<std::uint32_t> brute_force(const Octree& octree, const Aabb& box) {
    std::vector<std::uint32_t> ids;
    for (std::size_t k = 0; k < octree.order().size(); ++k) {
        const Vec3 p = octree.points()[k];
        if (box.lo.x <= p.x && p.x <= box.hi.x && box.lo.y <= p.y && p.y <= box.hi.y &&
            box.lo.z <= p.z && p.z <= box.hi.z)
            ids.push_back(octree.order()[k]);
    }
    std::ranges::sort(ids);
    return ids;
}

/// Between places of the tree: points, faces of cubes and their neighbouring floats, far outside.
std::vector<Aabb> query_boxes(const Octree& octree, std::size_t count) {
    Random r(octree_query_seed + 1);
    const std::vector<Vec3> list = places(octree, boxes_of(octree), 100);
    std::vector<Aabb> boxes{octree.bounds(), {{-3e38f, -3e38f, -3e38f}, {3e38f, 3e38f, 3e38f}}};
    for (std::size_t i = 0; i < count; ++i) {
        const Vec3 a = list[r() % list.size()], b = i % 3 == 0 ? a : list[r() % list.size()];
        const bool turned = i % 17 != 0;  // every 17th may be inverted
        boxes.push_back(turned ? Aabb{{std::min(a.x, b.x), std::min(a.y, b.y), std::min(a.z, b.z)},
                                      {std::max(a.x, b.x), std::max(a.y, b.y), std::max(a.z, b.z)}}
                               : Aabb{a, b});
    }
    return boxes;
}

TEST(OctreeQuery, BoxesHoldWhatBruteForceFinds) {
    std::size_t found = 0, invalid = 0;
    for_each_tree(300, [&](const Octree& octree) {
        const std::vector<Aabb> boxes = query_boxes(octree, 300);
        const PointsInBoxes result = points_in_boxes(octree, boxes, 2);
        ASSERT_EQ(result.offsets.size(), boxes.size() + 1);
        ASSERT_EQ(result.offsets[0], 0u);
        ASSERT_EQ(result.offsets.back(), result.ids.size());
        std::uint64_t bad = 0;
        for (std::size_t q = 0; q < boxes.size(); ++q) {
            const auto [lo, hi] = boxes[q];
            const std::vector<std::uint32_t> row(
                result.ids.begin() + static_cast<std::ptrdiff_t>(result.offsets[q]),
                result.ids.begin() + static_cast<std::ptrdiff_t>(result.offsets[q + 1]));
            bool valid = lo.x <= hi.x && lo.y <= hi.y && lo.z <= hi.z;
            for (const float x : {lo.x, lo.y, lo.z, hi.x, hi.y, hi.z})
                valid = valid && std::isfinite(x);
            bad += valid ? 0 : 1;
            ASSERT_EQ(row, valid ? brute_force(octree, boxes[q]) : std::vector<std::uint32_t>{})
                << "box " << q;
            ASSERT_EQ(points_in_box(octree, boxes[q]), row);
            found += row.size();
        }
        EXPECT_EQ(result.invalid_queries, bad);
        invalid += bad;
        const PointsInBoxes again = points_in_boxes(octree, boxes, 7);
        EXPECT_EQ(again.ids, result.ids);
        EXPECT_EQ(again.offsets, result.offsets);
    });
    EXPECT_GT(found, 100'000u);
    EXPECT_GT(invalid, 100u);
}

TEST(OctreeQuery, AnEmptyTreeAnswersEverything) {
    const Octree octree = build_octree(std::span<const Vec3>{});
    EXPECT_EQ(locate(octree, Vec3{0, 0, 0}), no_node);
    const Aabb box{{-1, -1, -1}, {1, 1, 1}};
    EXPECT_TRUE(points_in_box(octree, box).empty());
    EXPECT_EQ(points_in_boxes(octree, {&box, 1}).offsets, (std::vector<std::uint64_t>{0, 0}));
    EXPECT_EQ(points_in_boxes(octree, {}).offsets, std::vector<std::uint64_t>{0});
    EXPECT_THROW((void)node_box(octree, 0), InputError);
    EXPECT_EQ(octree.level_count(), 0u);
    EXPECT_EQ(octree.level_nodes(0).size(), 0u);
}

#if defined(__SSE2__)
/// A caller's thread that flushes denormals gets the same answers.
TEST(OctreeQuery, TheCallersFloatingPointStateDoesNotMatter) {
    std::vector<Vec3> points;
    for (int i = 0; i < 64; ++i)
        points.push_back({1e-44f * static_cast<float>(i % 7), 1e-43f * static_cast<float>(i % 5),
                          1e-42f * static_cast<float>(i)});
    const std::vector<Aabb> boxes{{{0, 0, 0}, points[40]}, {points[3], {0, 0, 0}}};
    const auto answers = [&] {
        const Octree octree = build_octree(points, {.max_leaf = 2});
        const PointsInBoxes inside = points_in_boxes(octree, boxes);
        std::vector<std::uint32_t> all{locate(octree, points[9])};
        for (const std::uint32_t node : locate(octree, points)) all.push_back(node);
        for (const std::uint32_t id : inside.ids) all.push_back(id);
        for (const std::uint32_t id : points_in_box(octree, boxes[0])) all.push_back(id);
        all.push_back(static_cast<std::uint32_t>(inside.invalid_queries));
        const Aabb box = node_box(octree, all[0]);
        for (const float x : {box.lo.x, box.lo.y, box.lo.z, box.hi.x, box.hi.y, box.hi.z})
            all.push_back(std::bit_cast<std::uint32_t>(x));
        return std::pair(tree_hash(octree), all);
    };
    const auto expected = answers();
    const unsigned saved = _mm_getcsr();
    _mm_setcsr(saved | 0x8040u);  // flush to zero, denormals are zero
    const auto flushed = answers();
    _mm_setcsr(saved);
    EXPECT_EQ(flushed, expected);
    EXPECT_EQ(expected.second[expected.second.size() - 7], 1u);  // one inverted box
}
#endif

/// The corner of the scene belongs to the last cell, and nothing beyond it to any.
TEST(OctreeQuery, TheUpperFaceIsClosed) {
    const std::vector<Vec3> points{{0, 0, 0}, {8, 4, 8}, {1, 1, 1}, {7, 3, 7}};
    const Octree octree = build_octree(points, {.max_leaf = 1});
    EXPECT_EQ(octree.nodes()[locate(octree, {8, 4, 8})].first_point, 3u);
    EXPECT_NE(locate(octree, {8, 8, 8}), no_node);  // the root is a cube
    EXPECT_EQ(locate(octree, {std::nextafter(8.0f, 9.0f), 4, 8}), no_node);
    EXPECT_EQ(locate(octree, {0, std::nextafter(0.0f, -1.0f), 0}), no_node);
}

}  // namespace
}  // namespace raydix::test
