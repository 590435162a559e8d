// What the ascii and the binary PLY reader share: the part an element plays for a mesh.
#pragma once

#include "scene/mesh_builder.h"
#include "scene/ply_header.h"

namespace raydix {

enum class PlyRole { none, vertices, faces, strips };

/// An element with the properties that matter: x, y, z of vertices, the index list of faces and
/// strips.
struct PlyPart {
    const PlyElement* element = nullptr;
    PlyRole role = PlyRole::none;
    std::array<int, 3> position{-1, -1, -1};
    int index_list = -1;
};

/// Where a reader stands: element `number` (from 1) of `part` is next.
[[noreturn]] inline void fail_at_end(const ByteSource& in, const PlyElement& element,
                                     std::uint64_t number) {
    in.fail(fmt::format("{} {}", element.name, number),
            fmt::format("file ends after {} of {}", number - 1, element.count));
}

/// Takes the indices of one strip, -1 starts anew; every second triangle is turned so that all face
/// the same way.
class PlyStrip {
public:
    PlyStrip(const ByteSource& in, Mesh& mesh) : in_(in), mesh_(mesh) {}

    void restart() { length_ = 0; }
    void add_corner(std::uint32_t vertex) {
        if (length_ >= 2) {
            const bool odd = length_ % 2 != 0;
            add_triangle(in_, mesh_, {odd ? last_ : before_, odd ? before_ : last_, vertex});
        }
        before_ = last_;
        last_ = vertex;
        ++length_;
    }

private:
    const ByteSource& in_;
    Mesh& mesh_;
    std::uint32_t before_ = 0, last_ = 0;
    std::uint64_t length_ = 0;
};

/// Hands the indices of one list to a fan or a strip, checked against the header's number of
/// vertices.
class PlyIndexSink {
public:
    PlyIndexSink(const ByteSource& in, Mesh& mesh, const PlyPart& part, std::uint64_t number,
                 std::uint64_t vertex_count)
        : in_(in),
          number_(number),
          vertex_count_(vertex_count),
          is_strip_(part.role == PlyRole::strips),
          fan_(in, mesh),
          strip_(in, mesh) {}

    void add(std::int64_t index) {
        if (is_strip_ && index == -1) return strip_.restart();
        const std::uint32_t vertex = checked_index(in_, number_, index, vertex_count_);
        if (is_strip_)
            strip_.add_corner(vertex);
        else
            fan_.add_corner(vertex);
    }

private:
    const ByteSource& in_;
    std::uint64_t number_, vertex_count_;
    bool is_strip_;
    PolygonFan fan_;
    PlyStrip strip_;
};

/// Read one element after the header; `vertex_count` is what the header says.
void read_ascii_part(LineReader& lines, const PlyPart& part, std::uint64_t vertex_count,
                     Mesh& mesh);
void read_binary_part(ByteSource& in, PlyFormat format, const PlyPart& part,
                      std::uint64_t vertex_count, Mesh& mesh);

}  // namespace raydix
