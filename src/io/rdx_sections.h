// The sections of an .rdx file of any version: where they must lie, what they must hold at least,
// and how they are written.
#pragma once

#include <raydix/buffer.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "io/rdx_format.h"

namespace raydix::rdx {

struct SectionKind {
    std::string_view name;
    std::array<std::uint32_t, 3> element_bytes;  // one of them; 0: none
};

/// Of version 1, in the order of the file.
inline constexpr std::array<SectionKind, section_count> tree_kinds{{
    {"info", {sizeof(Info)}},
    {"nodes", {sizeof(BvhNode)}},
    {"order", {sizeof(std::uint32_t)}},
    {"primitives", {sizeof(LeafTriangle), sizeof(Aabb), sizeof(Vec3)}},
    {"vertices", {sizeof(Vec3)}},
    {"triangles", {sizeof(Triangle)}},
    {"cameras", {sizeof(Camera)}},
    {"names", {1}},
}};

/// The version that a file names in its header. Throws InputError if it is no .rdx file, or of a
/// version that is unknown.
[[nodiscard]] std::uint32_t version_of(const std::string& file, std::span<const std::byte> bytes);

/// Views of the sections of a file, when lengths and checksums have been found right. Nothing is
/// allocated in proportion to what a header claims.
class Sections {
public:
    enum class Checked { header, all };
    /// `checked`: whose checksums are compared. Throws InputError("FILE: SECTION: reason").
    Sections(const std::string& file, std::span<const std::byte> bytes, std::shared_ptr<void> owner,
             std::uint32_t wanted, std::span<const SectionKind> kinds,
             Checked checked = Checked::all);

    [[noreturn]] void fail(std::string_view section, const std::string& reason) const;

    [[nodiscard]] const Section& operator[](std::size_t id) const { return table_[id]; }
    [[nodiscard]] std::span<const std::byte> bytes(std::size_t id) const {
        return bytes_.subspan(table_[id].offset, table_[id].count * table_[id].element_bytes);
    }
    template <class T>
    [[nodiscard]] std::span<const T> view(std::size_t id) const {
        return {reinterpret_cast<const T*>(bytes(id).data()), table_[id].count};
    }
    /// Of an array that is handed out as const only, so that nobody writes through the pointer.
    template <class T>
    [[nodiscard]] Buffer<T> buffer(std::size_t id) const {
        const std::span<const T> elements = view<T>(id);
        return {owner_, const_cast<T*>(elements.data()), elements.size()};
    }
    /// The one element of a section.
    template <class T>
    [[nodiscard]] T only(std::size_t id) const {
        if (table_[id].count != 1)
            fail(kinds_[id].name, std::to_string(table_[id].count) + " of them, not 1");
        return view<T>(id).front();
    }
    [[nodiscard]] const std::string& file() const { return file_; }
    [[nodiscard]] const std::shared_ptr<void>& owner() const { return owner_; }

private:
    void read_header(std::uint32_t wanted);
    void check_places() const;
    void check_checksums() const;

    const std::string& file_;
    std::span<const std::byte> bytes_;
    std::shared_ptr<void> owner_;
    std::span<const SectionKind> kinds_;
    std::vector<Section> table_;
};

/// The bytes of a section, in one piece or several.
struct SectionContent {
    std::uint32_t element_bytes = 0;
    std::vector<std::span<const std::byte>> pieces;

    [[nodiscard]] std::uint64_t bytes() const {
        std::uint64_t sum = 0;
        for (const auto piece : pieces) sum += piece.size();
        return sum;
    }
};
template <class T>
[[nodiscard]] SectionContent content_of(std::span<const T> elements) {
    return {sizeof(T), {std::as_bytes(elements)}};
}

/// As write_pieces of base/write_file.h.
void write_sections(const std::filesystem::path& file, std::uint32_t file_version,
                    std::span<const SectionContent> contents);

}  // namespace raydix::rdx
