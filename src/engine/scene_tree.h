// What a commit makes of a scene: trees over triangles, and a tree over those and the instances.
// Nothing in it changes while anyone but its scene holds it, so that any number of threads and of
// other scenes may use it (moved_instances.h).
#pragma once

#include <raydix/buffer.h>
#include <raydix/scene.h>
#include <raydix/wide.h>

#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <utility>
#include <vector>

#include "engine/affine.h"
#include "engine/extent.h"
#include "engine/grouped_meshes.h"
#include "engine/mesh_name.h"
#include "engine/support.h"
#include "exec/path_rates.h"
#include "exec/recycler.h"
#include "layout/wide_bvh.h"
#include "trace/simd/wide_ray.h"

namespace raydix {

class WideRefitter;    // layout/wide_refit.h
struct FlatTriangles;  // near_scene.h
struct NearScene;      // near_scene.h

/// The triangles of a mesh tree that rays never hit, for queries of distance. Made when the first
/// of them asks (flat_triangles_of); commits that keep the tree keep them.
struct KeptFlatTriangles {
    std::once_flag asked;
    std::shared_ptr<const FlatTriangles> known;  // null: there are none
};

/// One tree over the triangles of one mesh or of several, which follow each other by id.
struct MeshTree : GroupedMeshes {
    std::shared_ptr<const WideBvh> tree;
    WideView view{};                         // without room for a compact tree's blocks
    std::size_t stack_size = 0;              // of the deepest path; 0: no ray hits anything
    std::shared_ptr<WideRefitter> refitter;  // null before the first refit
    std::shared_ptr<KeptFlatTriangles> flats = std::make_shared<KeptFlatTriangles>();
    /// Of trees that were built for the same meshes; none where this one was refitted.
    std::optional<Recycler<WideBvh>> memory;

    void set_tree(std::shared_ptr<const WideBvh> to) {
        tree = std::move(to);
        view = view_of(tree->arrays());
        stack_size = tree->empty() ? 0 : wide_stack_capacity(tree->stats().max_depth);
    }
};

struct SceneTree;
struct ShapeTree;  // shape_tree.h

/// The way into an instance: the inverse of its transform by columns, of x, y and z, and the move.
struct WayIn {
    alignas(32) double columns[4][4];
    std::uint32_t mask;

    WayIn(const Affine& inverse, std::uint32_t seen_by)
        : columns{{inverse.x.x, inverse.y.x, inverse.z.x, 0},
                  {inverse.x.y, inverse.y.y, inverse.z.y, 0},
                  {inverse.x.z, inverse.y.z, inverse.z.z, 0},
                  {inverse.move.x, inverse.move.y, inverse.move.z, 0}},
          mask(seen_by) {}
};

/// A scene that rays enter by one instance, or by several in turn: what stands in instances of
/// instances is placed in the outermost scene, so that rays need not go through the trees between.
struct PlacedScene {
    WayIn way;
    std::uint32_t number;       // of the path that ends here
    std::uint32_t first, more;  // further ways in SceneTree::ways, from the outside inward
    const SceneTree* scene;     // kept by SceneTree::instances, or by theirs
    const MeshTree* mesh;       // all that is in `scene`, if it is one that is not empty
};

/// An instance as the scene's owner knows it.
struct InstanceName {
    std::uint32_t id, mask;
    std::uint32_t number;  // of the path that ends here
    Transform transform;
    std::shared_ptr<const SceneTree> scene;
};

/// What it takes to refit the nodes above a few parts alone.
struct PartLinks {
    std::vector<std::uint32_t> node_of;  // [parts] the one whose leaf it is in
    std::vector<std::uint32_t> parent;   // [nodes]
    std::vector<Aabb> boxes;             // [nodes] around all children
    std::vector<double> areas;           // [nodes] of all children's boxes
    Extent around;                       // all parts
};

/// A wide tree over parts, most often with one of them a leaf. The parts of a scene are numbered:
/// mesh trees first, then trees of shapes, then placed scenes.
struct PartTree {
    WideBvh::Arrays arrays;  // nodes and bounds alone
    WideView view{};
    std::vector<std::uint32_t> part;  // by the place that leaves name
    bool leaves_name_parts = false;   // not their places: one part a leaf
    PadGrowth growth;
    double cost_at_build = 0;          // areas of all children's boxes in those of the root's
    bool was_refitted = false;         // since its build
    std::unique_ptr<PartLinks> links;  // once a few parts moved; null before

    /// What a leaf names.
    [[nodiscard]] std::uint32_t named(std::uint32_t place) const {
        return leaves_name_parts ? place : part[place];
    }

    [[nodiscard]] bool empty() const { return part.empty(); }
};

struct SceneTree {
    std::vector<std::shared_ptr<const MeshTree>> meshes;
    std::vector<std::shared_ptr<const ShapeTree>> shapes;  // by ascending id
    std::vector<InstanceName> instances;                   // by ascending id
    std::vector<MeshName> mesh_names;                      // by ascending id
    Buffer<PlacedScene> placed;
    std::vector<WayIn> ways;
    std::vector<Extent> extents;  // [parts]
    Buffer<Image> images;         // [placed]
    /// The meshes and shapes without the instances, where there are both.
    std::shared_ptr<const SceneTree> own_parts;
    /// Over all parts that are not empty: instances whose maps keep errors small, and those that
    /// do not, whose boxes must widen so much that they would spoil a common tree.
    PartTree near, wild;
    Extent extent;
    Aabb bounds = empty_box();  // without what rays may miss it by
    Quality quality{};          // what it was made with
    Usage usage{};
    bool compact = false;
    std::uint64_t paths = 0;
    std::uint32_t levels = 0;    // of instances, below this scene
    std::size_t stack_size = 0;  // of a ray that goes alone: children still to visit, on all levels

    /// Made when the first instance asks for it.
    [[nodiscard]] const Support& support() const {
        std::call_once(later->support_asked, [&] { later->support = support_of(*this); });
        return later->support;
    }
    mutable PathRates rates;  // of batches so far
    /// What trees of meshes were built in, once a mesh's tree was built again.
    Recycler<WideBvhBuilder> builders;
    /// What is made of all this when it is first asked for.
    struct Later {
        std::once_flag support_asked, near_asked;
        Support support;
        std::shared_ptr<const NearScene> near;  // for queries of distance (near_scene_of)
    };
    std::unique_ptr<Later> later = std::make_unique<Later>();

    /// The only mesh tree, if rays need nothing else.
    [[nodiscard]] const MeshTree* only_mesh() const {
        return instances.empty() && shapes.empty() && meshes.size() == 1 ? meshes.front().get()
                                                                         : nullptr;
    }
    /// The only tree of shapes, if rays need nothing else.
    [[nodiscard]] const ShapeTree* only_shapes() const {
        return instances.empty() && meshes.empty() && shapes.size() == 1 ? shapes.front().get()
                                                                         : nullptr;
    }
    /// Parts before the placed scenes.
    [[nodiscard]] std::size_t own_part_count() const { return meshes.size() + shapes.size(); }
};

}  // namespace raydix
