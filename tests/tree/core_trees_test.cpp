// The launches of octree and k-d tree in shuffled order on real threads against the trees that
// build_octree and build_kdtree give.
#include "support/core_trees.h"

#include <gtest/gtest.h>
#include <raydix/bvh.h>

#include <cstring>
#include <vector>

#include "support/launched_build.h"
#include "support/support.h"

namespace raydix::test {
namespace {

/// Random points, half of them in a few places, so that codes repeat.
std::vector<Vec3> some_points(std::size_t n) {
    std::vector<Vec3> points = random_soup(n, 5).vertices;
    points.resize(n);
    for (std::size_t i = 0; i < n; i += 2) points[i] = points[i % 22];
    return points;
}

template <class Key>
struct Prepared {
    std::vector<Key> keys;
    std::vector<Vec3> points;
    SortedPoints<Key> sorted;

    Prepared(const std::vector<Vec3>& input, int bits, std::uint32_t max_leaf) {
        const Bvh bvh = build_bvh(std::span<const Vec3>(input), {.bits = bits});
        points.assign(bvh.points().begin(), bvh.points().end());
        const Grid grid = make_grid(bvh.bounds(), CodeFormat<Key>::axis_bits);
        for (const Vec3& p : points)
            keys.push_back(interleave<Key>(grid.cell(center_of(Aabb{p, p}))));
        sorted = {keys.data(), points.data(), static_cast<std::uint32_t>(points.size()), grid,
                  max_leaf};
    }
};

template <class Key>
void compare(std::size_t n, int bits, std::uint64_t seeds) {
    const std::vector<Vec3> input = some_points(n);
    const std::uint32_t max_leaf = 3;
    const Octree octree =
        build_octree(std::span<const Vec3>(input), {.bits = bits, .max_leaf = max_leaf});
    const KdTree kdtree = build_kdtree(std::span<const Vec3>(input),
                                       {.bits = bits, .max_leaf = static_cast<int>(max_leaf)});
    const Prepared<Key> in(input, bits, max_leaf);
    Arena sizing = sizing_arena();
    IdleLauncher idle;
    build_core_trees(idle, sizing, in.sorted);
    std::vector<std::byte> memory(sizing.bytes() + Arena::alignment);
    for (std::uint64_t seed = 0; seed < seeds; ++seed) {
        SCOPED_TRACE("seed " + std::to_string(seed));
        std::fill(memory.begin(), memory.end(), static_cast<std::byte>(0xA5 + seed));
        void* start = memory.data();
        std::size_t space = memory.size();
        std::align(Arena::alignment, sizing.bytes(), start, space);
        Arena arena(start, sizing.bytes());
        ShuffledLauncher launcher(seed);
        const CoreTrees trees = build_core_trees(launcher, arena, in.sorted);
        ASSERT_EQ(*trees.octree_count, octree.nodes().size());
        for (std::size_t i = 0; i < octree.nodes().size(); ++i)
            ASSERT_TRUE(same(trees.octree_nodes[i], octree.nodes()[i])) << i;
        ASSERT_EQ(*trees.kd_inner, kdtree.inner_count());
        ASSERT_EQ(*trees.kd_depth, kdtree.max_depth());
        ASSERT_EQ(std::memcmp(trees.kd_nodes, kdtree.nodes().data(), kdtree.nodes().size_bytes()),
                  0);
    }
}

TEST(CoreTrees, ShuffledLaunchesGiveTheTreesOfTheHost) {
    compare<std::uint32_t>(300 + 35 * thorough, 30, 100);
    compare<std::uint64_t>(300 + 35 * thorough, 63, 100);
}

}  // namespace
}  // namespace raydix::test
