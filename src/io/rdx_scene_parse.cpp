// The bytes of an .rdx file of version 2 or 3 -> a scene. Lengths and checksums are found right
// first (rdx_sections.h), all the rest by scene_of.
#include <raydix/error.h>

#include <algorithm>
#include <type_traits>

#include "io/rdx_faults.h"
#include "io/rdx_names.h"
#include "io/rdx_parse.h"
#include "io/rdx_scene_format.h"

namespace raydix::rdx {

RdxScene parse_scene(const std::string& file, std::span<const std::byte> bytes,
                     const std::shared_ptr<void>& owner) {
    if (!supported) throw BackendUnavailable(std::string(unsupported_text));
    const bool has_shapes = version_of(file, bytes) == shapes_version;
    const std::uint32_t wanted = has_shapes ? shapes_version : scene_version;
    const Sections sections(file, bytes, owner, wanted, scene_kinds_of(wanted));
    const auto stored = sections.only<SceneInfo>(scene_info);
    if (stored.reserved != 0) sections.fail("info", "the reserved bytes are not zero");
    RdxScene out;
    out.cameras.width = stored.picture_width;
    out.cameras.height = stored.picture_height;
    out.cameras.ao_radius = stored.ao_radius;
    NameReader reader(sections, scene_names);
    out.name = reader.next(stored.name_bytes);
    out.cameras.cameras = reader.cameras(sections.view<Camera>(scene_cameras));
    reader.finish();
    if (const Fault fault = camera_fault(out.cameras)) throw InputError(file + ": " + *fault);
    // Of version 2: none.
    const auto shapes_view = [&]<class T>(SceneSectionId id, std::type_identity<T>) {
        return has_shapes ? sections.view<T>(id) : std::span<const T>();
    };
    const SceneArrays arrays{
        .scenes = sections.view<StoredScene>(scene_scenes),
        .geometries = sections.view<StoredGeometry>(scene_geometries),
        .trees = sections.view<StoredTree>(scene_trees),
        .meshes = sections.view<StoredMesh>(scene_meshes),
        .shapes = shapes_view(scene_shapes, std::type_identity<StoredShapes>()),
        .next_id = stored.next_id,
        .taken = sections.view<std::uint32_t>(scene_taken),
        .nodes = sections.view<WideNode>(scene_nodes),
        .blocks = sections.view<TriangleBlock>(scene_blocks),
        .compact_nodes = sections.view<CompactNode>(scene_compact_nodes),
        .compact_blocks = sections.view<CompactBlock>(scene_compact_blocks),
        .corners = sections.view<Vec3>(scene_corners),
        .vertices = sections.view<Vec3>(scene_vertices),
        .triangles = sections.view<Triangle>(scene_triangles),
        .spheres = shapes_view(scene_spheres, std::type_identity<Sphere>()),
        .capsules = shapes_view(scene_capsules, std::type_identity<Capsule>()),
        .points = shapes_view(scene_points, std::type_identity<Vec3>()),
        .owner = owner,
    };
    try {
        out.scene = scene_of(arrays);
    } catch (const InputError& error) {
        throw InputError(file + ": " + error.what());
    }
    const StoredScene& whole = arrays.scenes.back();
    out.options.quality = static_cast<Quality>(whole.quality);
    out.options.usage = static_cast<Usage>(whole.usage);
    out.options.compact = whole.compact != 0;
    out.counts = {.scenes = arrays.scenes.size(),
                  .instances = static_cast<std::uint64_t>(std::ranges::count(
                      arrays.geometries, stored_instance, &StoredGeometry::kind)),
                  .meshes = arrays.meshes.size(),
                  .vertices = arrays.vertices.size(),
                  .triangles = arrays.triangles.size(),
                  .shapes = arrays.spheres.size() + arrays.capsules.size() + arrays.points.size(),
                  .nodes = arrays.nodes.size() + arrays.compact_nodes.size(),
                  .bytes = bytes.size()};
    for (const StoredGeometry& geometry : arrays.geometries.last(whole.geometry_count))
        if (geometry.kind == stored_shapes) out.shape_ids.push_back(geometry.id);
    return out;
}

}  // namespace raydix::rdx
