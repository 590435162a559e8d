#include <gtest/gtest.h>

#include "samples.h"

namespace raydix::test {
namespace {

TEST(Xyz, separators_comments_and_further_columns) {
    const Mesh mesh =
        load(load_xyz, "# x y z\n// again\n\n1 2 3 255 0 0\n4,5,6\n7;8;\t9 nan text\n");
    ASSERT_EQ(mesh.vertices.size(), 3u);
    EXPECT_EQ(mesh.vertices[1].z, 6.0f);
    EXPECT_EQ(mesh.vertices[2].z, 9.0f);
    EXPECT_EQ(load(load_xyz, "").vertices.size(), 0u);
}

TEST(Xyz, says_what_is_wrong) {
    EXPECT_EQ(error_of(load_xyz, "1 2 3\n4 5\n"),
              "sample: line 2: a point with less than three numbers");
    EXPECT_EQ(error_of(load_xyz, "x,y,z\n"), "sample: line 1: \"x\" is not a number");
}

}  // namespace
}  // namespace raydix::test
