// The layout of .rdx files, version 2 (docs/rdx-format.md): a committed scene.
#pragma once

#include <array>
#include <cstdint>

#include "engine/scene_tables.h"
#include "io/rdx_sections.h"

namespace raydix::rdx {

/// In the order of the file.
enum SceneSectionId : std::uint32_t {
    scene_info,            // one SceneInfo
    scene_scenes,          // StoredScene
    scene_geometries,      // StoredGeometry
    scene_taken,           // uint32: ids given before, beyond SceneInfo::next_id
    scene_trees,           // StoredTree
    scene_meshes,          // StoredMesh
    scene_nodes,           // WideNode
    scene_blocks,          // TriangleBlock
    scene_compact_nodes,   // CompactNode
    scene_compact_blocks,  // CompactBlock
    scene_corners,         // Vec3: of compact blocks
    scene_vertices,        // Vec3: of meshes
    scene_triangles,       // uint32 x 3: of meshes
    scene_cameras,         // Camera
    scene_names,           // bytes: of the scene, then each camera, without separators
    scene_section_count
};

inline constexpr std::array<SectionKind, scene_section_count> scene_kinds{{
    {"info", {32}},
    {"scenes", {sizeof(StoredScene)}},
    {"geometries", {sizeof(StoredGeometry)}},
    {"taken", {sizeof(std::uint32_t)}},
    {"trees", {sizeof(StoredTree)}},
    {"meshes", {sizeof(StoredMesh)}},
    {"nodes", {sizeof(WideNode)}},
    {"blocks", {sizeof(TriangleBlock)}},
    {"compact_nodes", {sizeof(CompactNode)}},
    {"compact_blocks", {sizeof(CompactBlock)}},
    {"corners", {sizeof(Vec3)}},
    {"vertices", {sizeof(Vec3)}},
    {"triangles", {sizeof(Triangle)}},
    {"cameras", {sizeof(Camera)}},
    {"names", {1}},
}};

struct SceneInfo {
    std::uint32_t picture_width, picture_height;
    float ao_radius;
    std::uint32_t name_bytes;
    std::uint64_t next_id;
    std::uint64_t reserved;  // 0
};
static_assert(sizeof(SceneInfo) == 32);

}  // namespace raydix::rdx
