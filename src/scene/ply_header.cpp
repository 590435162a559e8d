// Lines of a PLY header -> PlyHeader.
#include "scene/ply_header.h"

#include <fmt/format.h>

#include <array>
#include <utility>

#include "scene/input_error.h"

namespace raydix {
namespace {

PlyType parse_type(const LineReader& lines, std::string_view word) {
    using enum PlyType;
    static constexpr std::array<std::pair<std::string_view, PlyType>, 16> names{{
        {"char", i8},
        {"uchar", u8},
        {"short", i16},
        {"ushort", u16},
        {"int", i32},
        {"uint", u32},
        {"float", f32},
        {"double", f64},
        {"int8", i8},
        {"uint8", u8},
        {"int16", i16},
        {"uint16", u16},
        {"int32", i32},
        {"uint32", u32},
        {"float32", f32},
        {"float64", f64},
    }};
    for (const auto& [name, type] : names)
        if (name == word) return type;
    lines.fail(fmt::format("unknown type {}", in_quotes(word)));
}

PlyFormat parse_format(const LineReader& lines, Words words) {
    const std::string_view format = words.next();
    if (format == "ascii") return PlyFormat::ascii;
    if (format == "binary_little_endian") return PlyFormat::little_endian;
    if (format == "binary_big_endian") return PlyFormat::big_endian;
    lines.fail(fmt::format("unknown format {}", in_quotes(format)));
}

PlyElement parse_element(const LineReader& lines, Words words) {
    PlyElement element;
    element.name = readable(words.next());
    std::int64_t count = 0;
    if (element.name.empty() || !words.integer(count) || count < 0)
        lines.fail("expected \"element NAME COUNT\" with a count from 0 to 2^63 - 1");
    element.count = static_cast<std::uint64_t>(count);
    return element;
}

PlyProperty parse_property(const LineReader& lines, Words words) {
    PlyProperty property;
    std::string_view type = words.next();
    if (type == "list") {
        property.is_list = true;
        property.count_type = parse_type(lines, words.next());
        if (property.count_type == PlyType::f32 || property.count_type == PlyType::f64)
            lines.fail("the length of a list must have an integer type");
        type = words.next();
    }
    property.type = parse_type(lines, type);
    property.name = readable(words.next());
    if (property.name.empty()) lines.fail("a property without a name");
    return property;
}

}  // namespace

std::size_t byte_size(PlyType type) {
    static constexpr std::array<std::size_t, 8> sizes{1, 1, 2, 2, 4, 4, 4, 8};
    return sizes[static_cast<std::size_t>(type)];
}

int PlyElement::find(std::string_view property) const {
    for (std::size_t i = 0; i < properties.size(); ++i)
        if (properties[i].name == property) return static_cast<int>(i);
    return -1;
}

std::size_t PlyElement::record_bytes() const {
    std::size_t bytes = 0;
    for (const PlyProperty& property : properties) {
        if (property.is_list) return 0;
        bytes += byte_size(property.type);
    }
    return bytes;
}

PlyHeader read_ply_header(LineReader& lines) {
    PlyHeader header;
    bool has_format = false;
    std::string_view line;
    if (!lines.next(line) || Words(line).next() != "ply")
        lines.source().fail("header", "does not start with \"ply\"");
    while (lines.next(line)) {
        Words words(line);
        const std::string_view keyword = words.next();
        if (keyword == "end_header") {
            if (!has_format) lines.fail("no format line before end_header");
            return header;
        }
        if (keyword == "format") {
            header.format = parse_format(lines, words);
            has_format = true;
        } else if (keyword == "element") {
            header.elements.push_back(parse_element(lines, words));
        } else if (keyword == "property") {
            if (header.elements.empty()) lines.fail("a property before the first element");
            header.elements.back().properties.push_back(parse_property(lines, words));
        } else if (!keyword.empty() && keyword != "comment" && keyword != "obj_info") {
            lines.fail(fmt::format("unknown keyword {}", in_quotes(keyword)));
        }
    }
    lines.source().fail("header", "file ends before end_header");
}

}  // namespace raydix
