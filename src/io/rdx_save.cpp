// Tree + scene -> .rdx file.
#include <raydix/error.h>
#include <raydix/rdx.h>

#include <array>

#include "io/rdx_faults.h"
#include "io/rdx_names.h"
#include "io/rdx_sections.h"
#include "scene/input_error.h"

namespace raydix {
namespace {

using rdx::content_of;
using rdx::length_of;
using rdx::SectionContent;

rdx::Info make_info(const Bvh& bvh, const Model& scene) {
    return {.kind = static_cast<std::uint32_t>(bvh.kind()),
            .builder = static_cast<std::uint32_t>(bvh.options().builder),
            .bits = static_cast<std::uint32_t>(bvh.options().bits),
            .max_leaf = static_cast<std::uint16_t>(bvh.options().max_leaf),
            .reinsertion_rounds = static_cast<std::uint16_t>(bvh.options().reinsertion_rounds),
            .flags = (bvh.options().strict ? rdx::strict_flag : 0) |
                     (bvh.refitted() ? rdx::refitted_flag : 0),
            .inner_count = bvh.inner_count(),
            .max_depth = bvh.max_depth(),
            .picture_width = scene.cameras.width,
            .picture_height = scene.cameras.height,
            .ao_radius = scene.cameras.ao_radius,
            .scene_name_bytes = length_of(scene.name),
            .mesh_name_bytes = length_of(scene.mesh().name),
            .input_count = bvh.input_count(),
            .left_out = bvh.left_out()};
}

SectionContent primitives_of(const Bvh& bvh) {
    switch (bvh.kind()) {
        case PrimitiveKind::triangles:
            return content_of(bvh.triangles());
        case PrimitiveKind::boxes:
            return content_of(bvh.boxes());
        case PrimitiveKind::points:
            break;
    }
    return content_of(bvh.points());
}

}  // namespace

void save_rdx(const std::filesystem::path& file, const Bvh& bvh, const Model& scene) {
    if (!rdx::supported) throw BackendUnavailable(std::string(rdx::unsupported_text));
    const Mesh& mesh = scene.mesh();
    Fault fault = rdx::name_fault(std::array{scene.name, mesh.name}, scene.cameras);
    if (!fault) fault = rdx::content_fault(bvh, mesh, scene.cameras);
    if (fault) input_error(printable(file), "not written", *fault);
    const rdx::Info info = make_info(bvh, scene);
    const rdx::PackedCameras packed(scene.name + mesh.name, scene.cameras.cameras);
    const std::array<SectionContent, rdx::section_count> contents{
        content_of(std::span<const rdx::Info>(&info, 1)),
        content_of(bvh.nodes()),
        content_of(bvh.order()),
        primitives_of(bvh),
        content_of(std::span<const Vec3>(mesh.vertices)),
        content_of(std::span<const Triangle>(mesh.triangles)),
        content_of(std::span<const rdx::Camera>(packed.cameras)),
        content_of(std::span<const char>(packed.names))};
    rdx::write_sections(file, rdx::version, contents);
}

}  // namespace raydix
