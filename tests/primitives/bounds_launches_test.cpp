// Bounds as launches against the loop of the host, for every share of primitives among lanes.
#include "primitives/bounds_launches.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "exec/host_launcher.h"
#include "primitives/bounds.h"

namespace raydix::test {
namespace {

/// Points, one in seven of them not valid.
std::vector<Vec3> some_points(std::uint32_t n, std::uint64_t seed) {
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<float> coordinate(-100.0f, 100.0f);
    std::vector<Vec3> points(n);
    for (Vec3& p : points) {
        p = {coordinate(random), coordinate(random), coordinate(random)};
        if (random() % 7 == 0) p.y = std::nanf("");
    }
    return points;
}

TEST(BoundsLaunches, AnyNumberOfTilesLikeTheHost) {
    for (const std::uint32_t n : {0u, 1u, 31u, 32u, 33u, 500u, 5000u})
        for (const std::uint32_t tiles : {1u, 2u, 7u, 64u}) {
            SCOPED_TRACE(std::to_string(n) + " points, " + std::to_string(tiles) + " tiles");
            const std::vector<Vec3> points = some_points(n, n + tiles);
            const PointSource source{points.data()};
            std::vector<BoundsPart> parts(tiles);
            BoundsPart all;
            HostLauncher<> launcher;
            launcher.launch_tiles("bounds.primitives", tiles,
                                  BoundPrimitives<PointSource>{source, n, tiles, parts.data()});
            launcher.launch_tiles("bounds.all", 1, MergeParts{parts.data(), tiles, 1, &all});
            const Bounds expected = scene_bounds(source, n);
            EXPECT_EQ(all.box.lo, expected.box.lo);
            EXPECT_EQ(all.box.hi, expected.box.hi);
            EXPECT_EQ(all.left_out, expected.left_out);
            EXPECT_EQ(all.valid, n - expected.left_out);
            EXPECT_EQ(all.first_left_out, expected.first_left_out);
            EXPECT_EQ(all.unreadable, 0u);
        }
}

}  // namespace
}  // namespace raydix::test
