#include <gtest/gtest.h>

#include <cmath>

#include "samples.h"

namespace raydix::test {
namespace {

const std::string three = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

TEST(Obj, indices_forms_and_order) {
    const Mesh mesh = load(
        load_obj, "f 1 2 3\n" + three + "f -3 -2/5 -1//7 # end\nf 1 \\\n 2 \\\r\n 3\nf 1//\nf\n");
    EXPECT_EQ(mesh.triangles, (std::vector<Triangle>{{0, 1, 2}, {0, 1, 2}, {0, 1, 2}}));
}

TEST(Obj, other_statements_are_passed_over) {
    const Mesh mesh =
        load(load_obj, "\xEF\xBB\xBFmtllib a b.mtl\no \xE4\n" + three +
                           "vt 0 0\nvn x y z\ng\ns off\nl 1 2\np 1\ncurv2 5\nusemtl\n");
    EXPECT_TRUE(mesh.is_point_cloud());
    EXPECT_EQ(mesh.vertices.size(), 3u);
}

TEST(Obj, numbers) {
    const Mesh mesh =
        load(load_obj,
             "v +1.5e-3 .5 2.\nv nan INF -Infinity\nv 1e999 -1e999 1e-999\nv 1.#INF -1.#QNAN 0.1\n"
             "v 340282356779733661637539395458142568448 "
             "0.000000000000000000000000000000000000000000000001 "
             "0.0000000000000000000000000000000000001e40\n");
    ASSERT_EQ(mesh.vertices.size(), 5u);
    EXPECT_EQ(mesh.vertices[0].x, 1.5e-3f);
    EXPECT_EQ(mesh.vertices[0].z, 2.0f);
    EXPECT_TRUE(std::isnan(mesh.vertices[1].x));
    EXPECT_EQ(mesh.vertices[1].y, infinity);
    EXPECT_EQ(mesh.vertices[1].z, -infinity);
    EXPECT_EQ(mesh.vertices[2].x, infinity);
    EXPECT_EQ(mesh.vertices[2].y, -infinity);
    EXPECT_EQ(mesh.vertices[2].z, 0.0f);
    EXPECT_EQ(mesh.vertices[3].x, infinity);
    EXPECT_TRUE(std::isnan(mesh.vertices[3].y));
    EXPECT_EQ(mesh.vertices[3].z, 0.1f);
    EXPECT_EQ(mesh.vertices[4].x, infinity);
    EXPECT_EQ(mesh.vertices[4].y, 0.0f);
    EXPECT_EQ(mesh.vertices[4].z, 1000.0f);
}

TEST(Obj, says_what_is_wrong) {
    const auto error = [](const std::string& bytes) { return error_of(load_obj, bytes); };
    EXPECT_EQ(error(three + "f 1 2 4\nf 1 2 9\nf 1 2 5\n"),
              "sample: line 5: index 9 of 3 vertices");
    EXPECT_EQ(error(three + "f 1 2 0\n"), "sample: line 4: index 0 of 3 vertices");
    EXPECT_EQ(error(three + "f 1 2 -4\n"), "sample: line 4: index -4 of 3 vertices");
    EXPECT_EQ(error(three + "f 1 2 99999999999\n"),
              "sample: line 4: index 99999999999 of 3 vertices");
    EXPECT_EQ(error(three + "\n\\\n\nf 1 2 x\n"),
              "sample: line 7: \"x\" is not a corner of a face");
    EXPECT_EQ(error("v 1 2\n"), "sample: line 1: a vertex with less than three numbers");
    EXPECT_EQ(error("v 1 2 0x3\n"), "sample: line 1: \"0x3\" is not a number");
    EXPECT_EQ(error("v 1 2 a\x1B\xFF\n"), "sample: line 1: \"a\\x1B\\xFF\" is not a number");
    EXPECT_NE(error("\xFF\xFEv\0 \0").find("UTF-16"), std::string::npos);
}

TEST(Obj, endless_line_is_bounded) {
    EXPECT_EQ(error_of(load_obj, std::string(std::size_t{20} << 20, 'x')),
              "sample: line 1: longer than 16 MiB");
    std::string continued;
    for (std::size_t i = 0; i < (std::size_t{20} << 20); i += 1024)
        continued += std::string(1024, '#') + "\\\n";
    EXPECT_EQ(error_of(load_obj, continued), "sample: line 1: longer than 16 MiB");
}

}  // namespace
}  // namespace raydix::test
