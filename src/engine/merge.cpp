#include "engine/merge.h"

#include <raydix/device_scene.h>
#include <raydix/error.h>

#include <algorithm>
#include <string>

#include "engine/name_hit.h"
#include "engine/scene_state.h"
#include "engine/shape_tree.h"
#include "exec/parallel.h"

namespace raydix {

MergedMeshes merge_meshes(const Scene& scene, std::uint32_t mask) {
    const SceneTree& tree = *SceneAccess::tree(scene);
    if (!tree.instances.empty())
        throw BackendUnavailable("geometry " + std::to_string(tree.instances.front().id) +
                                 " is an instance; devices trace meshes alone (Model::flatten "
                                 "makes one mesh of a model)");
    if (!tree.shapes.empty()) {
        const ShapeTree& shapes = *tree.shapes.front();
        throw BackendUnavailable("geometry " + std::to_string(shapes.id) + " holds " +
                                 kind_of(shapes.shapes) + "; devices trace meshes alone");
    }
    MergedMeshes out;
    std::vector<MeshView> meshes;
    for (const MeshName& name : tree.mesh_names) {
        if (name.mesh.triangles.empty() || (name.mask & mask) == 0) continue;
        out.names.ids.push_back(name.id);
        meshes.push_back(name.mesh);
    }
    out.mesh = merged<Mesh, MeshView>(meshes, out.names.first);
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
