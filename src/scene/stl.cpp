// STL, ascii or binary -> mesh with three vertices per facet, in file order and not welded.
#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cctype>
#include <cstring>

#include "scene/formats.h"
#include "scene/input_error.h"
#include "scene/mesh_builder.h"
#include "scene/text.h"

namespace raydix {
namespace {

constexpr std::size_t head_bytes = 84;   // 80 of any text, then the number of facets
constexpr std::size_t facet_bytes = 50;  // normal, three positions, two bytes of attributes

std::uint32_t load_u32(const char* bytes) {
    std::uint32_t value = 0;
    for (unsigned i = 0; i < 4; ++i)
        value |= std::uint32_t{static_cast<unsigned char>(bytes[i])} << (8 * i);
    return value;
}

Vec3 load_position(const char* bytes) {
    return {std::bit_cast<float>(load_u32(bytes)), std::bit_cast<float>(load_u32(bytes + 4)),
            std::bit_cast<float>(load_u32(bytes + 8))};
}

/// Many binary files start with "solid" too, but no text holds a zero byte and hardly a binary file
/// lacks one.
bool is_ascii(ByteSource& in) {
    in.fill(1024);
    const std::string_view start = in.buffered().substr(0, 1024);
    return start.substr(std::min(start.find_first_not_of(" \t\r\n"), start.size()))
               .starts_with("solid") &&
           start.find('\0') == std::string_view::npos;
}

void add_facet(const ByteSource& in, Mesh& mesh, const std::array<Vec3, 3>& corners) {
    const std::size_t first = mesh.vertices.size();
    for (const Vec3& corner : corners) add_vertex(in, mesh, corner);
    const auto base = static_cast<std::uint32_t>(first);
    add_triangle(in, mesh, {base, base + 1, base + 2});
}

Mesh load_binary_stl(ByteSource& in) {
    if (!in.fill(head_bytes))
        in.fail("header", "neither \"solid\" nor the 84 bytes of a binary STL header");
    const std::uint32_t count = load_u32(in.buffered().data() + 80);
    in.consume(head_bytes);
    Mesh mesh;
    reserve_for(in, mesh.vertices, 3 * std::uint64_t{count}, facet_bytes / 3);
    reserve_for(in, mesh.triangles, count, facet_bytes);
    for (std::uint32_t i = 0; i < count; ++i) {
        if (!in.fill(facet_bytes))
            in.fail(fmt::format("facet {}", std::uint64_t{i} + 1),
                    fmt::format("file ends after {} of {} facets", i, count));
        const char* facet = in.buffered().data() + 12;
        add_facet(in, mesh,
                  {load_position(facet), load_position(facet + 12), load_position(facet + 24)});
        in.consume(facet_bytes);
    }
    return mesh;
}

/// Reads statement by statement, one a line. Between "facet" and "endfacet" there must be three
/// vertices.
class AsciiStl {
public:
    explicit AsciiStl(ByteSource& in) : in_(in), lines_(in) {}

    Mesh read() {
        std::string_view line;
        while (lines_.next_filled(line)) {
            Words words(line);
            read_statement(lower(words.next()), words);
        }
        if (in_solid_ || in_facet_) in_.fail(facet_name(), "file ends before endsolid");
        return std::move(mesh_);
    }

private:
    void read_statement(const std::string& keyword, Words& words) {
        if (keyword == "vertex") return read_vertex(words);
        if (keyword == "outer" || keyword == "endloop") return require(in_facet_, keyword);
        if (keyword == "facet") {
            require(in_solid_ && !in_facet_, keyword);
            in_facet_ = true;
            corner_count_ = 0;
        } else if (keyword == "endfacet") {
            require(in_facet_, keyword);
            if (corner_count_ != 3)
                in_.fail(facet_name(), fmt::format("{} vertices instead of 3", corner_count_));
            add_facet(in_, mesh_, corners_);
            in_facet_ = false;
        } else if (keyword == "solid" || keyword == "endsolid") {
            require(!in_facet_ && in_solid_ == (keyword == "endsolid"), keyword);
            in_solid_ = !in_solid_;
        } else {
            lines_.fail(fmt::format("{} is not an STL statement", in_quotes(keyword)));
        }
    }

    void read_vertex(Words& words) {
        require(in_facet_, "vertex");
        Vec3 p{};
        if (!words.number(p.x) || !words.number(p.y) || !words.number(p.z)) {
            const std::string_view word = words.next();
            in_.fail(facet_name(),
                     fmt::format("{} in line {}",
                                 word.empty() ? "a vertex with less than three numbers"
                                              : in_quotes(word) + " is not a number",
                                 lines_.number()));
        }
        if (corner_count_ < 3) corners_[corner_count_] = p;
        ++corner_count_;
    }

    void require(bool fits, std::string_view keyword) const {
        if (!fits) lines_.fail(fmt::format("{} out of place", in_quotes(keyword)));
    }

    [[nodiscard]] std::string facet_name() const {
        return fmt::format("facet {}", mesh_.triangles.size() + 1);
    }

    static std::string lower(std::string_view word) {
        std::string text(word);
        for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
        return text;
    }

    ByteSource& in_;
    LineReader lines_;
    Mesh mesh_;
    std::array<Vec3, 3> corners_{};
    std::size_t corner_count_ = 0;
    bool in_solid_ = false, in_facet_ = false;
};

}  // namespace

Mesh load_stl(ByteSource& in) { return is_ascii(in) ? AsciiStl(in).read() : load_binary_stl(in); }

}  // namespace raydix
