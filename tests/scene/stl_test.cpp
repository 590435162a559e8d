#include <gtest/gtest.h>

#include "samples.h"

namespace raydix::test {
namespace {

TEST(Stl, three_vertices_per_facet_in_file_order) {
    for (const std::string& bytes : {ascii_stl(), binary_stl()}) {
        const Mesh mesh = load(load_stl, bytes);
        EXPECT_EQ(mesh.vertices.size(), 6u);
        EXPECT_EQ(mesh.triangles, (std::vector<Triangle>{{0, 1, 2}, {3, 4, 5}}));
    }
}

TEST(Stl, several_solids_capitals_and_none) {
    EXPECT_EQ(load(load_stl, ascii_stl() + "\r\n" + ascii_stl()).triangles.size(), 4u);
    std::string capitals = ascii_stl();
    for (char& c : capitals) c = static_cast<char>(std::toupper(c));
    capitals.replace(0, 5, "solid");
    EXPECT_EQ(load(load_stl, capitals).triangles.size(), 2u);
    EXPECT_EQ(load(load_stl, "solid\nendsolid\n").vertices.size(), 0u);
}

TEST(Stl, counts_decide) {
    EXPECT_EQ(load(load_stl, binary_stl(1)).triangles.size(), 1u);  // what follows is not looked at
    EXPECT_EQ(error_of(load_stl, binary_stl(3)), "sample: facet 3: file ends after 2 of 3 facets");
    EXPECT_EQ(error_of(load_stl, binary_stl(0xFFFFFFFF)),
              "sample: facet 3: file ends after 2 of 4294967295 facets");
}

TEST(Stl, says_what_is_wrong) {
    const auto error = [](const std::string& bytes) { return error_of(load_stl, bytes); };
    const std::string open = "solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n";
    EXPECT_EQ(error(open + "endloop\nendfacet\nendsolid\n"),
              "sample: facet 1: 2 vertices instead of 3");
    EXPECT_EQ(error(open), "sample: facet 1: file ends before endsolid");
    EXPECT_EQ(error(open + "vertex 1 x 0\n"), "sample: facet 1: \"x\" is not a number in line 6");
    EXPECT_EQ(error(open + "hello\n"), "sample: line 6: \"hello\" is not an STL statement");
    EXPECT_EQ(error("solid\nvertex 0 0 0\n"), "sample: line 2: \"vertex\" out of place");
    EXPECT_EQ(error(""),
              "sample: header: neither \"solid\" nor the 84 bytes of a binary STL header");
}

}  // namespace
}  // namespace raydix::test
