// A scene -> one mesh of its triangles on every path, in the world: what queries ask that look at
// all meshes as one body.
#pragma once

#include <raydix/bvh.h>
#include <raydix/double.h>
#include <raydix/scene.h>
#include <raydix/scene_pairs.h>
#include <raydix/solid.h>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <type_traits>
#include <unordered_map>
#include <vector>

#include "engine/scene_state.h"

namespace raydix {

/// Which triangles of a scene stand where in a flat mesh.
struct FlatNames {
    /// A mesh on a path: `first` is its first triangle.
    struct Run {
        std::uint32_t first, instance, geometry;
        bool turned;  // the path mirrors: second and third corners have changed places
    };
    std::vector<Run> runs;  // ascending, by (instance, geometry) too

    /// That `prim` belongs to.
    [[nodiscard]] const Run& run_of(std::uint32_t prim) const;
    [[nodiscard]] ScenePrimitive name(std::uint32_t prim) const {
        const Run& run = run_of(prim);
        return {run.instance, run.geometry, prim - run.first};
    }
};

/// In float or in double.
template <class Scalar>
struct FlatScene {
    using Mesh = BasicMesh<Scalar>;
    using MeshView = BasicMeshView<Scalar>;

    Mesh own;       // empty if the scene is one mesh that stands where it is
    MeshView mesh;  // of `own`, or of the scene's arrays
    FlatNames names;

    FlatScene() = default;
    FlatScene(FlatScene&&) noexcept = default;
    FlatScene& operator=(FlatScene&&) noexcept = default;
};

/// A tree over a flat mesh, each triangle in one leaf.
template <class Scalar>
struct FlatTree {
    using Tree = typename BasicSolid<Scalar>::Tree;

    Tree tree;
    FlatNames names;
};

/// What a flat mesh has: sums that stay at the greatest number where they do not fit.
struct FlatCounts {
    std::uint64_t triangles = 0, vertices = 0;
    std::uint64_t meshes = 0;     // with triangles, on all paths
    std::uint64_t instances = 0;  // with triangles below them, on all paths
    bool has_shapes = false;      // among what counts
};

enum class FlatShapes { refused, left_out };

/// Knows what flatten() would make, without making it. `mask`: a geometry counts if its own mask &
/// this is not 0, and the same holds for each instance on the way to it.
template <class Scalar>
class FlatPlan {
public:
    using Scene = BasicScene<Scalar>;
    using Tree = typename SceneKind<Scalar>::Tree;

    /// Throws InputError, which names `call` and the geometry: spheres or other shapes, that have
    /// no triangles, unless they are left out; a scene that was never committed.
    FlatPlan(const Scene& scene, std::uint32_t mask, const char* call,
             FlatShapes shapes = FlatShapes::refused);

    [[nodiscard]] const FlatCounts& counts() const { return counts_of(*tree_); }
    /// Whether flatten() copies no vertex.
    [[nodiscard]] bool is_one_mesh() const;
    /// Of the flat mesh, its names, and what is needed to make them.
    [[nodiscard]] std::uint64_t bytes() const;
    /// The peak of tree().
    [[nodiscard]] std::uint64_t tree_bytes() const;

    /// Vertices go through the transforms of their path in turn, the innermost first, in double,
    /// and are rounded once. Where a path mirrors, two corners change places. Meshes are by
    /// (instance, geometry). Throws InputError: 2^32 - 1 triangles or vertices, or more.
    [[nodiscard]] FlatScene<Scalar> flatten() const;
    /// The same mesh by mesh, with all triangles as they are given: visit(mesh), in no more memory
    /// than the vertices of one.
    void for_each_mesh(const std::function<void(const BasicMeshView<Scalar>&)>& visit) const;
    /// Throws InputError: 2^31 triangles, or more.
    [[nodiscard]] FlatTree<Scalar> tree(int threads) const;

private:
    const FlatCounts& count(const Tree& scene);
    [[nodiscard]] const FlatCounts& counts_of(const Tree& scene) const {
        return counts_.at(&scene);
    }
    [[noreturn]] void refuse_shapes(const Tree& scene, std::uint32_t number,
                                    const char* call) const;
    class Paths;

    std::shared_ptr<const Tree> tree_;
    std::uint32_t mask_;
    std::unordered_map<const Tree*, FlatCounts> counts_;
};

extern template class FlatPlan<float>;
extern template class FlatPlan<double>;

}  // namespace raydix
