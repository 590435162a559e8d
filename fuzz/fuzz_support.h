// What the fuzz targets of the mesh readers share: any bytes -> a sound mesh or an InputError, else
// a trap.
#pragma once

#include <raydix/error.h>
#include <raydix/mesh.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "scene/byte_source.h"

namespace raydix::fuzz {

inline void require(bool holds) {
    if (!holds) __builtin_trap();
}

inline void check_mesh(const Mesh& mesh) {
    for (const Triangle& triangle : mesh.triangles)
        for (const std::uint32_t index : triangle) require(index < mesh.vertices.size());
    for (const Vec3& p : mesh.vertices)
        for (const float x : {p.x, p.y, p.z}) require(x != 0.0f || !std::signbit(x));
    if (mesh.vertices.empty()) return;
    const MeshInfo info = inspect(mesh);
    require(info.left_out_triangles <= mesh.triangles.size());
}

/// Messages must be one printable line.
inline void check_message(std::string_view message) {
    for (const char c : message) require(static_cast<unsigned char>(c) >= 0x20);
    require(message.size() < 1000);
}

/// Runs `read` on the bytes as a source of their own.
template <class Read>
void run(const std::uint8_t* data, std::size_t size, Read read, Packing packing = Packing::none) {
    try {
        const std::string_view bytes(reinterpret_cast<const char*>(data), size);
        ByteSource in = ByteSource::from_memory(bytes, "input", packing);
        read(in);
    } catch (const InputError& error) {
        check_message(error.what());
    }
}

}  // namespace raydix::fuzz
