// The order of a wide node's children, in which rays look for any hit.
#include <gtest/gtest.h>
#include <raydix/quality.h>
#include <raydix/raydix.h>
#include <raydix/trace.h>
#include <raydix/wide.h>

#include <algorithm>
#include <array>
#include <numeric>
#include <random>
#include <string>
#include <vector>

#include "base/math.h"
#include "layout/search_odds.h"
#include "layout/wide_bvh.h"

namespace raydix::test {
namespace {

double area_of(const WideNode& node, std::size_t s) {
    return half_area({{node.lo[0][s], node.lo[1][s], node.lo[2][s]},
                      {node.hi[0][s], node.hi[1][s], node.hi[2][s]}});
}

/// Puts children into the slots of each node by ascending key(node, slot).
template <class Key>
void reorder(WideBvh& tree, const Key& key) {
    for (WideNode& node : WideBvhInternals::arrays_of(tree).nodes.span()) {
        const WideNode old = node;
        std::array<std::size_t, quantised_width> slots;
        std::iota(slots.begin(), slots.end(), std::size_t{0});
        const auto used = std::partition(slots.begin(), slots.end(), [&](std::size_t s) {
            return old.child[s] != wide_no_child;
        });
        std::stable_sort(slots.begin(), used,
                         [&](std::size_t a, std::size_t b) { return key(old, a) < key(old, b); });
        for (std::size_t s = 0; s < slots.size(); ++s) {
            node.child[s] = old.child[slots[s]];
            for (int axis = 0; axis < 3; ++axis) {
                node.lo[axis][s] = old.lo[axis][slots[s]];
                node.hi[axis][s] = old.hi[axis][slots[s]];
            }
        }
    }
}

/// From anywhere in the box to anywhere in it.
std::vector<Ray> segments(const Aabb& box, std::size_t count) {
    std::mt19937 random(11);
    std::uniform_real_distribution<float> unit(0.0f, 1.0f);
    const auto point = [&] {
        const Vec3 part{unit(random), unit(random), unit(random)}, size = box.hi - box.lo;
        return box.lo + Vec3{part.x * size.x, part.y * size.y, part.z * size.z};
    };
    std::vector<Ray> rays(count);
    for (Ray& ray : rays) {
        ray.origin = point();
        ray.direction = point() - ray.origin;
        ray.tmax = 1.0f;
    }
    return rays;
}

std::uint64_t visits(const WideBvh& tree, const std::vector<Ray>& rays,
                     std::vector<std::uint8_t>& occluded) {
    occluded.resize(rays.size());
    return trace_any(tree, rays, occluded, {.counters = true, .path = SimdPath::single})
        .node_visits;
}

TEST(SearchOrder, RanksByChanceOverCost) {
    // Of equal areas, the leaf: half of all rays for less than a node.
    const SearchOdds leaf{hits_of_leaf(2.0f), 0.8f};
    SearchOdds node = odds_of_node(2.0f);
    add_child({hits_of_leaf(1.0f), 0.4f}, 2.0f, node);
    add_child({hits_of_leaf(1.0f), 0.4f}, 2.0f, node);
    EXPECT_FLOAT_EQ(node.hits, 2.0f * (1.0f - 0.75f * 0.75f));
    EXPECT_FLOAT_EQ(node.cost, 2.8f);
    EXPECT_GT(search_rank(leaf), search_rank(node));
}

TEST(SearchOrder, NothingIsDividedByZero) {
    SearchOdds flat = odds_of_node(0.0f);
    add_child({0.0f, 0.0f}, 0.0f, flat);
    EXPECT_EQ(search_rank(flat), 0.0f);
    constexpr float largest_area = 1e25f;  // of boxes within the range of coordinates
    const float both =
        joined_hits(hits_of_leaf(largest_area), hits_of_leaf(largest_area), largest_area);
    EXPECT_FLOAT_EQ(both, 0.75f * largest_area);
}

TEST(SearchOrder, FindsAnyHitSoonerThanByArea) {
    for (const char* spec : {"builtin:atrium?triangles=20000", "builtin:grove?triangles=20000"}) {
        const Mesh mesh = load_model(spec).mesh();
        for (const Quality quality : {Quality::fast, Quality::balanced, Quality::high})
            for (const int width : {4, 8}) {
                const auto build = [&] {
                    return build_wide_bvh(mesh, build_options_for(quality), {.width = width});
                };
                const WideBvh tree = build();
                WideBvh by_area = build(), reversed = build();
                reorder(by_area, area_of);
                reorder(reversed, [](const WideNode&, std::size_t s) { return -double(s); });
                std::vector<std::uint8_t> found, wanted;
                const std::vector<Ray> rays = segments(tree.arrays().bounds, 20000);
                const double ours = double(visits(tree, rays, found));
                const std::string where = std::string(spec) + ", quality " +
                                          std::to_string(int(quality)) + ", width " +
                                          std::to_string(width);
                EXPECT_LT(ours, 0.99 * double(visits(by_area, rays, wanted))) << where;
                EXPECT_EQ(found, wanted) << where;
                EXPECT_LT(ours, 0.98 * double(visits(reversed, rays, wanted))) << where;
                EXPECT_EQ(found, wanted) << where;
            }
    }
}

TEST(SearchOrder, LargeTreesHaveItAtTheTopToo) {
    // The top is laid out before the parts below it are known.
    const Mesh mesh = load_model("builtin:atrium?triangles=60000").mesh();
    for (const Quality quality : {Quality::fast, Quality::balanced}) {
        const WideBvh tree = build_wide_bvh(mesh, build_options_for(quality));
        const auto top_reordered = [&](const auto& key) {
            WideBvh other = build_wide_bvh(mesh, build_options_for(quality));
            WideNode& root = WideBvhInternals::arrays_of(other).nodes[0];
            const WideBvh all = [&] {
                WideBvh copy = build_wide_bvh(mesh, build_options_for(quality));
                reorder(copy, key);
                return copy;
            }();
            root = all.arrays().nodes[0];
            return other;
        };
        const WideBvh turned =
            top_reordered([](const WideNode&, std::size_t s) { return -double(s); });
        std::vector<std::uint8_t> found, wanted;
        const std::vector<Ray> rays = segments(tree.arrays().bounds, 20000);
        EXPECT_LT(visits(tree, rays, found), visits(turned, rays, wanted)) << int(quality);
        EXPECT_EQ(found, wanted);
    }
}

}  // namespace
}  // namespace raydix::test
