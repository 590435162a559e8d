// A committed scene and those that stand in it as flat tables, each scene and each tree once: what
// files hold of scenes (docs/rdx-format.md), and the way back. In double without trees.
#pragma once

#include <raydix/buffer.h>
#include <raydix/double.h>
#include <raydix/mesh.h>
#include <raydix/scene.h>
#include <raydix/shapes.h>
#include <raydix/wide.h>

#include <cstdint>
#include <memory>
#include <span>
#include <type_traits>
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
template <class Transform>
Transform no_transform() {
    Transform none;
    none.m = {};
    return none;
}

/// What a geometry is.
enum StoredKind : std::uint32_t { stored_mesh, stored_instance, stored_shapes };

/// In the order of their ids, scene by scene.
template <class Scalar>
struct BasicStoredGeometry {
    std::uint32_t id, mask;
    std::uint32_t kind;    // StoredKind
    std::uint32_t number;  // of the mesh, or none if it has no triangles; of the scene; of shapes
    BasicTransform<Scalar> transform;  // of an instance
};
using StoredGeometry = BasicStoredGeometry<float>;
using StoredGeometryD = BasicStoredGeometry<double>;
static_assert(sizeof(StoredGeometry) == 64 && sizeof(StoredGeometryD) == 112);

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
struct StoredShapesD {
    std::uint32_t kind, reserved;  // 0 behind it
    double radius;
    std::uint64_t count;
};
static_assert(sizeof(StoredShapesD) == 24);
template <class Scalar>
using BasicStoredShapes =
    std::conditional_t<std::is_same_v<Scalar, float>, StoredShapes, StoredShapesD>;

/// The meshes of a tree follow each other, and so do those of all trees.
struct StoredTree {
    std::uint32_t meshes, compact;
    std::uint64_t nodes, blocks, corners;  // in the sections of its kind
    Aabb bounds;
    double sah, sah_at_build, widening;
};
static_assert(sizeof(StoredTree) == 80);

/// What is written. Views of `scene` and of what it was made of, which must not change meanwhile.
template <class Scalar>
struct BasicSceneTables {
    std::vector<StoredScene> scenes;
    std::vector<BasicStoredGeometry<Scalar>> geometries;
    std::vector<StoredMesh> meshes;
    std::vector<BasicStoredShapes<Scalar>> shapes;
    std::uint64_t next_id = 0;                 // of the whole: all below were given once
    std::vector<std::uint32_t> taken;          // those above, ascending
    std::vector<BasicMeshView<Scalar>> views;  // [meshes]
    std::vector<std::span<const BasicSphere<Scalar>>> spheres;  // of each shapes of the kind
    std::vector<std::span<const BasicCapsule<Scalar>>> capsules;
    std::vector<std::span<const BasicVec3<Scalar>>> points;
    // In float alone:
    std::vector<StoredTree> trees;
    std::vector<const WideBvh*> wide;              // [trees]
    std::vector<std::span<const WideNode>> nodes;  // [trees], about the middle of the bounds
    std::vector<Buffer<WideNode>> moved_nodes;     // of trees that have them about another point
};
using SceneTables = BasicSceneTables<float>;
using SceneTablesD = BasicSceneTables<double>;
/// Throws InputError if there is no commit that holds all changes, for user geometry, and if shared
/// arrays are no longer those of the commit: "SECTION: reason".
[[nodiscard]] SceneTables tables_of(const Scene& scene);
[[nodiscard]] SceneTablesD tables_of(const SceneD& scene);

/// What is read, wherever it lies.
template <class Scalar>
struct BasicSceneArrays {
    std::span<const StoredScene> scenes;
    std::span<const BasicStoredGeometry<Scalar>> geometries;
    std::span<const StoredMesh> meshes;
    std::span<const BasicStoredShapes<Scalar>> shapes;
    std::uint64_t next_id = 0;
    std::span<const std::uint32_t> taken;
    std::span<const BasicVec3<Scalar>> vertices;
    std::span<const Triangle> triangles;
    std::span<const BasicSphere<Scalar>> spheres;
    std::span<const BasicCapsule<Scalar>> capsules;
    std::span<const BasicVec3<Scalar>> points;
    std::shared_ptr<void> owner;  // keeps all of it alive
    // In float alone:
    std::span<const StoredTree> trees = {};
    std::span<const WideNode> nodes = {};
    std::span<const TriangleBlock> blocks = {};
    std::span<const CompactNode> compact_nodes = {};
    std::span<const CompactBlock> compact_blocks = {};
    std::span<const Vec3> corners = {};
};
using SceneArrays = BasicSceneArrays<float>;
using SceneArraysD = BasicSceneArrays<double>;
/// A committed scene whose meshes and shapes, and in float trees of triangles, view the arrays.
/// Arrays may hold anything: all of it is checked first, in time and memory linear in them. The
/// same hits as the scene that was stored, bit for bit. Throws InputError("SECTION: reason").
[[nodiscard]] Scene scene_of(const SceneArrays& arrays);
/// The same; trees are built.
[[nodiscard]] SceneD scene_of(const SceneArraysD& arrays);

}  // namespace raydix
