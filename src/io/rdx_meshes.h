// Where the meshes of an .rdx file lie in it, for readers that read parts of a file.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

namespace raydix::rdx {

/// Vec3 and Triangle one after the other, from these bytes of the file on.
struct MeshPlace {
    std::uint64_t vertices_begin, vertices;
    std::uint64_t triangles_begin, triangles;
};

/// The meshes of a tree, or of a scene in the order of its geometries. Nothing if the file holds
/// anything besides meshes in float that all rays see: boxes, instances, shapes, masks, doubles.
/// Header, places of sections and counts are checked; checksums of sections are not, because all of
/// the file would be read. Throws InputError("FILE: SECTION: reason").
[[nodiscard]] std::optional<std::vector<MeshPlace>> mesh_places(const std::filesystem::path& file);

}  // namespace raydix::rdx
