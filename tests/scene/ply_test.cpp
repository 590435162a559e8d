#include <gtest/gtest.h>

#include <cmath>

#include "samples.h"

namespace raydix::test {
namespace {

std::string head(const std::string& format, const std::string& elements) {
    return "ply\nformat " + format + " 1.0\n" + elements + "end_header\n";
}
const std::string xyz = "property float x\nproperty float y\nproperty float z\n";
const std::string faces = "property list uchar int vertex_indices\n";
const std::string three_corners = "0 0 0\n1 0 0\n0 1 0\n";

TEST(Ply, polygons_are_fanned_and_short_ones_give_nothing) {
    const Mesh mesh =
        load(load_ply, head("ascii", "element vertex 3\n" + xyz + "element face 4\n" + faces) +
                           three_corners + "0\n1 2\n2 0 1\n5 0 1 2 0 1\n");
    const std::vector<Triangle> expected{{0, 1, 2}, {0, 2, 0}, {0, 0, 1}};
    EXPECT_EQ(mesh.triangles, expected);
}

TEST(Ply, other_elements_properties_and_types) {
    std::string bytes =
        head("binary_little_endian",
             "element face 1\nproperty uchar c\nproperty list ushort short vertex_index\n"
             "element junk 2\nproperty list int double d\nelement vertex 3\nproperty double z\n"
             "property list uchar float n\nproperty short x\nproperty double y\n");
    bytes += '\7' + raw(std::uint16_t{3});
    for (const std::int16_t index : std::initializer_list<std::int16_t>{2, 1, 0})
        bytes += raw(index);
    bytes += raw(1) + raw(2.0) + raw(0);
    for (int i = 0; i < 3; ++i)
        bytes +=
            raw(0.1 * i) + '\1' + raw(9.0f) + raw(static_cast<std::int16_t>(-i)) + raw(1e300 * i);
    const Mesh mesh = load(load_ply, bytes);
    ASSERT_EQ(mesh.vertices.size(), 3u);
    EXPECT_EQ(mesh.triangles, (std::vector<Triangle>{{2, 1, 0}}));
    EXPECT_EQ(mesh.vertices[2].x, -2.0f);
    EXPECT_EQ(mesh.vertices[2].y, infinity);
    EXPECT_EQ(mesh.vertices[2].z, 0.2f);
}

TEST(Ply, strips_with_restarts) {
    const Mesh mesh = load(
        load_ply, head("ascii", "element vertex 4\n" + xyz +
                                    "element tristrips 1\nproperty list int int vertex_indices\n") +
                      three_corners + "1 1 0\n8 0 1 2 3 -1 1 2 3\n");
    EXPECT_EQ(mesh.triangles, (std::vector<Triangle>{{0, 1, 2}, {2, 1, 3}, {1, 2, 3}}));
}

TEST(Ply, line_ends_of_old_and_windows) {
    for (const std::string end : {"\r\n", "\r"}) {
        std::string bytes;
        for (const char c : ascii_ply()) bytes += c == '\n' ? end : std::string(1, c);
        EXPECT_EQ(load(load_ply, bytes).triangles.size(), 2u);
    }
    std::string bytes = binary_ply(false);
    const std::size_t body = bytes.find("end_header\n") + 11;
    std::string header;
    for (const char c : bytes.substr(0, body))
        header += c == '\n' ? std::string("\r\n") : std::string(1, c);
    EXPECT_EQ(load(load_ply, header + bytes.substr(body)).triangles.size(), 2u);
}

TEST(Ply, large_file_crosses_blocks) {
    constexpr std::uint32_t n = 100'000;
    std::string bytes =
        head("binary_little_endian", "element vertex " + std::to_string(n) + "\n" + xyz +
                                         "element face " + std::to_string(n) + "\n" + faces);
    for (std::uint32_t i = 0; i < n; ++i) bytes += raw(float(i)) + raw(0.5f) + raw(-float(i));
    for (std::uint32_t i = 0; i < n; ++i) {
        const bool is_quad = i % 1000 == 7;
        bytes += is_quad ? '\4' : '\3';
        for (std::uint32_t k = 0; k < (is_quad ? 4u : 3u); ++k) bytes += raw((i + k) % n);
    }
    const Mesh mesh = load(load_ply, bytes);
    ASSERT_EQ(mesh.vertices.size(), n);
    ASSERT_EQ(mesh.triangles.size(), n + n / 1000);
    EXPECT_EQ(mesh.vertices.back().x, float(n - 1));
    EXPECT_EQ(mesh.triangles.back(), (Triangle{n - 1, 0, 1}));
    EXPECT_EQ(load(load_ply, pack(bytes, Packing::zstd), Packing::zstd).triangles, mesh.triangles);
}

TEST(Ply, says_what_is_wrong) {
    const std::string vertices = "element vertex 3\n" + xyz;
    const auto error = [](const std::string& bytes) { return error_of(load_ply, bytes); };
    EXPECT_EQ(error(head("ascii", vertices) + "0 0 0\n1 1\n"),
              "sample: vertex 2: line 9 ends before z");
    EXPECT_EQ(error(head("ascii", vertices) + "0 0 x\n"),
              "sample: vertex 1: \"x\" cannot be z (line 8)");
    EXPECT_EQ(error(head("ascii", vertices) + "0 0 0\n"),
              "sample: vertex 2: file ends after 1 of 3");
    EXPECT_EQ(error(head("ascii", vertices + "element face 2\n" + faces) + three_corners +
                    "3 0 1 2\n3 0 1 3\n"),
              "sample: face 2: index 3 of 3 vertices");
    EXPECT_EQ(
        error(head("ascii", vertices + "element face 1\n" + faces) + three_corners + "3 0 1 -1\n"),
        "sample: face 1: index -1 of 3 vertices");
    EXPECT_EQ(
        error(head("ascii", vertices + "element face 1\n" + faces) + three_corners + "-3 0 1 2\n"),
        "sample: face 1: a list of -3 items");
    EXPECT_EQ(error(head("middle_endian", vertices)),
              "sample: line 2: unknown format \"middle_endian\"");
    EXPECT_EQ(error(head("ascii", "element vertex -1\n")),
              "sample: line 3: expected \"element NAME COUNT\" with a count from 0 to 2^63 - 1");
    EXPECT_EQ(error(head("ascii", "element vertex 1\nproperty float x\n")),
              "sample: header: vertices need the properties x, y and z, each a number");
    EXPECT_EQ(error("ply\nformat ascii 1.0\n"), "sample: header: file ends before end_header");
    std::string bytes = binary_ply(false);
    bytes.back() = '\x80';
    EXPECT_EQ(error(bytes), "sample: face 2: index -2147483645 of 4 vertices");
}

TEST(Ply, false_counts_cost_nothing) {
    for (const std::string format : {"ascii", "binary_little_endian", "binary_big_endian"}) {
        EXPECT_NE(
            error_of(load_ply, head(format, "element vertex 353535235358\n" + xyz) + "0 0 0\n"),
            "");
        EXPECT_NE(
            error_of(
                load_ply,
                head(format,
                     "element junk 9223372036854775807\nproperty double d\nelement vertex 1\n" +
                         xyz)),
            "");
        EXPECT_EQ(load(load_ply,
                       head(format, "element junk 9223372036854775807\nelement vertex 0\n" + xyz))
                      .vertices.size(),
                  0u);
    }
    const std::string list = head(
        "binary_little_endian",
        "element vertex 0\n" + xyz + "element face 1\nproperty list uint uint vertex_indices\n");
    EXPECT_EQ(error_of(load_ply, list + "\xFF\xFF\xFF\xFF"),
              "sample: face 1: file ends after 0 of 1");
}

TEST(Ply, long_names_are_cut_in_messages) {
    const std::string name(500, '\xFF');
    const std::string message = error_of(
        load_ply, head("binary_big_endian",
                       "element " + name + " 2\nproperty float x\nelement vertex 0\n" + xyz));
    EXPECT_LT(message.size(), 300u);
    EXPECT_NE(message.find("\\xFF...: file ends before all 2 of them"), std::string::npos)
        << message;
}

}  // namespace
}  // namespace raydix::test
