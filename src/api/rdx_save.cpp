// Tree + scene -> .rdx file.
#include <raydix/error.h>
#include <raydix/rdx.h>

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "api/rdx_faults.h"
#include "api/rdx_format.h"
#include "base/write_file.h"
#include "exec/parallel.h"
#include "scene/input_error.h"

namespace raydix {
namespace {

struct Content {
    std::uint32_t element_bytes;
    std::span<const std::byte> bytes;
};
template <class T>
Content content(std::span<const T> elements) {
    return {sizeof(T), std::as_bytes(elements)};
}

/// `name_fault` has made sure that it fits.
std::uint32_t length_of(const std::string& name) { return static_cast<std::uint32_t>(name.size()); }

Fault name_fault(const Model& scene) {
    const auto too_long = [](const std::string& name) { return name.size() > UINT32_MAX; };
    const bool any = too_long(scene.name) || too_long(scene.mesh().name) ||
                     std::ranges::any_of(scene.cameras.cameras, too_long, &Camera::name);
    if (!any) return {};
    return fmt::format("names: one has more than {} bytes", UINT32_MAX);
}

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

/// The sections that are not arrays of the tree or the mesh already.
struct Packed {
    rdx::Info info;
    std::vector<rdx::Camera> cameras;
    std::string names;

    Packed(const Bvh& bvh, const Model& scene)
        : info(make_info(bvh, scene)), names(scene.name + scene.mesh().name) {
        for (const Camera& c : scene.cameras.cameras) {
            cameras.push_back({c.position, c.target, c.up, c.vfov, length_of(c.name)});
            names += c.name;
        }
    }
};

using Contents = std::array<Content, rdx::section_count>;

Content primitives_of(const Bvh& bvh) {
    switch (bvh.kind()) {
        case PrimitiveKind::triangles:
            return content(bvh.triangles());
        case PrimitiveKind::boxes:
            return content(bvh.boxes());
        case PrimitiveKind::points:
            break;
    }
    return content(bvh.points());
}

Contents contents_of(const Packed& packed, const Bvh& bvh, const Mesh& mesh) {
    return {content(std::span(&packed.info, 1)),
            content(bvh.nodes()),
            content(bvh.order()),
            primitives_of(bvh),
            content(std::span(mesh.vertices)),
            content(std::span(mesh.triangles)),
            content(std::span(packed.cameras)),
            content(std::span<const char>(packed.names))};
}

rdx::Header make_header(const Contents& contents) {
    rdx::Header header{};
    header.magic = rdx::magic;
    header.version = rdx::version;
    header.section_count = rdx::section_count;
    std::uint64_t end = sizeof(rdx::Header);
    for (std::uint32_t id = 0; id < rdx::section_count; ++id) {
        const Content& c = contents[id];
        header.sections[id] = {
            rdx::aligned(end), c.bytes.size() / c.element_bytes, id, c.element_bytes, {}};
        end = header.sections[id].offset + c.bytes.size();
    }
    header.file_bytes = end;
    for_each_index(
        contents.size(),
        [&](std::size_t id) {
            header.sections[id].checksum = rdx::checksum_of(contents[id].bytes);
        },
        1);
    header.checksum = rdx::checksum_of(header);
    return header;
}

void write(const std::filesystem::path& file, const rdx::Header& header, const Contents& contents) {
    constexpr std::array<std::byte, rdx::alignment> zeros{};
    std::vector<std::span<const std::byte>> pieces{std::as_bytes(std::span(&header, 1))};
    std::uint64_t position = sizeof(header);
    for (std::size_t id = 0; id < contents.size(); ++id) {
        pieces.push_back(std::span(zeros).first(header.sections[id].offset - position));
        pieces.push_back(contents[id].bytes);
        position = header.sections[id].offset + contents[id].bytes.size();
    }
    write_pieces(file, pieces);
}

}  // namespace

void save_rdx(const std::filesystem::path& file, const Bvh& bvh, const Model& scene) {
    if (!rdx::supported) throw BackendUnavailable(std::string(rdx::unsupported_text));
    Fault fault = name_fault(scene);
    if (!fault) fault = rdx::content_fault(bvh, scene.mesh(), scene.cameras);
    if (fault) input_error(printable(file), "not written", *fault);
    const Packed packed(bvh, scene);
    const Contents contents = contents_of(packed, bvh, scene.mesh());
    write(file, make_header(contents), contents);
}

}  // namespace raydix
