// Scene -> .rdx file.
#include <raydix/error.h>
#include <raydix/rdx_scene.h>

#include <array>
#include <functional>

#include "io/rdx_faults.h"
#include "io/rdx_names.h"
#include "io/rdx_scene_format.h"
#include "scene/input_error.h"

namespace raydix {
namespace {

/// One section of arrays that lie in several places.
template <class T, class List, class Of>
rdx::SectionContent pieces_of(const List& list, const Of& of) {
    rdx::SectionContent out{sizeof(T), {}};
    for (const auto& each : list)
        if (const std::span<const T> elements = of(each); !elements.empty())
            out.pieces.push_back(std::as_bytes(elements));
    return out;
}

template <class T>
rdx::SectionContent list_of(const std::vector<T>& elements) {
    return rdx::content_of(std::span<const T>(elements));
}

std::array<rdx::SectionContent, rdx::shapes_section_count> contents_of(
    const rdx::SceneInfo& info, const SceneTables& tables, const rdx::PackedCameras& packed) {
    using Wide = const WideBvh*;
    return {rdx::content_of(std::span<const rdx::SceneInfo>(&info, 1)),
            list_of(tables.scenes),
            list_of(tables.geometries),
            list_of(tables.taken),
            list_of(tables.trees),
            list_of(tables.meshes),
            pieces_of<WideNode>(tables.nodes, std::identity()),
            pieces_of<TriangleBlock>(tables.wide, [](Wide w) { return w->arrays().blocks.view(); }),
            pieces_of<CompactNode>(tables.wide,
                                   [](Wide w) { return w->arrays().compact_nodes.view(); }),
            pieces_of<CompactBlock>(tables.wide,
                                    [](Wide w) { return w->arrays().compact_blocks.view(); }),
            pieces_of<Vec3>(tables.wide, [](Wide w) { return w->arrays().vertices.view(); }),
            pieces_of<Vec3>(tables.views, [](const MeshView& mesh) { return mesh.vertices; }),
            pieces_of<Triangle>(tables.views, [](const MeshView& mesh) { return mesh.triangles; }),
            list_of(packed.cameras),
            rdx::content_of(std::span<const char>(packed.names)),
            list_of(tables.shapes),
            pieces_of<Sphere>(tables.spheres, std::identity()),
            pieces_of<Capsule>(tables.capsules, std::identity()),
            pieces_of<Vec3>(tables.points, std::identity())};
}

std::array<rdx::SectionContent, rdx::double_section_count> contents_of(
    const rdx::SceneInfo& info, const SceneTablesD& tables, const rdx::PackedCamerasD& packed) {
    using View = const MeshViewD&;
    return {rdx::content_of(std::span<const rdx::SceneInfo>(&info, 1)),
            list_of(tables.scenes),
            list_of(tables.geometries),
            list_of(tables.taken),
            list_of(tables.meshes),
            pieces_of<Vec3d>(tables.views, [](View mesh) { return mesh.vertices; }),
            pieces_of<Triangle>(tables.views, [](View mesh) { return mesh.triangles; }),
            list_of(packed.cameras),
            rdx::content_of(std::span<const char>(packed.names)),
            list_of(tables.shapes),
            pieces_of<SphereD>(tables.spheres, std::identity()),
            pieces_of<CapsuleD>(tables.capsules, std::identity()),
            pieces_of<Vec3d>(tables.points, std::identity())};
}

/// write(info, tables): when all is known to be right.
template <class AnyScene, class Set, class Write>
void save_scene(const std::filesystem::path& file, const AnyScene& scene, const std::string& name,
                const Set& cameras, const Write& write) {
    if (!rdx::supported) throw BackendUnavailable(std::string(rdx::unsupported_text));
    Fault fault = rdx::name_fault(std::span(&name, 1), cameras);
    if (!fault) fault = rdx::camera_fault(cameras);
    if (fault) input_error(printable(file), "not written", *fault);
    decltype(tables_of(scene)) tables;
    try {
        tables = tables_of(scene);
    } catch (const InputError& error) {
        input_error(printable(file), "not written", error.what());
    }
    const rdx::SceneInfo info{.picture_width = cameras.width,
                              .picture_height = cameras.height,
                              .ao_radius = cameras.ao_radius,
                              .name_bytes = rdx::length_of(name),
                              .next_id = tables.next_id,
                              .reserved = 0};
    write(info, tables);
}

}  // namespace

void save_rdx(const std::filesystem::path& file, const Scene& scene, const std::string& name,
              const CameraSet& cameras) {
    save_scene(file, scene, name, cameras,
               [&](const rdx::SceneInfo& info, const SceneTables& tables) {
                   const rdx::PackedCameras packed(name, cameras.cameras);
                   const auto contents = contents_of(info, tables, packed);
                   if (tables.shapes.empty())
                       rdx::write_sections(file, rdx::scene_version,
                                           std::span(contents).first(rdx::scene_section_count));
                   else
                       rdx::write_sections(file, rdx::shapes_version, contents);
               });
}

void save_rdx(const std::filesystem::path& file, const SceneD& scene, const std::string& name,
              const CameraSetD& cameras) {
    save_scene(
        file, scene, name, cameras, [&](const rdx::SceneInfo& info, const SceneTablesD& tables) {
            const rdx::PackedCamerasD packed(name, cameras.cameras);
            rdx::write_sections(file, rdx::double_version, contents_of(info, tables, packed));
        });
}

}  // namespace raydix
