#include "engine/merge.h"

#include <raydix/device_scene.h>
#include <raydix/error.h>

#include <algorithm>
#include <string>
#include <utility>

#include "engine/flat_scene.h"
#include "engine/name_hit.h"
#include "engine/scene_state.h"
#include "engine/shape_tree.h"
#include "exec/parallel.h"

namespace raydix {

MergedMeshes merge_meshes(const Scene& scene, std::uint32_t mask) {
    const SceneTree& tree = *SceneInternals::tree(scene);
    if (!tree.instances.empty())
        throw BackendUnavailable("geometry " + std::to_string(tree.instances.front().id) +
                                 " is an instance; devices trace meshes alone (Model::flatten "
                                 "makes one mesh of a model)");
    if (!tree.shapes.empty()) {
        const ShapeTree& shapes = *tree.shapes.front();
        throw BackendUnavailable("geometry " + std::to_string(shapes.id) + " holds " +
                                 kind_of(shapes.shapes) + "; devices trace meshes alone");
    }
    FlatScene<float> flat = FlatPlan<float>(scene, mask, "merge_meshes").flatten();
    MergedMeshes out;
    if (flat.own.triangles.empty())
        out.mesh = {"",
                    {flat.mesh.vertices.begin(), flat.mesh.vertices.end()},
                    {flat.mesh.triangles.begin(), flat.mesh.triangles.end()}};
    else
        out.mesh = std::move(flat.own);
    for (const FlatNames::Run& run : flat.names.runs) {
        out.names.first.push_back(run.first);
        out.names.ids.push_back(run.geometry);
    }
    return out;
}

void name_hits(const MeshNames& names, std::span<const TreeHit> found, std::span<Hit> hits,
               int threads) {
    check_name_hits(found.size(), hits.size());
    const NamesView view{names.first.data(), names.ids.data(),
                         static_cast<std::uint32_t>(names.ids.size())};
    with_threads(threads, [&] {
        for_each_index(found.size(), [&](std::size_t i) { hits[i] = view.name(found[i]); });
    });
}

}  // namespace raydix
