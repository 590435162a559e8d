// Trust grows step by step: lengths and checksums (rdx_sections.h), then numbers, then every
// invariant of the tree. Nothing is used before all has passed.
#include "io/rdx_parse.h"

#include <raydix/error.h>
#include <raydix/rdx.h>

#include <fmt/format.h>

#include "io/rdx_faults.h"
#include "io/rdx_names.h"
#include "io/rdx_sections.h"
#include "tree/bvh_internals.h"

namespace raydix::rdx {
namespace {

class Parser {
public:
    Parser(const std::string& file, std::span<const std::byte> bytes,
           const std::shared_ptr<void>& owner)
        : sections_(file, bytes, owner, version, tree_kinds) {}

    RdxFile parse() {
        read_info();
        RdxFile result;
        read_scene(result.scene);
        read_tree(result.bvh);
        if (const Fault fault =
                content_fault(result.bvh, result.scene.mesh(), result.scene.cameras))
            throw InputError(fmt::format("{}: {}", sections_.file(), *fault));
        return result;
    }

private:
    void read_info() {
        info_ = sections_.only<Info>(info);
        if (info_.flags > (strict_flag | refitted_flag))
            sections_.fail("info", fmt::format("flags are {}, not 0 to 3", info_.flags));
        if (info_.kind > static_cast<std::uint32_t>(PrimitiveKind::points))
            sections_.fail("info", fmt::format("primitive kind {} is unknown", info_.kind));
        const std::uint32_t expected = primitive_bytes(static_cast<PrimitiveKind>(info_.kind));
        if (sections_[primitives].element_bytes != expected)
            sections_.fail("primitives",
                           fmt::format("elements of {} bytes, those of kind {} have {}",
                                       sections_[primitives].element_bytes, info_.kind, expected));
    }

    void read_scene(Model& scene) const {
        const auto vertex_view = sections_.view<Vec3>(vertices);
        const auto triangle_view = sections_.view<Triangle>(triangles);
        scene.mesh().vertices.assign(vertex_view.begin(), vertex_view.end());
        scene.mesh().triangles.assign(triangle_view.begin(), triangle_view.end());
        scene.cameras.width = info_.picture_width;
        scene.cameras.height = info_.picture_height;
        scene.cameras.ao_radius = info_.ao_radius;

        NameReader reader(sections_, names);
        scene.name = reader.next(info_.scene_name_bytes);
        scene.mesh().name = reader.next(info_.mesh_name_bytes);
        scene.cameras.cameras = reader.cameras(sections_.view<Camera>(cameras));
        reader.finish();
    }

    void read_tree(Bvh& bvh) const {
        const BvhInternals tree{bvh};
        tree.kind() = static_cast<PrimitiveKind>(info_.kind);
        tree.options().builder = static_cast<Builder>(info_.builder);
        tree.options().bits = static_cast<int>(info_.bits);
        tree.options().max_leaf = info_.max_leaf;
        tree.options().reinsertion_rounds = info_.reinsertion_rounds;
        tree.options().strict = (info_.flags & strict_flag) != 0;
        tree.refitted() = (info_.flags & refitted_flag) != 0;
        tree.inner_count() = info_.inner_count;
        tree.max_depth() = info_.max_depth;
        tree.input_count() = info_.input_count;
        tree.left_out() = info_.left_out;
        tree.nodes() = sections_.buffer<BvhNode>(nodes);
        tree.order() = sections_.buffer<std::uint32_t>(order);
        switch (bvh.kind()) {
            case PrimitiveKind::triangles:
                tree.triangles() = sections_.buffer<LeafTriangle>(primitives);
                return;
            case PrimitiveKind::boxes:
                tree.boxes() = sections_.buffer<Aabb>(primitives);
                return;
            case PrimitiveKind::points:
                tree.points() = sections_.buffer<Vec3>(primitives);
                return;
        }
    }

    Sections sections_;
    Info info_{};
};

}  // namespace

RdxFile parse(const std::string& file, std::span<const std::byte> bytes,
              const std::shared_ptr<void>& owner) {
    if (!supported) throw BackendUnavailable(std::string(unsupported_text));
    return Parser(file, bytes, owner).parse();
}

}  // namespace raydix::rdx
