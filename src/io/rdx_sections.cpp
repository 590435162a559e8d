#include "io/rdx_sections.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <utility>

#include "base/write_file.h"
#include "exec/parallel.h"
#include "scene/input_error.h"

namespace raydix::rdx {
namespace {

constexpr std::size_t header_bytes(std::size_t sections) {
    return sizeof(HeaderStart) + sections * sizeof(Section);
}

}  // namespace

std::uint32_t version_of(const std::string& file, std::span<const std::byte> bytes) {
    if (bytes.size() < sizeof(HeaderStart))
        input_error(file, "header",
                    fmt::format("the file has {} bytes, a header has more than {}", bytes.size(),
                                sizeof(HeaderStart)));
    HeaderStart start;
    std::memcpy(&start, bytes.data(), sizeof(start));
    if (start.magic != magic) input_error(file, "header", "this is no .rdx file");
    if (start.version < version || start.version > double_version)
        input_error(file, "header",
                    fmt::format("version {}; this program reads {} to {}", start.version, version,
                                double_version));
    return start.version;
}

Sections::Sections(const std::string& file, std::span<const std::byte> bytes,
                   std::shared_ptr<void> owner, std::uint32_t wanted,
                   std::span<const SectionKind> kinds_wanted, Checked checked)
    : file_(file),
      bytes_(bytes),
      owner_(std::move(owner)),
      kinds_(kinds_wanted),
      table_(kinds_wanted.size()) {
    read_header(wanted);
    check_places();
    if (checked == Checked::all) check_checksums();
}

void Sections::fail(std::string_view section, const std::string& reason) const {
    input_error(file_, section, reason);
}

void Sections::read_header(std::uint32_t wanted) {
    const std::uint32_t actual = version_of(file_, bytes_);
    if (actual != wanted)
        fail("header",
             actual == version ? "this file holds a tree, not a scene (load_rdx reads it; raydix "
                                 "build --layout wide8 -o saves scenes)"
             : actual == double_version
                 ? "this file holds a scene in double (load_rdx_scene_double)"
             : wanted == double_version ? "this file holds a scene in float (load_rdx_scene)"
                                        : "this file holds a scene, not a tree (load_rdx_scene)");
    const std::size_t whole = header_bytes(kinds_.size());
    if (bytes_.size() < whole)
        fail("header", fmt::format("the file has {} bytes, a header has {}", bytes_.size(), whole));
    HeaderStart start;
    std::memcpy(&start, bytes_.data(), sizeof(start));
    if (start.file_bytes != bytes_.size())
        fail("header", fmt::format("{} bytes promised, but the file has {}", start.file_bytes,
                                   bytes_.size()));
    if (header_checksum(bytes_.first(whole)) != start.checksum)
        fail("header", "the checksum is wrong");
    if (start.section_count != kinds_.size())
        fail("header", fmt::format("{} sections; version {} has {}", start.section_count, wanted,
                                   kinds_.size()));
    if (std::ranges::any_of(start.reserved, [](unsigned char c) { return c != 0; }))
        fail("header", "the reserved bytes are not zero");
    std::memcpy(table_.data(), bytes_.data() + sizeof(start), table_.size() * sizeof(Section));
}

/// Each section stands where the one before ends, so they cannot overlap, and all but zeros is in
/// one.
void Sections::check_places() const {
    std::uint64_t end = header_bytes(kinds_.size());
    for (std::uint32_t id = 0; id < kinds_.size(); ++id) {
        const Section& section = table_[id];
        const SectionKind& kind = kinds_[id];
        if (section.id != id || section.offset != aligned(end))
            fail(kind.name, fmt::format("number {} at byte {}, not number {} at byte {}",
                                        section.id, section.offset, id, aligned(end)));
        if (section.offset > bytes_.size()) fail(kind.name, "begins behind the end of the file");
        if (section.element_bytes == 0 ||
            std::ranges::find(kind.element_bytes, section.element_bytes) ==
                kind.element_bytes.end())
            fail(kind.name, fmt::format("elements of {} bytes", section.element_bytes));
        const std::uint64_t room = bytes_.size() - section.offset;
        if (section.count > room / section.element_bytes)
            fail(kind.name, fmt::format("{} elements of {} bytes, but {} bytes are left",
                                        section.count, section.element_bytes, room));
        const auto padding = bytes_.subspan(end, section.offset - end);
        if (std::ranges::any_of(padding, [](std::byte b) { return b != std::byte{0}; }))
            fail(kind.name, "the padding before it is not zero");
        end = section.offset + section.count * section.element_bytes;
    }
    if (end != bytes_.size())
        fail(kinds_.back().name,
             fmt::format("ends at byte {}, the file at {}", end, bytes_.size()));
}

void Sections::check_checksums() const {
    std::vector<Checksum> found(kinds_.size());
    for_each_index(
        kinds_.size(), [&](std::size_t id) { found[id] = checksum_of(bytes(id)); }, 1);
    for (std::size_t id = 0; id < kinds_.size(); ++id)
        if (found[id] != table_[id].checksum) fail(kinds_[id].name, "the checksum is wrong");
}

void write_sections(const std::filesystem::path& file, std::uint32_t file_version,
                    std::span<const SectionContent> contents) {
    std::vector<Section> table(contents.size());
    const std::size_t whole = header_bytes(contents.size());
    std::uint64_t end = whole;
    for (std::uint32_t id = 0; id < contents.size(); ++id) {
        const SectionContent& content = contents[id];
        const std::uint64_t bytes = content.bytes();
        table[id] = {aligned(end), bytes / content.element_bytes, id, content.element_bytes, {}};
        end = table[id].offset + bytes;
    }
    for_each_index(
        contents.size(),
        [&](std::size_t id) { table[id].checksum = checksum_of(contents[id].pieces); }, 1);
    const HeaderStart start{.magic = magic,
                            .version = file_version,
                            .section_count = static_cast<std::uint32_t>(contents.size()),
                            .file_bytes = end,
                            .checksum = {},
                            .reserved = {}};
    std::vector<std::byte> header(whole);
    const auto put_start = [&](const HeaderStart& from) {
        std::memcpy(header.data(), &from, sizeof(from));
    };
    put_start(start);
    std::memcpy(header.data() + sizeof(start), table.data(), table.size() * sizeof(Section));
    HeaderStart sealed = start;
    sealed.checksum = header_checksum(header);
    put_start(sealed);

    constexpr std::array<std::byte, alignment> zeros{};
    std::vector<std::span<const std::byte>> pieces{header};
    std::uint64_t position = whole;
    for (std::size_t id = 0; id < contents.size(); ++id) {
        pieces.push_back(std::span(zeros).first(table[id].offset - position));
        pieces.insert(pieces.end(), contents[id].pieces.begin(), contents[id].pieces.end());
        position = table[id].offset + contents[id].bytes();
    }
    write_pieces(file, pieces);
}

}  // namespace raydix::rdx
