// Trust grows step by step: lengths, then checksums, then numbers, then every invariant of the
// tree. Nothing is allocated before the lengths agree with the file, and nothing is used before all
// has passed.
#include "api/rdx_parse.h"

#include <raydix/error.h>

#include <fmt/format.h>

#include <algorithm>
#include <cstring>

#include "api/rdx_faults.h"
#include "api/rdx_format.h"
#include "exec/parallel.h"
#include "scene/input_error.h"
#include "tree/bvh_access.h"

namespace raydix::rdx {
namespace {

class Parser {
public:
    Parser(const std::string& file, std::span<const std::byte> bytes, std::shared_ptr<void> owner)
        : file_(file), bytes_(bytes), owner_(std::move(owner)) {}

    RdxFile parse() {
        read_header();
        check_places();
        check_checksums();
        read_info();
        RdxFile result;
        read_scene(result.scene);
        read_tree(result.bvh);
        if (const Fault fault =
                content_fault(result.bvh, result.scene.mesh(), result.scene.cameras))
            throw InputError(fmt::format("{}: {}", file_, *fault));
        return result;
    }

private:
    [[noreturn]] void fail(std::string_view section, const std::string& reason) const {
        input_error(file_, section, reason);
    }

    void read_header() {
        if (bytes_.size() < sizeof(Header))
            fail("header", fmt::format("the file has {} bytes, a header has {}", bytes_.size(),
                                       sizeof(Header)));
        std::memcpy(&header_, bytes_.data(), sizeof(Header));
        if (header_.magic != magic) fail("header", "this is no .rdx file");
        if (header_.version != version)
            fail("header",
                 fmt::format("version {}; this program reads {}", header_.version, version));
        if (header_.file_bytes != bytes_.size())
            fail("header", fmt::format("{} bytes promised, but the file has {}", header_.file_bytes,
                                       bytes_.size()));
        if (checksum_of(header_) != header_.checksum) fail("header", "the checksum is wrong");
        if (header_.section_count != section_count)
            fail("header", fmt::format("{} sections; version {} has {}", header_.section_count,
                                       version, static_cast<std::uint32_t>(section_count)));
        if (std::ranges::any_of(header_.reserved, [](unsigned char c) { return c != 0; }))
            fail("header", "the reserved bytes are not zero");
    }

    /// Each section stands where the one before ends, so they cannot overlap, and all but zeros is
    /// in one.
    void check_places() const {
        std::uint64_t end = sizeof(Header);
        for (std::uint32_t id = 0; id < section_count; ++id) {
            const Section& section = header_.sections[id];
            if (section.id != id || section.offset != aligned(end))
                fail(section_names[id],
                     fmt::format("number {} at byte {}, not number {} at byte {}", section.id,
                                 section.offset, id, aligned(end)));
            if (section.offset > bytes_.size())
                fail(section_names[id], "begins behind the end of the file");
            check_element_bytes(id);
            const std::uint64_t room = bytes_.size() - section.offset;
            if (section.count > room / section.element_bytes)
                fail(section_names[id],
                     fmt::format("{} elements of {} bytes, but {} bytes are left", section.count,
                                 section.element_bytes, room));
            const auto padding = bytes_.subspan(end, section.offset - end);
            if (std::ranges::any_of(padding, [](std::byte b) { return b != std::byte{0}; }))
                fail(section_names[id], "the padding before it is not zero");
            end = section.offset + section.count * section.element_bytes;
        }
        if (end != bytes_.size())
            fail(section_names.back(),
                 fmt::format("ends at byte {}, the file at {}", end, bytes_.size()));
    }

    void check_element_bytes(std::uint32_t id) const {
        constexpr std::array<std::uint32_t, section_count> expected{
            sizeof(Info), sizeof(BvhNode),  sizeof(std::uint32_t), 0,
            sizeof(Vec3), sizeof(Triangle), sizeof(Camera),        1};
        const std::uint32_t actual = header_.sections[id].element_bytes;
        const bool right = id == primitives ? actual == sizeof(LeafTriangle) ||
                                                  actual == sizeof(Aabb) || actual == sizeof(Vec3)
                                            : actual == expected[id];
        if (!right) fail(section_names[id], fmt::format("elements of {} bytes", actual));
    }

    void check_checksums() const {
        std::array<Checksum, section_count> found;
        for_each_index(
            section_count, [&](std::size_t id) { found[id] = checksum_of(section_bytes(id)); }, 1);
        for (std::size_t id = 0; id < section_count; ++id)
            if (found[id] != header_.sections[id].checksum)
                fail(section_names[id], "the checksum is wrong");
    }

    void read_info() {
        if (header_.sections[info].count != 1)
            fail("info", fmt::format("{} of them, not 1", header_.sections[info].count));
        std::memcpy(&info_, section_bytes(info).data(), sizeof(Info));
        if (info_.flags > (strict_flag | refitted_flag))
            fail("info", fmt::format("flags are {}, not 0 to 3", info_.flags));
        if (info_.kind > static_cast<std::uint32_t>(PrimitiveKind::points))
            fail("info", fmt::format("primitive kind {} is unknown", info_.kind));
        const std::uint32_t expected = primitive_bytes(static_cast<PrimitiveKind>(info_.kind));
        if (header_.sections[primitives].element_bytes != expected)
            fail("primitives",
                 fmt::format("elements of {} bytes, those of kind {} have {}",
                             header_.sections[primitives].element_bytes, info_.kind, expected));
    }

    void read_scene(Model& scene) const {
        const auto vertex_view = view<Vec3>(vertices);
        const auto triangle_view = view<Triangle>(triangles);
        scene.mesh().vertices.assign(vertex_view.begin(), vertex_view.end());
        scene.mesh().triangles.assign(triangle_view.begin(), triangle_view.end());
        scene.cameras.width = info_.picture_width;
        scene.cameras.height = info_.picture_height;
        scene.cameras.ao_radius = info_.ao_radius;

        std::span<const char> rest = view<char>(names);
        const auto next_name = [&](std::uint32_t length) {
            if (length > rest.size())
                fail("names",
                     fmt::format("a name of {} bytes, but {} are left", length, rest.size()));
            const std::span<const char> name = rest.first(length);
            rest = rest.subspan(length);
            return std::string(name.begin(), name.end());
        };
        scene.name = next_name(info_.scene_name_bytes);
        scene.mesh().name = next_name(info_.mesh_name_bytes);
        for (const Camera& c : view<Camera>(cameras))
            scene.cameras.cameras.push_back(
                {next_name(c.name_bytes), c.position, c.target, c.up, c.vfov});
        if (!rest.empty()) fail("names", fmt::format("{} bytes belong to no name", rest.size()));
    }

    void read_tree(Bvh& bvh) const {
        const BvhAccess tree{bvh};
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
        tree.nodes() = buffer<BvhNode>(nodes);
        tree.order() = buffer<std::uint32_t>(order);
        switch (bvh.kind()) {
            case PrimitiveKind::triangles:
                tree.triangles() = buffer<LeafTriangle>(primitives);
                return;
            case PrimitiveKind::boxes:
                tree.boxes() = buffer<Aabb>(primitives);
                return;
            case PrimitiveKind::points:
                tree.points() = buffer<Vec3>(primitives);
                return;
        }
    }

    [[nodiscard]] std::span<const std::byte> section_bytes(std::size_t id) const {
        const Section& section = header_.sections[id];
        return bytes_.subspan(section.offset, section.count * section.element_bytes);
    }

    template <class T>
    [[nodiscard]] std::span<const T> view(SectionId id) const {
        return {reinterpret_cast<const T*>(section_bytes(id).data()), header_.sections[id].count};
    }

    /// A Bvh hands its arrays out as const only, so nobody writes through the pointer.
    template <class T>
    [[nodiscard]] Buffer<T> buffer(SectionId id) const {
        const std::span<const T> elements = view<T>(id);
        return {owner_, const_cast<T*>(elements.data()), elements.size()};
    }

    const std::string& file_;
    std::span<const std::byte> bytes_;
    std::shared_ptr<void> owner_;
    Header header_{};
    Info info_{};
};

}  // namespace

RdxFile parse(const std::string& file, std::span<const std::byte> bytes,
              const std::shared_ptr<void>& owner) {
    if (!supported) throw BackendUnavailable(std::string(unsupported_text));
    return Parser(file, bytes, owner).parse();
}

}  // namespace raydix::rdx
