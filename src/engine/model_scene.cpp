// A model's meshes and nodes -> geometries and instances.
#include <raydix/error.h>
#include <raydix/model.h>
#include <raydix/scene.h>

#include <map>
#include <memory>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "base/float_env.h"
#include "engine/scene_state.h"
#include "exec/progress.h"

namespace raydix {
namespace {

/// A node's transform and a mesh in the numbers of a scene.
template <class Scalar>
BasicTransform<Scalar> transform_as(const TransformD& t) {
    BasicTransform<Scalar> out;
    for (std::size_t r = 0; r < 3; ++r)
        for (std::size_t c = 0; c < 4; ++c) out.m[r][c] = static_cast<Scalar>(t.m[r][c]);
    return out;
}
template <class Scalar>
decltype(auto) mesh_as(const Mesh& mesh) {
    if constexpr (std::is_same_v<Scalar, float>) {
        return (mesh);
    } else {
        MeshD wide{mesh.name, {}, mesh.triangles};
        wide.vertices.reserve(mesh.vertices.size());
        for (const Vec3 v : mesh.vertices) wide.vertices.push_back({v.x, v.y, v.z});
        return wide;
    }
}

/// Points and empty meshes have an id, and rays do not meet them.
template <class Scalar>
void add_mesh(BasicScene<Scalar>& scene, const Model& model, std::uint32_t i) {
    const Mesh& mesh = model.meshes[i];
    if (mesh.triangles.empty())
        scene.add(BasicMeshView<Scalar>(), {.id = i});
    else
        scene.add(mesh_as<Scalar>(mesh), {.id = i});
}

/// Scenes of nodes, made from the last node to the first, so that those below a node are there when
/// it is made. Ids of nodes follow those of meshes; in depth-first order they ascend.
template <class Scalar>
class NodeScenes {
public:
    using Scene = BasicScene<Scalar>;

    NodeScenes(const Model& model, const SceneOptions& options)
        : model_(model), quiet_(options), listener_(options.progress), nodes_(model.nodes.size()) {
        quiet_.progress = nullptr;
        check_order();
        for (const Mesh& mesh : model.meshes) triangles_ += mesh.triangles.size();
        empty_.commit(quiet_);
        for (std::size_t k = nodes_.size(); k-- > 0;) {
            Node& node = nodes_[k];
            const ModelNode& given = model_.nodes[k];
            for (std::uint32_t i = 0; i < given.mesh_count; ++i)
                node.shows |= !model_.meshes[given.first_mesh + i].triangles.empty();
            if (node.shows) node.scene = scene_of(k);
            for (const std::uint32_t child : node.children) nodes_[child].scene.reset();
            if (model_.nodes[k].parent == ModelNode::none) continue;
            Node& parent = nodes_[model_.nodes[k].parent];
            parent.children.push_back(static_cast<std::uint32_t>(k));
            parent.size += node.size;
            parent.shows |= node.shows;
        }
    }

    /// Places the nodes that stand in the world.
    void place(Scene& world) {
        for (std::size_t k = 0; k < nodes_.size(); ++k)
            if (model_.nodes[k].parent == ModelNode::none) add_node(world, k);
        world.commit(quiet_);
        listener_.finish();
    }

private:
    struct Node {
        std::vector<std::uint32_t> children;
        std::uint32_t size = 1;              // with all nodes below it, which follow it
        bool shows = false;                  // triangles
        std::shared_ptr<const Scene> scene;  // of a node that shows something
    };

    /// Depth first, with meshes that are there.
    void check_order() const {
        std::vector<std::uint32_t> way;
        for (std::size_t k = 0; k < nodes_.size(); ++k) {
            const ModelNode& node = model_.nodes[k];
            while (!way.empty() && way.back() != node.parent) way.pop_back();
            if (way.empty() && node.parent != ModelNode::none)
                throw InputError("node " + std::to_string(k) + ": node " +
                                 std::to_string(node.parent) +
                                 ", its parent, does not stand before it in depth-first order");
            if (std::uint64_t{node.first_mesh} + node.mesh_count > model_.meshes.size())
                throw InputError("node " + std::to_string(k) + ": shows mesh " +
                                 std::to_string(node.first_mesh + node.mesh_count - 1) + " of " +
                                 std::to_string(model_.meshes.size()));
            way.push_back(static_cast<std::uint32_t>(k));
        }
    }

    std::shared_ptr<const Scene> scene_of(std::size_t k) {
        const ModelNode& given = model_.nodes[k];
        if (nodes_[k].children.empty()) return meshes_of(given);
        auto scene = std::make_shared<Scene>();
        if (given.mesh_count != 0) take_meshes(*meshes_of(given), *scene);
        for (const std::uint32_t child : nodes_[k].children) add_node(*scene, child);
        scene->commit(quiet_);
        return scene;
    }

    /// Nodes that show nothing, however deep they are below each other: all that is left of them
    /// are their numbers.
    [[nodiscard]] Scene numbers_below(std::size_t k) const {
        Scene scene;
        for (std::uint32_t below = 1; below < nodes_[k].size; ++below)
            scene.add(empty_, {}, {.id = id_of(k + below)});
        scene.commit(quiet_);
        return scene;
    }

    /// One scene for all nodes that show the same meshes.
    std::shared_ptr<const Scene> meshes_of(const ModelNode& node) {
        std::shared_ptr<const Scene>& shared = by_meshes_[{node.first_mesh, node.mesh_count}];
        if (shared == nullptr) {
            auto scene = std::make_shared<Scene>();
            std::uint64_t triangles = 0;
            for (std::uint32_t i = 0; i < node.mesh_count; ++i) {
                add_mesh(*scene, model_, node.first_mesh + i);
                triangles += model_.meshes[node.first_mesh + i].triangles.size();
            }
            SceneOptions options = quiet_;
            options.progress = [&](double part) {
                listener_.reach(
                    (static_cast<double>(done_) + part * static_cast<double>(triangles)) /
                    static_cast<double>(triangles_));
            };
            scene->commit(options);
            done_ += triangles;
            shared = std::move(scene);
        }
        return shared;
    }

    /// With their arrays and their tree, which the next commit keeps.
    static void take_meshes(const Scene& from, Scene& to) {
        using Access = BasicSceneInternals<Scalar>;
        const typename Access::State& source = *Access::shared_state(from);
        typename Access::State& state = Access::state(to);
        state.geometries = source.geometries;
        for (const auto& [id, geometry] : state.geometries) state.taken.insert(id);
        state.tree = source.tree;
    }

    [[nodiscard]] std::uint32_t id_of(std::size_t k) const {
        return static_cast<std::uint32_t>(model_.meshes.size() + k);
    }

    void add_node(Scene& scene, std::size_t k) const {
        const ModelNode& node = model_.nodes[k];
        if (!nodes_[k].shows) {  // its map may flatten, then
            scene.add(numbers_below(k), {}, {.id = id_of(k)});
            return;
        }
        try {
            scene.add(*nodes_[k].scene, transform_as<Scalar>(node.transform), {.id = id_of(k)});
        } catch (const InputError& error) {
            throw InputError("node " + std::to_string(k) +
                             (node.name.empty() ? "" : " (" + node.name + ")") + ": " +
                             error.what());
        }
    }

    const Model& model_;
    SceneOptions quiet_;  // without progress
    ProgressListener listener_;
    std::uint64_t triangles_ = 0, done_ = 0;  // of all meshes, of those with a tree
    std::vector<Node> nodes_;
    Scene empty_;
    // By the first mesh and how many there are.
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::shared_ptr<const Scene>> by_meshes_;
};

}  // namespace

template <class Scalar>
BasicScene<Scalar>::BasicScene(const Model& model, const SceneOptions& options) : BasicScene() {
    const FloatEnvironment plain;
    const bool flat = model.is_flat();
    try {
        if (flat) {
            add(mesh_as<Scalar>(model.mesh()));
            commit(options);
        } else if (model.nodes.empty()) {
            for (std::uint32_t i = 0; i < model.meshes.size(); ++i) add_mesh(*this, model, i);
            commit(options);
        } else {
            NodeScenes<Scalar>(model, options).place(*this);
        }
    } catch (const InputError& error) {
        throw InputError((model.name.empty() ? "" : model.name + ": ") + error.what() +
                         (flat ? "" : " (Model::flatten, --flatten makes one mesh of it)"));
    }
}

template BasicScene<float>::BasicScene(const Model&, const SceneOptions&);
template BasicScene<double>::BasicScene(const Model&, const SceneOptions&);

}  // namespace raydix
