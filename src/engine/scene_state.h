// The inside of a Scene: what was added, and what the last commit made of it.
#pragma once

#include <raydix/scene.h>

#include <map>
#include <memory>
#include <set>
#include <utility>
#include <vector>

#include "engine/scene_tree.h"

namespace raydix {

struct Scene::State {
    struct Geometry {
        // A mesh; its arrays are the scene's own unless they are shared. Commits hold on to the
        // own ones.
        MeshView mesh;
        std::shared_ptr<const void> own;
        bool shared = false;
        // An instance, if there is a scene.
        std::shared_ptr<const State> scene;
        Transform transform;
        Affine inverse;
        MapErrors errors;

        std::uint32_t mask = 0xFFFFFFFFu;
        bool changed = true;  // its triangles, since the last commit

        [[nodiscard]] bool is_instance() const { return scene != nullptr; }
    };

    std::map<std::uint32_t, Geometry> geometries;
    std::uint64_t next_id = 0;      // all below were given once
    std::set<std::uint32_t> taken;  // those above, chosen by the caller
    bool changed = true;
    std::shared_ptr<const SceneTree> tree;  // null before the first commit
    Quality tree_quality{};                 // what it was made with
    bool tree_compact = false;

    [[nodiscard]] Geometry& at(std::uint32_t id);
    /// Whether rays through this scene may come to `other`.
    [[nodiscard]] bool holds(const State* other) const;
};

struct SceneAccess {
    using State = Scene::State;
    static State& state(Scene& scene) { return *scene.state_; }
    static Scene scene_of(std::shared_ptr<State> state) {
        Scene scene;
        scene.state_ = std::move(state);
        return scene;
    }
    static const std::shared_ptr<State>& shared_state(const Scene& scene) { return scene.state_; }
    /// Throws InputError if there is none.
    static const std::shared_ptr<const SceneTree>& tree(const Scene& scene);
    /// Gives an instance its transform. Throws InputError if that is singular or not finite.
    static void place(std::uint32_t id, const Transform& transform, State::Geometry& geometry);
};

}  // namespace raydix
