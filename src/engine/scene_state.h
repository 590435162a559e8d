// The inside of a scene: what was added, and what the last commit made of it.
#pragma once

#include <raydix/buffer.h>
#include <raydix/scene.h>

#include <map>
#include <memory>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "engine/scene_tree.h"
#include "engine/scene_tree_double.h"
#include "engine/shape_tree.h"
#include "exec/recycler.h"

namespace raydix {

/// What scenes of a number type are made of inside. WayBack: what is known of the inverse of an
/// instance's transform.
template <class Scalar>
struct SceneKind;
template <>
struct SceneKind<float> {
    using MeshTree = raydix::MeshTree;
    using ShapeTree = raydix::ShapeTree;
    using Tree = SceneTree;
    struct WayBack {
        Affine inverse;
        MapErrors errors;
    };
};
template <>
struct SceneKind<double> {
    using MeshTree = MeshTreeD;
    using ShapeTree = ShapeTreeD;
    using Tree = SceneTreeD;
    struct WayBack {
        InverseD inverse;
    };
};

/// A copy of a mesh. Where only vertices move, the triangles stay.
template <class Scalar>
struct OwnMesh {
    using Point = BasicVec3<Scalar>;
    std::shared_ptr<const Buffer<Triangle>> triangles;
    std::shared_ptr<const Buffer<Point>> vertices;
    Recycler<Buffer<Point>> memory;  // of vertices
};

template <class Scalar>
struct BasicScene<Scalar>::State {
    struct Geometry : SceneKind<Scalar>::WayBack {
        // A mesh; its arrays are the scene's own unless they are shared. Commits hold on to the
        // own ones.
        MeshView mesh;
        std::shared_ptr<const void> own;
        std::optional<OwnMesh<Scalar>> arrays;  // of `own`, unless they came from a file
        bool shared = false;
        // Or shapes, views of `own`.
        std::optional<BasicShapes<Scalar>> shapes;
        // An instance, if there is a scene.
        std::shared_ptr<const State> scene;
        Transform transform;

        std::uint32_t mask = 0xFFFFFFFFu;
        bool changed = true;  // its triangles or shapes, since the last commit

        [[nodiscard]] bool is_instance() const { return scene != nullptr; }
        [[nodiscard]] bool is_mesh() const { return scene == nullptr && !shapes; }
    };

    State() = default;
    ~State();
    State(const State&) = delete;
    State& operator=(const State&) = delete;

    std::map<std::uint32_t, Geometry> geometries;
    /// All of them in a row since the last commit; empty once one came or went. A walk through the
    /// map waits for each node before it knows the next.
    std::vector<std::pair<std::uint32_t, Geometry*>> in_a_row;
    std::uint64_t next_id = 0;      // all below were given once
    std::set<std::uint32_t> taken;  // those above, chosen by the caller
    bool changed = true;            // anything, since the last commit
    /// If no more than transforms and masks of instances changed: of which. Some may stand there
    /// twice.
    bool only_moved = false;
    std::vector<std::uint32_t> moved;
    std::shared_ptr<const typename SceneKind<Scalar>::Tree> tree;  // null before the first commit
    /// Of the commit that made `tree`: what it told, its limit, and the scenes that instances
    /// place, each once, with their trees. No report of a tree that came from a file.
    std::optional<CommitReport> report;
    double refit_limit = 0;
    std::vector<std::pair<const State*, const void*>> below;

    [[nodiscard]] Geometry& at(std::uint32_t id);
    void put_in_a_row();
    void note_change() noexcept;
    void note_move(std::uint32_t id) noexcept;
    /// use(id, geometry) for each, by ascending id.
    template <class Use>
    void for_each(const Use& use) const {
        if (in_a_row.empty())
            for (const auto& [id, geometry] : geometries) use(id, geometry);
        else
            for (const auto& [id, geometry] : in_a_row) use(id, std::as_const(*geometry));
    }
    /// What a commit made; nothing counts as changed any more.
    void take(std::shared_ptr<const typename SceneKind<Scalar>::Tree> made,
              const CommitReport& told, double limit);
    /// Whether rays through this scene may come to `other`.
    [[nodiscard]] bool holds(const State* other) const;
};

template <class Scalar>
struct BasicSceneInternals {
    using Scene = BasicScene<Scalar>;
    using State = typename Scene::State;
    using Tree = typename SceneKind<Scalar>::Tree;
    static State& state(Scene& scene) { return *scene.state_; }
    static Scene scene_of(std::shared_ptr<State> state) {
        Scene scene;
        scene.state_ = std::move(state);
        return scene;
    }
    static const std::shared_ptr<State>& shared_state(const Scene& scene) { return scene.state_; }
    /// Throws InputError if there is none.
    static const std::shared_ptr<const Tree>& tree(const Scene& scene);
    /// Gives an instance its transform. Throws InputError if that is singular or not finite.
    static void place(std::uint32_t id, const BasicTransform<Scalar>& transform,
                      typename State::Geometry& geometry);
};
using SceneInternals = BasicSceneInternals<float>;
using SceneInternalsD = BasicSceneInternals<double>;

}  // namespace raydix
