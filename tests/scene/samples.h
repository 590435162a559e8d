// One small mesh in every format, written by hand, and the readers behind one call.
#pragma once

#include <raydix/error.h>
#include <raydix/mesh.h>

#include <boost/iostreams/copy.hpp>
#include <boost/iostreams/device/array.hpp>
#include <boost/iostreams/device/back_inserter.hpp>
#include <boost/iostreams/filter/gzip.hpp>
#include <boost/iostreams/filter/lzma.hpp>
#include <boost/iostreams/filter/zstd.hpp>
#include <boost/iostreams/filtering_stream.hpp>

#include <algorithm>
#include <array>
#include <cstring>
#include <functional>
#include <string>
#include <vector>

#include "scene/formats.h"

namespace raydix::test {

/// The bytes of a value, turned round for big-endian files.
template <class T>
std::string raw(T value, bool big_endian = false) {
    std::array<char, sizeof(T)> bytes;
    std::memcpy(bytes.data(), &value, sizeof(T));
    if (big_endian) std::reverse(bytes.begin(), bytes.end());
    return {bytes.begin(), bytes.end()};
}

using Loader = std::function<Mesh(ByteSource&)>;

inline Mesh load(const Loader& loader, std::string_view bytes, Packing packing = Packing::none) {
    ByteSource in = ByteSource::from_memory(bytes, "sample", packing);
    Mesh mesh = loader(in);
    in.finish();
    return mesh;
}

/// The text of the InputError that the reader throws, empty if it does not.
inline std::string error_of(const Loader& loader, std::string_view bytes,
                            Packing packing = Packing::none) {
    try {
        static_cast<void>(load(loader, bytes, packing));
    } catch (const InputError& error) {
        return error.what();
    }
    return {};
}

inline std::string pack(std::string_view bytes, Packing packing) {
    namespace io = boost::iostreams;
    std::string packed;
    io::filtering_ostream out;
    if (packing == Packing::gzip) out.push(io::gzip_compressor());
    if (packing == Packing::xz) out.push(io::lzma_compressor());
    if (packing == Packing::zstd) out.push(io::zstd_compressor());
    out.push(io::back_inserter(packed));
    io::copy(io::array_source(bytes.data(), bytes.size()), out);
    return packed;
}

/// A quad as two triangles: (0,0,0) (1,0,0) (1,1,0) (0,1,-0.5), fanned from the first corner.
inline constexpr std::array<Vec3, 4> quad{{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, -0.5f}}};

inline std::string quad_positions(bool big_endian = false) {
    std::string bytes;
    for (const Vec3& p : quad)
        bytes += raw(p.x, big_endian) + raw(p.y, big_endian) + raw(p.z, big_endian);
    return bytes;
}

inline std::string ascii_ply() {
    return "ply\nformat ascii 1.0\ncomment a quad\nelement vertex 4\nproperty float x\nproperty "
           "float y\n"
           "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
           "0 0 0\n1 0 0\n1 1 0\n0 1 -0.5\n4 0 1 2 3\n";
}

inline std::string binary_ply(bool big_endian) {
    std::string bytes =
        std::string("ply\nformat binary_") + (big_endian ? "big" : "little") +
        "_endian 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
        "element face 2\nproperty list uchar int vertex_indices\nend_header\n";
    bytes += quad_positions(big_endian);
    for (const Triangle& t : {Triangle{0, 1, 2}, Triangle{0, 2, 3}}) {
        bytes += '\3';
        for (const std::uint32_t index : t) bytes += raw(index, big_endian);
    }
    return bytes;
}

inline std::string ascii_stl() {
    return "solid quad\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 1 1 "
           "0\nendloop\nendfacet\n"
           "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 1 0\nvertex 0 1 "
           "-0.5\nendloop\nendfacet\n"
           "endsolid quad\n";
}

inline std::string binary_stl(std::uint32_t count = 2) {
    std::string bytes(80, ' ');
    bytes.replace(0, 5, "solid");
    bytes += raw(count);
    for (const Triangle& t : {Triangle{0, 1, 2}, Triangle{0, 2, 3}}) {
        bytes += std::string(12, '\0');
        for (const std::uint32_t i : t) bytes += raw(quad[i].x) + raw(quad[i].y) + raw(quad[i].z);
        bytes += std::string(2, '\0');
    }
    return bytes;
}

inline std::string npy(const std::string& type, const std::string& order, const std::string& shape,
                       const std::string& body) {
    std::string head =
        "{'descr': '" + type + "', 'fortran_order': " + order + ", 'shape': " + shape + ", }";
    while ((head.size() + 11) % 64 != 0) head += ' ';
    head += '\n';
    return "\x93NUMPY" + std::string("\1\0", 2) + raw(static_cast<std::uint16_t>(head.size())) +
           head + body;
}

inline std::string gltf_json(const std::string& buffer) {
    return R"({"asset":{"version":"2.0"},"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],)"
           R"("meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1}]}],)"
           R"("accessors":[{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3"},)"
           R"({"bufferView":1,"componentType":5121,"count":6,"type":"SCALAR"}],)"
           R"("bufferViews":[{"buffer":0,"byteLength":48},{"buffer":0,"byteOffset":48,"byteLength":6}],)"
           R"("buffers":[{)" +
           buffer + R"("byteLength":54}]})";
}

inline std::string gltf_buffer() { return quad_positions() + std::string("\0\1\2\0\2\3", 6); }

inline std::string glb() {
    std::string text = gltf_json("");
    text.resize((text.size() + 3) / 4 * 4, ' ');
    std::string binary = gltf_buffer();
    binary.resize((binary.size() + 3) / 4 * 4, '\0');
    const auto length = [](std::size_t n) { return raw(static_cast<std::uint32_t>(n)); };
    return "glTF" + raw(std::uint32_t{2}) + length(28 + text.size() + binary.size()) +
           length(text.size()) + "JSON" + text + length(binary.size()) + std::string("BIN\0", 4) +
           binary;
}

/// One mesh of all nodes. External files of a glTF document all hold the quad.
inline Mesh load_gltf_sample(ByteSource& in) {
    static const std::string external = gltf_buffer();
    Model model = load_gltf(in, [](const std::filesystem::path&) {
        return ByteSource::from_memory(external, "external");
    });
    model.name = "sample";
    model.flatten();
    return std::move(model).mesh();
}

struct Sample {
    std::string name, bytes;
    Loader loader;
    bool has_triangles = true;
};

inline std::vector<Sample> samples() {
    return {
        {"ply_ascii", ascii_ply(), load_ply},
        {"ply_little", binary_ply(false), load_ply},
        {"ply_big", binary_ply(true), load_ply},
        {"obj", "# quad\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 -0.5\nf 1/1/1 2//1 3/1 4\n", load_obj},
        {"stl_ascii", ascii_stl(), load_stl},
        {"stl_binary", binary_stl(), load_stl},
        {"off", "OFF\n4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 -0.5\n4 0 1 2 3\n", load_off},
        {"xyz", "0 0 0\n1 0 0\n1 1 0\n0 1 -0.5\n", load_xyz, false},
        {"npy", npy("<f4", "False", "(4, 3)", quad_positions()), load_npy_points, false},
        {"gltf", gltf_json(R"("uri":"quad.bin",)"), load_gltf_sample},
        {"glb", glb(), load_gltf_sample},
    };
}

}  // namespace raydix::test
