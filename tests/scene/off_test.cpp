#include <gtest/gtest.h>

#include "samples.h"

namespace raydix::test {
namespace {

TEST(Off, comments_colours_and_counts_on_the_first_line) {
    const Mesh mesh = load(load_off,
                           "# made by hand\nCOFF 3 1\n# vertices\n0 0 0 1 1 1 1\n1 0 0 1 1 1 1 # "
                           "two\n\n0 1 0\n3 0 1 2 255 0 0\n");
    EXPECT_EQ(mesh.vertices.size(), 3u);
    EXPECT_EQ(mesh.triangles, (std::vector<Triangle>{{0, 1, 2}}));
}

TEST(Off, says_what_is_wrong) {
    const auto error = [](const std::string& bytes) { return error_of(load_off, bytes); };
    EXPECT_EQ(error("OFF\n353535235358 6 0\n0 0 0\n"),
              "sample: vertex 2: file ends after 1 of 353535235358 vertices");
    EXPECT_EQ(error("OFF\n1 9 0\n0 0 0\n0\n"), "sample: face 2: file ends after 1 of 9 faces");
    EXPECT_EQ(error("OFF\n1 1 0\n0 0 0\n3 0 0 1\n"), "sample: face 1: index 1 of 1 vertices");
    EXPECT_EQ(error("OFF\n1 1 0\n0 0 0\n3 0 0\n"),
              "sample: face 1: expected an index per corner, found the end in line 4");
    EXPECT_EQ(error("OFF\n-1 1 0\n"),
              "sample: line 2: expected the numbers of vertices, faces and edges");
    EXPECT_EQ(error("OFF BINARY\n"), "sample: header: binary OFF is not read");
    EXPECT_EQ(error("4OFF\n"), "sample: header: does not start with \"OFF\"");
    EXPECT_EQ(error(""), "sample: header: the file is empty");
}

}  // namespace
}  // namespace raydix::test
