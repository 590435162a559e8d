// The layout of .rdx files (docs/rdx-format.md): one header with a table of sections, then the
// sections, each at the next multiple of 64 bytes. Little-endian throughout. Version 1 holds a
// tree, versions 2 and 3 a scene, version 4 one in double (rdx_scene_format.h).
#pragma once

#include <raydix/bvh.h>

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <type_traits>

namespace raydix::rdx {

/// The first byte is no ASCII, and a transfer that alters line ends breaks the rest.
inline constexpr std::array<unsigned char, 8> magic{0x89, 'r', 'd', 'x', '\r', '\n', 0x1a, '\n'};
inline constexpr std::uint32_t version = 1, scene_version = 2, shapes_version = 3,
                               double_version = 4;
inline constexpr std::size_t alignment = 64;

/// Of version 1, in the order of the file.
enum SectionId : std::uint32_t {
    info,        // one Info
    nodes,       // BvhNode [2 * inner_count + 2], or none
    order,       // uint32 [references]
    primitives,  // LeafTriangle, Aabb or Vec3 [references], by kind
    vertices,    // Vec3, the mesh
    triangles,   // uint32 x 3, the mesh
    cameras,     // Camera
    names,       // bytes: scene, mesh, then each camera, without separators
    section_count
};

using Checksum = std::array<unsigned char, 16>;

struct Section {
    std::uint64_t offset;  // from the start of the file
    std::uint64_t count;   // elements
    std::uint32_t id;
    std::uint32_t element_bytes;
    Checksum checksum;  // XXH3-128 of the elements, in its canonical byte order
};
static_assert(sizeof(Section) == 40);

/// What every version begins with; the table of sections follows.
struct HeaderStart {
    std::array<unsigned char, 8> magic;
    std::uint32_t version;
    std::uint32_t section_count;
    std::uint64_t file_bytes;
    Checksum checksum;  // XXH3-128 of the whole header, its table included, with zeros here
    std::array<unsigned char, 24> reserved;
};
static_assert(sizeof(HeaderStart) == 64);

/// Of version 1.
struct Header : HeaderStart {
    std::array<Section, rdx::section_count> sections;
};
static_assert(sizeof(Header) == 384 && std::is_trivially_copyable_v<Header>);

/// Of Info::flags.
inline constexpr std::uint32_t strict_flag = 1, refitted_flag = 2;

struct Info {
    std::uint32_t kind, builder, bits;
    std::uint16_t max_leaf, reinsertion_rounds;
    std::uint32_t flags;
    std::uint32_t inner_count, max_depth;
    std::uint32_t picture_width, picture_height;
    float ao_radius;
    std::uint32_t scene_name_bytes, mesh_name_bytes;
    std::uint64_t input_count, left_out;
};
static_assert(sizeof(Info) == 64);

struct Camera {
    Vec3 position, target, up;
    float vfov;
    std::uint32_t name_bytes;
};
static_assert(sizeof(Camera) == 44);

/// Of version 4.
struct CameraD {
    Vec3d position, target, up;
    double vfov;
    std::uint32_t name_bytes, reserved;  // 0 behind it
};
static_assert(sizeof(CameraD) == 88);

[[nodiscard]] constexpr std::uint64_t aligned(std::uint64_t offset) {
    return (offset + alignment - 1) / alignment * alignment;
}

[[nodiscard]] constexpr std::uint32_t primitive_bytes(PrimitiveKind kind) {
    switch (kind) {
        case PrimitiveKind::triangles:
            return sizeof(LeafTriangle);
        case PrimitiveKind::boxes:
            return sizeof(Aabb);
        case PrimitiveKind::points:
            break;
    }
    return sizeof(Vec3);
}

[[nodiscard]] Checksum checksum_of(std::span<const std::byte> bytes);
/// Of bytes that lie in several places.
[[nodiscard]] Checksum checksum_of(std::span<const std::span<const std::byte>> pieces);
/// Of a header with its table, whatever its own checksum field holds.
[[nodiscard]] Checksum header_checksum(std::span<const std::byte> header);

/// The arrays are written and mapped as they lie in memory.
inline constexpr bool supported = std::endian::native == std::endian::little;
inline constexpr std::string_view unsupported_text =
    ".rdx files are little-endian and are not converted on this machine";

}  // namespace raydix::rdx
