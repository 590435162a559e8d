#include "io/rdx_meshes.h"

#include <raydix/error.h>

#include <algorithm>
#include <string>

#include "base/printable.h"
#include "io/map_input.h"
#include "io/rdx_scene_format.h"

namespace raydix::rdx {
namespace {

std::optional<std::vector<MeshPlace>> places_of_tree(const Sections& sections) {
    const Section &v = sections[vertices], &t = sections[triangles];
    const auto kind = static_cast<PrimitiveKind>(sections.only<Info>(info).kind);
    if (kind != (t.count == 0 ? PrimitiveKind::points : PrimitiveKind::triangles)) return {};
    return {{{v.offset, v.count, t.offset, t.count}}};
}

/// Meshes take vertices and triangles, each the next so many.
std::vector<MeshPlace> places_of_meshes(const Sections& sections) {
    MeshPlace next{sections[scene_vertices].offset, 0, sections[scene_triangles].offset, 0};
    std::uint64_t vertices_left = sections[scene_vertices].count,
                  triangles_left = sections[scene_triangles].count;
    std::vector<MeshPlace> places;
    for (const StoredMesh& mesh : sections.view<StoredMesh>(scene_meshes)) {
        if (mesh.vertices > vertices_left || mesh.triangles > triangles_left)
            sections.fail("meshes", "they take more than there is");
        vertices_left -= mesh.vertices;
        triangles_left -= mesh.triangles;
        next.vertices = mesh.vertices;
        next.triangles = mesh.triangles;
        places.push_back(next);
        next.vertices_begin += mesh.vertices * sizeof(Vec3);
        next.triangles_begin += mesh.triangles * sizeof(Triangle);
    }
    return places;
}

std::optional<std::vector<MeshPlace>> places_of_scene(const Sections& sections) {
    if (sections[scene_scenes].count != 1) return {};  // instances of others
    const std::vector<MeshPlace> meshes = places_of_meshes(sections);
    std::vector<MeshPlace> places;
    for (const StoredGeometry& geometry : sections.view<StoredGeometry>(scene_geometries)) {
        if (geometry.kind != stored_mesh || geometry.mask != ~0u) return {};
        if (geometry.number == no_primitive) continue;  // without triangles
        if (geometry.number >= meshes.size())
            sections.fail("geometries", "one has a mesh that is not there");
        places.push_back(meshes[geometry.number]);
    }
    return places;
}

}  // namespace

std::optional<std::vector<MeshPlace>> mesh_places(const std::filesystem::path& file) {
    if (!supported) throw BackendUnavailable(std::string(unsupported_text));
    const MappedFile whole = mapped_input(file);
    const std::string name = printable(file);
    const std::uint32_t found = version_of(name, whole.bytes);
    if (found == double_version) return {};
    const Sections sections(
        name, whole.bytes, whole.owner, found,
        found == version ? std::span<const SectionKind>(tree_kinds) : scene_kinds_of(found),
        Sections::Checked::header);
    return found == version ? places_of_tree(sections) : places_of_scene(sections);
}

}  // namespace raydix::rdx
