// What holds for every format alike: the same quad comes out, packed or not, and a file cut off
// anywhere gives a result or an InputError.
#include <gtest/gtest.h>

#include <cmath>

#include "base/math.h"
#include "samples.h"

namespace raydix::test {
namespace {

void expect_quad(const Mesh& mesh, const Sample& sample) {
    if (!sample.has_triangles) {
        ASSERT_TRUE(mesh.is_point_cloud()) << sample.name;
        ASSERT_EQ(mesh.vertices.size(), 4u) << sample.name;
        for (std::size_t i = 0; i < 4; ++i) EXPECT_TRUE(mesh.vertices[i] == quad[i]) << sample.name;
        return;
    }
    ASSERT_EQ(mesh.triangles.size(), 2u) << sample.name;
    constexpr std::array<std::array<std::size_t, 3>, 2> expected{{{0, 1, 2}, {0, 2, 3}}};
    for (std::size_t t = 0; t < 2; ++t)
        for (std::size_t k = 0; k < 3; ++k)
            EXPECT_TRUE(mesh.vertices.at(mesh.triangles[t][k]) == quad[expected[t][k]])
                << sample.name;
}

TEST(Formats, same_quad_from_all_packed_or_not) {
    for (const Sample& sample : samples()) {
        expect_quad(load(sample.loader, sample.bytes), sample);
        for (const Packing packing : {Packing::gzip, Packing::xz, Packing::zstd})
            expect_quad(load(sample.loader, pack(sample.bytes, packing), packing), sample);
    }
}

TEST(Formats, no_negative_zero) {
    for (Sample& sample : std::vector<Sample>{
             {"ply",
              "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float "
              "y\nproperty float z\n"
              "end_header\n-0 -0.0 -1e-99\n",
              load_ply},
             {"obj", "v -0 -0.0 -1e-99\n", load_obj},
             {"xyz", "-0 -0.0 -1e-99\n", load_xyz},
             {"npy", npy("<f8", "False", "(1, 3)", raw(-0.0) + raw(-0.0) + raw(-1e-99)),
              load_npy_points},
             {"off", "OFF\n1 0 0\n-0 -0.0 -1e-99\n", load_off}}) {
        const Mesh mesh = load(sample.loader, sample.bytes);
        ASSERT_EQ(mesh.vertices.size(), 1u) << sample.name;
        const Vec3 p = mesh.vertices[0];
        for (const float x : {p.x, p.y, p.z}) {
            EXPECT_EQ(x, 0.0f) << sample.name;
            EXPECT_FALSE(std::signbit(x)) << sample.name;
        }
    }
}

TEST(Formats, cut_off_anywhere) {
    for (const Sample& sample : samples()) {
        std::size_t errors = 0;
        for (std::size_t length = 0; length < sample.bytes.size(); ++length) {
            const std::string message =
                error_of(sample.loader, std::string_view(sample.bytes).substr(0, length));
            errors += message.empty() ? 0 : 1;
            EXPECT_EQ(message.find('\n'), std::string::npos) << message;
            EXPECT_TRUE(message.empty() || message.starts_with("sample: ")) << message;
        }
        const bool states_its_length = sample.name.find("ply") != std::string::npos ||
                                       sample.name == "stl_binary" || sample.name == "npy" ||
                                       sample.name == "glb";
        const std::size_t unnoticed = 4;  // the last digits of a text
        EXPECT_GE(errors, states_its_length ? sample.bytes.size() - unnoticed : 0) << sample.name;
    }
}

TEST(Formats, packed_and_cut_off_is_an_error) {
    for (const Packing packing : {Packing::gzip, Packing::xz, Packing::zstd}) {
        const std::string packed = pack("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", packing);
        for (std::size_t length = 1; length < packed.size(); ++length)
            EXPECT_NE(error_of(load_obj, std::string_view(packed).substr(0, length), packing), "")
                << "packing " << int(packing) << ", " << length << " of " << packed.size()
                << " bytes";
    }
}

TEST(Formats, altered_bytes_never_escape) {
    for (const Sample& sample : samples()) {
        for (std::size_t i = 0; i < sample.bytes.size(); ++i) {
            for (const char change : {'\0', '-', '9', '\xFF'}) {
                std::string bytes = sample.bytes;
                bytes[i] = change;
                // any other exception fails the test
                static_cast<void>(error_of(sample.loader, bytes));
            }
        }
    }
}

}  // namespace
}  // namespace raydix::test