// The bytes of an .rdx file of version 2 to 4 -> a scene. Lengths and checksums are found right
// first (rdx_sections.h), all the rest by scene_of.
#include <raydix/error.h>

#include <algorithm>
#include <type_traits>

#include "io/rdx_faults.h"
#include "io/rdx_names.h"
#include "io/rdx_parse.h"
#include "io/rdx_scene_format.h"

namespace raydix::rdx {
namespace {

/// Name, cameras and picture: `packed` and `names` are their sections.
template <class Packed, class Out>
SceneInfo read_start(const Sections& sections, std::size_t info, std::size_t packed,
                     std::size_t names, Out& out) {
    const auto stored = sections.only<SceneInfo>(info);
    if (stored.reserved != 0) sections.fail("info", "the reserved bytes are not zero");
    out.cameras.width = stored.picture_width;
    out.cameras.height = stored.picture_height;
    out.cameras.ao_radius = stored.ao_radius;
    NameReader reader(sections, names);
    out.name = reader.next(stored.name_bytes);
    out.cameras.cameras = reader.cameras(sections.view<Packed>(packed));
    reader.finish();
    if (const Fault fault = camera_fault(out.cameras))
        throw InputError(sections.file() + ": " + *fault);
    return stored;
}

/// The scene, the options of its last commit, and what there is.
template <class Scalar, class Out>
void read_scene(const Sections& sections, const BasicSceneArrays<Scalar>& arrays,
                std::size_t file_bytes, Out& out) {
    try {
        out.scene = scene_of(arrays);
    } catch (const InputError& error) {
        throw InputError(sections.file() + ": " + error.what());
    }
    using Stored = BasicStoredGeometry<Scalar>;
    const StoredScene& whole = arrays.scenes.back();
    out.options.quality = static_cast<Quality>(whole.quality);
    out.options.usage = static_cast<Usage>(whole.usage);
    out.options.compact = whole.compact != 0;
    out.counts = {.scenes = arrays.scenes.size(),
                  .instances = static_cast<std::uint64_t>(
                      std::ranges::count(arrays.geometries, stored_instance, &Stored::kind)),
                  .meshes = arrays.meshes.size(),
                  .vertices = arrays.vertices.size(),
                  .triangles = arrays.triangles.size(),
                  .shapes = arrays.spheres.size() + arrays.capsules.size() + arrays.points.size(),
                  .nodes = arrays.nodes.size() + arrays.compact_nodes.size(),
                  .bytes = file_bytes};
    for (const Stored& geometry : arrays.geometries.last(whole.geometry_count))
        if (geometry.kind == stored_shapes) out.shape_ids.push_back(geometry.id);
}

}  // namespace

RdxScene parse_scene(const std::string& file, std::span<const std::byte> bytes,
                     const std::shared_ptr<void>& owner) {
    if (!supported) throw BackendUnavailable(std::string(unsupported_text));
    const bool has_shapes = version_of(file, bytes) == shapes_version;
    const std::uint32_t wanted = has_shapes ? shapes_version : scene_version;
    const Sections sections(file, bytes, owner, wanted, scene_kinds_of(wanted));
    RdxScene out;
    const SceneInfo stored =
        read_start<Camera>(sections, scene_info, scene_cameras, scene_names, out);
    // Of version 2: none.
    const auto shapes_view = [&]<class T>(SceneSectionId id, std::type_identity<T>) {
        return has_shapes ? sections.view<T>(id) : std::span<const T>();
    };
    const SceneArrays arrays{
        .scenes = sections.view<StoredScene>(scene_scenes),
        .geometries = sections.view<StoredGeometry>(scene_geometries),
        .meshes = sections.view<StoredMesh>(scene_meshes),
        .shapes = shapes_view(scene_shapes, std::type_identity<StoredShapes>()),
        .next_id = stored.next_id,
        .taken = sections.view<std::uint32_t>(scene_taken),
        .vertices = sections.view<Vec3>(scene_vertices),
        .triangles = sections.view<Triangle>(scene_triangles),
        .spheres = shapes_view(scene_spheres, std::type_identity<Sphere>()),
        .capsules = shapes_view(scene_capsules, std::type_identity<Capsule>()),
        .points = shapes_view(scene_points, std::type_identity<Vec3>()),
        .owner = owner,
        .trees = sections.view<StoredTree>(scene_trees),
        .nodes = sections.view<WideNode>(scene_nodes),
        .blocks = sections.view<TriangleBlock>(scene_blocks),
        .compact_nodes = sections.view<CompactNode>(scene_compact_nodes),
        .compact_blocks = sections.view<CompactBlock>(scene_compact_blocks),
        .corners = sections.view<Vec3>(scene_corners),
    };
    read_scene(sections, arrays, bytes.size(), out);
    return out;
}

RdxSceneD parse_scene_double(const std::string& file, std::span<const std::byte> bytes,
                             const std::shared_ptr<void>& owner) {
    if (!supported) throw BackendUnavailable(std::string(unsupported_text));
    const Sections sections(file, bytes, owner, double_version, double_kinds);
    RdxSceneD out;
    const SceneInfo stored =
        read_start<CameraD>(sections, double_info, double_cameras, double_names, out);
    const SceneArraysD arrays{
        .scenes = sections.view<StoredScene>(double_scenes),
        .geometries = sections.view<StoredGeometryD>(double_geometries),
        .meshes = sections.view<StoredMesh>(double_meshes),
        .shapes = sections.view<StoredShapesD>(double_shapes),
        .next_id = stored.next_id,
        .taken = sections.view<std::uint32_t>(double_taken),
        .vertices = sections.view<Vec3d>(double_vertices),
        .triangles = sections.view<Triangle>(double_triangles),
        .spheres = sections.view<SphereD>(double_spheres),
        .capsules = sections.view<CapsuleD>(double_capsules),
        .points = sections.view<Vec3d>(double_points),
        .owner = owner,
    };
    read_scene(sections, arrays, bytes.size(), out);
    return out;
}

}  // namespace raydix::rdx
