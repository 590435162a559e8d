// A scene -> tables.
#include "engine/scene_tables.h"

#include <raydix/error.h>

#include <algorithm>
#include <string>
#include <unordered_map>
#include <utility>

#include "engine/scene_state.h"
#include "engine/shape_tree.h"
#include "engine/shared_arrays.h"
#include "exec/parallel.h"
#include "layout/local_pads.h"

namespace raydix {
namespace {

template <class Scalar>
class TableWriter {
    using Transform = BasicTransform<Scalar>;
    using Tree = typename SceneKind<Scalar>::Tree;
    using ShapeTree = typename SceneKind<Scalar>::ShapeTree;
    using Stored = BasicStoredGeometry<Scalar>;

public:
    /// As its last commit left it. Returns its number.
    std::uint32_t add(const Tree& scene) {
        const auto known = scenes_.find(&scene);
        if (known != scenes_.end()) return known->second;
        for (const auto& mesh : scene.meshes) SharedArrays<Tree>(scene, *mesh).require_unchanged();
        const auto none = no_transform<Transform>();
        std::vector<Stored> geometries;
        for (const auto& instance : scene.instances)
            geometries.push_back({instance.id, instance.mask, stored_instance, add(*instance.scene),
                                  instance.transform});
        for (const auto& mesh : scene.mesh_names)
            geometries.push_back({mesh.id, mesh.mask, stored_mesh, stored_none, none});
        for (const auto& shapes : scene.shapes)
            geometries.push_back(
                {shapes->id, shapes->mask, stored_shapes, add_shapes(*shapes), none});
        std::ranges::sort(geometries, {}, &Stored::id);
        number_meshes(scene, geometries);
        const auto number = static_cast<std::uint32_t>(out_.scenes.size());
        out_.scenes.push_back({static_cast<std::uint32_t>(geometries.size()),
                               static_cast<std::uint32_t>(scene.quality),
                               static_cast<std::uint32_t>(scene.usage), scene.compact ? 1u : 0u});
        out_.geometries.insert(out_.geometries.end(), geometries.begin(), geometries.end());
        scenes_[&scene] = number;
        return number;
    }

    BasicSceneTables<Scalar> finish() { return std::move(out_); }

private:
    /// Returns their number.
    std::uint32_t add_shapes(const ShapeTree& tree) {
        if (tree.user() != nullptr)
            throw InputError("scenes: geometry " + std::to_string(tree.id) + " holds " +
                             kind_of(tree.shapes) + ", which files have no place for");
        BasicStoredShapes<Scalar> stored{};
        stored.kind = static_cast<std::uint32_t>(tree.shapes.index());
        stored.count = count_of(tree.shapes);
        using Spheres = std::span<const BasicSphere<Scalar>>;
        using Capsules = std::span<const BasicCapsule<Scalar>>;
        if (const auto* const spheres = std::get_if<Spheres>(&tree.shapes)) {
            out_.spheres.push_back(*spheres);
        } else if (const auto* const capsules = std::get_if<Capsules>(&tree.shapes)) {
            out_.capsules.push_back(*capsules);
        } else {
            const auto& balls = std::get<BasicBalls<Scalar>>(tree.shapes);
            out_.points.push_back(balls.centers);
            stored.radius = balls.radius;
        }
        out_.shapes.push_back(stored);
        return static_cast<std::uint32_t>(out_.shapes.size() - 1);
    }

    /// In float the meshes of a tree follow each other.
    void number_meshes(const SceneTree& scene, std::vector<Stored>& geometries) {
        for (const auto& mesh : scene.meshes) {
            std::uint32_t number = first_mesh(scene, *mesh);
            for (const std::uint32_t id : mesh->ids) at(geometries, id).number = number++;
        }
    }
    void number_meshes(const SceneTreeD& scene, std::vector<Stored>& geometries) {
        for (const MeshNameD& name : scene.mesh_names)
            if (!name.mesh.triangles.empty()) at(geometries, name.id).number = add_mesh(name.mesh);
    }

    static Stored& at(std::vector<Stored>& geometries, std::uint32_t id) {
        return *std::ranges::lower_bound(geometries, id, {}, &Stored::id);
    }

    std::uint32_t add_mesh(const BasicMeshView<Scalar>& view) {
        out_.views.push_back(view);
        out_.meshes.push_back({view.vertices.size(), view.triangles.size()});
        return static_cast<std::uint32_t>(out_.meshes.size() - 1);
    }

    /// The number of a tree's first mesh. Scenes that share a tree share its meshes.
    std::uint32_t first_mesh(const SceneTree& scene, const MeshTree& mesh) {
        const auto [known, is_new] =
            trees_.emplace(mesh.tree.get(), static_cast<std::uint32_t>(out_.meshes.size()));
        if (!is_new) return known->second;
        for (const std::uint32_t id : mesh.ids)
            add_mesh(std::ranges::lower_bound(scene.mesh_names, id, {}, &MeshName::id)->mesh);
        const WideBvh::Arrays& arrays = mesh.tree->arrays();
        const bool compact = arrays.stats.compact;
        out_.trees.push_back({static_cast<std::uint32_t>(mesh.ids.size()), compact ? 1u : 0u,
                              compact ? arrays.compact_nodes.size() : arrays.nodes.size(),
                              compact ? arrays.compact_blocks.size() : arrays.blocks.size(),
                              arrays.vertices.size(), arrays.bounds, arrays.stats.sah,
                              mesh.sah_at_build, arrays.stats.widening});
        out_.wide.push_back(mesh.tree.get());
        if (arrays.local_pads && !compact)
            out_.nodes.emplace_back(
                out_.moved_nodes.emplace_back(nodes_about_center(arrays)).view());
        else
            out_.nodes.emplace_back(arrays.nodes.view());
        return known->second;
    }

    BasicSceneTables<Scalar> out_;
    std::unordered_map<const Tree*, std::uint32_t> scenes_;
    std::unordered_map<const WideBvh*, std::uint32_t> trees_;  // their first meshes
};

template <class Scalar>
BasicSceneTables<Scalar> tables_of_scene(const BasicScene<Scalar>& scene) {
    using Internals = BasicSceneInternals<Scalar>;
    const auto& tree = *Internals::tree(scene);
    const auto& state = *Internals::shared_state(scene);
    if (state.changed) throw InputError("scenes: it has changes that no commit has taken in");
    BasicSceneTables<Scalar> out;
    with_threads(0, [&] {
        TableWriter<Scalar> writer;
        writer.add(tree);
        out = writer.finish();
    });
    out.next_id = state.next_id;
    out.taken.assign(state.taken.begin(), state.taken.end());
    return out;
}

}  // namespace

SceneTables tables_of(const Scene& scene) { return tables_of_scene(scene); }
SceneTablesD tables_of(const SceneD& scene) { return tables_of_scene(scene); }

}  // namespace raydix
