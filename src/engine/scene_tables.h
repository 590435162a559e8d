// A committed scene and those that stand in it as flat tables, each scene and each tree once: what
// files hold of scenes (docs/rdx-format.md), and the way back.
#pragma once

#include <raydix/mesh.h>
#include <raydix/scene.h>
#include <raydix/wide.h>

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "layout/wide_bvh.h"

namespace raydix {

/// The number of what is not there.
inline constexpr std::uint32_t stored_none = 0xFFFFFFFFu;

/// Scenes come before those that they stand in; the last one is the whole.
struct StoredScene {
    std::uint32_t geometry_count;
    std::uint32_t quality, usage, compact;  // of its last commit
};
static_assert(sizeof(StoredScene) == 16);

/// Of a mesh: zeros.
inline Transform no_transform() {
    Transform none;
    none.m = {};
    return none;
}

/// In the order of their ids, scene by scene.
struct StoredGeometry {
    std::uint32_t id, mask;
    std::uint32_t is_instance;  // 0: a mesh
    std::uint32_t number;       // of the scene; of the mesh, or none if it has no triangles
    Transform transform;        // of an instance
};
static_assert(sizeof(StoredGeometry) == 64);

/// Their triangles and vertices follow each other.
struct StoredMesh {
    std::uint64_t vertices, triangles;
};
static_assert(sizeof(StoredMesh) == 16);

/// The meshes of a tree follow each other, and so do those of all trees.
struct StoredTree {
    std::uint32_t meshes, compact;
    std::uint64_t nodes, blocks, corners;  // in the sections of its kind
    Aabb bounds;
    double sah, sah_at_build, widening;
};
static_assert(sizeof(StoredTree) == 80);

/// What is written. Views of `scene` and of what it was made of, which must not change meanwhile.
struct SceneTables {
    std::vector<StoredScene> scenes;
    std::vector<StoredGeometry> geometries;
    std::vector<StoredTree> trees;
    std::vector<StoredMesh> meshes;
    std::uint64_t next_id = 0;         // of the whole: all below were given once
    std::vector<std::uint32_t> taken;  // those above, ascending
    std::vector<const WideBvh*> wide;  // [trees]
    std::vector<MeshView> views;       // [meshes]
};
/// Throws InputError if there is no commit that holds all changes, or if shared arrays are no
/// longer those of the commit: "SECTION: reason".
[[nodiscard]] SceneTables tables_of(const Scene& scene);

/// What is read, wherever it lies.
struct SceneArrays {
    std::span<const StoredScene> scenes;
    std::span<const StoredGeometry> geometries;
    std::span<const StoredTree> trees;
    std::span<const StoredMesh> meshes;
    std::uint64_t next_id = 0;
    std::span<const std::uint32_t> taken;
    std::span<const WideNode> nodes;
    std::span<const TriangleBlock> blocks;
    std::span<const CompactNode> compact_nodes;
    std::span<const CompactBlock> compact_blocks;
    std::span<const Vec3> corners;
    std::span<const Vec3> vertices;
    std::span<const Triangle> triangles;
    std::shared_ptr<void> owner;  // keeps all of it alive
};
/// A committed scene whose trees of triangles and meshes view the arrays. Arrays may hold anything:
/// all of it is checked first, in time and memory linear in them. The same hits as the scene that
/// was stored, bit for bit. Throws InputError("SECTION: reason").
[[nodiscard]] Scene scene_of(const SceneArrays& arrays);

}  // namespace raydix
