#include "engine/merge.h"

#include <raydix/device_scene.h>
#include <raydix/error.h>

#include <algorithm>
#include <string>

#include "engine/name_hit.h"
#include "engine/scene_state.h"
#include "exec/parallel.h"

namespace raydix {

Mesh merged(std::span<const MeshView> meshes, std::vector<std::uint32_t>& first) {
    std::size_t vertices = 0, triangles = 0;
    for (const MeshView& mesh : meshes) {
        first.push_back(static_cast<std::uint32_t>(triangles));
        vertices += mesh.vertices.size();
        triangles += mesh.triangles.size();
    }
    if (std::max(vertices, triangles) >= no_primitive)
        throw InputError("scene: " + std::to_string(triangles) + " triangles of " +
                         std::to_string(vertices) + " vertices are too many for one tree");
    Mesh out;
    out.vertices.resize(vertices);
    out.triangles.resize(triangles);
    std::size_t vertex = 0;
    for (std::size_t k = 0; k < meshes.size(); ++k) {
        const MeshView& mesh = meshes[k];
        std::copy(mesh.vertices.begin(), mesh.vertices.end(),
                  out.vertices.begin() + static_cast<std::ptrdiff_t>(vertex));
        const auto offset = static_cast<std::uint32_t>(vertex);
        for_each_index(mesh.triangles.size(), [&](std::size_t i) {
            const Triangle& t = mesh.triangles[i];
            out.triangles[first[k] + i] = {t[0] + offset, t[1] + offset, t[2] + offset};
        });
        vertex += mesh.vertices.size();
    }
    return out;
}

MergedMeshes merge_meshes(const Scene& scene, std::uint32_t mask) {
    const SceneTree& tree = *SceneAccess::tree(scene);
    if (!tree.instances.empty())
        throw BackendUnavailable("geometry " + std::to_string(tree.instances.front().id) +
                                 " is an instance; devices trace meshes alone (Model::flatten "
                                 "makes one mesh of a model)");
    MergedMeshes out;
    std::vector<MeshView> meshes;
    for (const MeshName& name : tree.mesh_names) {
        if (name.mesh.triangles.empty() || (name.mask & mask) == 0) continue;
        out.names.ids.push_back(name.id);
        meshes.push_back(name.mesh);
    }
    out.mesh = merged(meshes, out.names.first);
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
