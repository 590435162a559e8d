#include <gtest/gtest.h>
#include <raydix/error.h>
#include <raydix/mesh.h>
#include <raydix/model.h>

#include <cmath>

#include "base/math.h"
#include "support/support.h"

namespace raydix::test {
namespace {

constexpr float nan = std::numeric_limits<float>::quiet_NaN();

TEST(Inspect, nothing_and_points) {
    const MeshInfo none = inspect(Mesh{});
    EXPECT_EQ(none.vertices + none.triangles + none.points + none.bytes, 0u);
    EXPECT_TRUE(is_empty(none.bounds));

    const std::vector<Vec3> points{
        {1, 2, 3}, {nan, 0, 0}, {0, infinity, 0}, {0, 0, 2e12f}, {-1, -0.0f, 4}};
    const MeshInfo info = inspect(MeshView(points, {}));
    EXPECT_EQ(info.points, 5u);
    EXPECT_EQ(info.non_finite_vertices, 2u);
    EXPECT_EQ(info.out_of_range_vertices, 1u);
    EXPECT_EQ(info.unreferenced_vertices, 0u);
    EXPECT_EQ(info.bytes, 60u);
    EXPECT_TRUE(info.bounds.lo == (Vec3{-1, 0, 3}));
    EXPECT_FALSE(std::signbit(info.bounds.lo.y));
    EXPECT_TRUE(info.bounds.hi == (Vec3{1, 2, 4}));
}

TEST(Inspect, triangles_of_each_kind) {
    const std::vector<Vec3> vertices{{0, 0, 0},      {1, 0, 0},      {0, 1, 0},
                                     {2, 0, 0},      {nan, 0, 0},    {0, 0, 3e12f},
                                     {1e-13f, 0, 0}, {0, 1e-13f, 0}, {9, 9, 9}};
    const std::vector<Triangle> triangles{
        {0, 1, 2},  // good
        {0, 1, 3},  // on a line
        {0, 1, 1},  // repeats an index
        {0, 1, 4},  // not finite
        {0, 1, 5},  // out of range
        {0, 6, 7},  // box too small
        {4, 4, 0},  // not finite and repeats an index
    };
    const MeshInfo info = inspect(MeshView(vertices, triangles));
    EXPECT_EQ(info.triangles, 7u);
    EXPECT_EQ(info.points, 0u);
    EXPECT_EQ(info.zero_area_triangles, 3u);
    EXPECT_EQ(info.repeated_index_triangles, 2u);
    EXPECT_EQ(info.left_out_triangles, 4u);
    EXPECT_EQ(info.unreferenced_vertices, 1u);
    EXPECT_EQ(info.non_finite_vertices, 1u);
    EXPECT_EQ(info.out_of_range_vertices, 1u);
}

TEST(Inspect, index_out_of_range) {
    const std::vector<Vec3> vertices(3);
    const std::vector<Triangle> triangles{{0, 1, 2}, {0, 1, 3}};
    try {
        static_cast<void>(inspect(MeshView(vertices, triangles)));
        FAIL();
    } catch (const InputError& error) {
        EXPECT_STREQ(error.what(), "mesh: triangle 1: index 3 of 3 vertices");
    }
}

TEST(Inspect, known_scenes) {
    const auto file = shared_scene("conference/conference.ply.xz");
    RAYDIX_SKIP_WITHOUT(file);
    const MeshInfo info = inspect(load_mesh(file));
    EXPECT_EQ(info.triangles, 331'179u);
    EXPECT_EQ(info.zero_area_triangles, 53'627u);
    EXPECT_EQ(info.repeated_index_triangles, 0u);
}

}  // namespace
}  // namespace raydix::test
