// A committed scene and those that stand in it as flat tables, each scene and each tree once: what
// files hold of scenes (docs/rdx-format.md), and the way back.
#pragma once

#include <raydix/mesh.h>
#include <raydix/scene.h>
#include <raydix/shapes.h>
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

/// Of what is no instance: zeros.
inline Transform no_transform() {
    Transform none;
    none.m = {};
    return none;
}

/// What a geometry is.
enum StoredKind : std::uint32_t { stored_mesh, stored_instance, stored_shapes };

/// In the order of their ids, scene by scene.
struct StoredGeometry {
    std::uint32_t id, mask;
    std::uint32_t kind;    // StoredKind
    std::uint32_t number;  // of the mesh, or none if it has no triangles; of the scene; of shapes
    Transform transform;   // of an instance
};
static_assert(sizeof(StoredGeometry) == 64);

/// Their triangles and vertices follow each other.
struct StoredMesh {
    std::uint64_t vertices, triangles;
};
static_assert(sizeof(StoredMesh) == 16);

/// Spheres, capsules or points, by the order of `Shapes`; those of a kind follow each other.
struct StoredShapes {
    std::uint32_t kind;  // 0 to 2
    float radius;        // of points; else 0
    std::uint64_t count;
};
static_assert(sizeof(StoredShapes) == 16);

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
    std::vector<StoredShapes> shapes;
    std::uint64_t next_id = 0;                     // of the whole: all below were given once
    std::vector<std::uint32_t> taken;              // those above, ascending
    std::vector<const WideBvh*> wide;              // [trees]
    std::vector<MeshView> views;                   // [meshes]
    std::vector<std::span<const Sphere>> spheres;  // of each shapes of the kind
    std::vector<std::span<const Capsule>> capsules;
    std::vector<std::span<const Vec3>> points;
};
/// Throws InputError if there is no commit that holds all changes, or if shared arrays are no
/// longer those of the commit, or for user geometry: "SECTION: reason".
[[nodiscard]] SceneTables tables_of(const Scene& scene);

/// What is read, wherever it lies.
struct SceneArrays {
    std::span<const StoredScene> scenes;
    std::span<const StoredGeometry> geometries;
    std::span<const StoredTree> trees;
    std::span<const StoredMesh> meshes;
    std::span<const StoredShapes> shapes;
    std::uint64_t next_id = 0;
    std::span<const std::uint32_t> taken;
    std::span<const WideNode> nodes;
    std::span<const TriangleBlock> blocks;
    std::span<const CompactNode> compact_nodes;
    std::span<const CompactBlock> compact_blocks;
    std::span<const Vec3> corners;
    std::span<const Vec3> vertices;
    std::span<const Triangle> triangles;
    std::span<const Sphere> spheres;
    std::span<const Capsule> capsules;
    std::span<const Vec3> points;
    std::shared_ptr<void> owner;  // keeps all of it alive
};
/// A committed scene whose trees of triangles, meshes and shapes view the arrays. Arrays may hold
/// anything: all of it is checked first, in time and memory linear in them. The same hits as the
/// scene that was stored, bit for bit. Throws InputError("SECTION: reason").
[[nodiscard]] Scene scene_of(const SceneArrays& arrays);

}  // namespace raydix
