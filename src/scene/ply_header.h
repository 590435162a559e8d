// The head of a PLY file: which elements follow, how many, made of what.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "scene/text.h"

namespace raydix {

enum class PlyFormat { ascii, little_endian, big_endian };
enum class PlyType : std::uint8_t { i8, u8, i16, u16, i32, u32, f32, f64 };

[[nodiscard]] std::size_t byte_size(PlyType type);

struct PlyProperty {
    std::string name;
    PlyType type = PlyType::f32;
    bool is_list = false;
    PlyType count_type = PlyType::u8;  // of lists
};

struct PlyElement {
    std::string name;
    std::uint64_t count = 0;
    std::vector<PlyProperty> properties;

    /// Position of the property, or -1.
    [[nodiscard]] int find(std::string_view property) const;
    /// Bytes of one record in a binary file, 0 if lists make it vary.
    [[nodiscard]] std::size_t record_bytes() const;
};

struct PlyHeader {
    PlyFormat format = PlyFormat::ascii;
    std::vector<PlyElement> elements;
};

/// Reads up to and with the line end_header. Throws InputError that names the line.
[[nodiscard]] PlyHeader read_ply_header(LineReader& lines);

}  // namespace raydix
