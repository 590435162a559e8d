// The layout of .rdx files, versions 2 to 4 (docs/rdx-format.md): a committed scene. Version 3 has
// shapes too; version 4 is in double, without trees.
#pragma once

#include <array>
#include <cstdint>
#include <span>

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
    scene_section_count,
    // Of version 3:
    scene_shapes = scene_section_count,  // StoredShapes
    scene_spheres,                       // Sphere
    scene_capsules,                      // Capsule
    scene_points,                        // Vec3
    shapes_section_count
};

inline constexpr std::array<SectionKind, shapes_section_count> scene_kinds{{
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
    {"shapes", {sizeof(StoredShapes)}},
    {"spheres", {sizeof(Sphere)}},
    {"capsules", {sizeof(Capsule)}},
    {"points", {sizeof(Vec3)}},
}};

/// Of version 4, in the order of the file.
enum SceneSectionIdD : std::uint32_t {
    double_info,  // as above, with elements in double
    double_scenes,
    double_geometries,
    double_taken,
    double_meshes,
    double_vertices,
    double_triangles,
    double_cameras,
    double_names,
    double_shapes,
    double_spheres,
    double_capsules,
    double_points,
    double_section_count
};

inline constexpr std::array<SectionKind, double_section_count> double_kinds{{
    {"info", {32}},
    {"scenes", {sizeof(StoredScene)}},
    {"geometries", {sizeof(StoredGeometryD)}},
    {"taken", {sizeof(std::uint32_t)}},
    {"meshes", {sizeof(StoredMesh)}},
    {"vertices", {sizeof(Vec3d)}},
    {"triangles", {sizeof(Triangle)}},
    {"cameras", {sizeof(CameraD)}},
    {"names", {1}},
    {"shapes", {sizeof(StoredShapesD)}},
    {"spheres", {sizeof(SphereD)}},
    {"capsules", {sizeof(CapsuleD)}},
    {"points", {sizeof(Vec3d)}},
}};

/// Of a file that holds a scene.
[[nodiscard]] inline std::span<const SectionKind> scene_kinds_of(std::uint32_t file_version) {
    if (file_version == double_version) return double_kinds;
    return std::span(scene_kinds)
        .first(file_version == shapes_version ? shapes_section_count : scene_section_count);
}

struct SceneInfo {
    std::uint32_t picture_width, picture_height;
    float ao_radius;
    std::uint32_t name_bytes;
    std::uint64_t next_id;
    std::uint64_t reserved;  // 0
};
static_assert(sizeof(SceneInfo) == 32);

}  // namespace raydix::rdx
