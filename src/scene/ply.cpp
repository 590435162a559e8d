// PLY file -> mesh: decides which elements matter and reads up to the last of them.
#include "scene/ply.h"

#include "scene/formats.h"

namespace raydix {
namespace {

PlyPart part_of(const ByteSource& in, const PlyElement& element) {
    PlyPart part{&element};
    if (element.name == "vertex") {
        part.role = PlyRole::vertices;
        part.position = {element.find("x"), element.find("y"), element.find("z")};
        for (const int i : part.position)
            if (i < 0 || element.properties[static_cast<std::size_t>(i)].is_list)
                in.fail("header", "vertices need the properties x, y and z, each a number");
    } else if (element.name == "face" || element.name == "tristrips") {
        part.index_list = element.find("vertex_indices");
        if (part.index_list < 0) part.index_list = element.find("vertex_index");
        if (part.index_list < 0 && element.count == 0) return part;
        if (part.index_list < 0 ||
            !element.properties[static_cast<std::size_t>(part.index_list)].is_list)
            in.fail("header", fmt::format("element {} needs a list vertex_indices", element.name));
        part.role = element.name == "face" ? PlyRole::faces : PlyRole::strips;
    }
    return part;
}

}  // namespace

Mesh load_ply(ByteSource& in) {
    LineReader lines(in);
    const PlyHeader header = read_ply_header(lines);
    std::vector<PlyPart> parts;
    std::size_t needed = 0;
    std::uint64_t vertex_count = 0;
    bool has_vertices = false;
    for (const PlyElement& element : header.elements) {
        parts.push_back(part_of(in, element));
        if (parts.back().role != PlyRole::none) needed = parts.size();
        if (parts.back().role != PlyRole::vertices) continue;
        if (has_vertices) in.fail("header", "two elements named vertex");
        has_vertices = true;
        vertex_count = element.count;
    }
    parts.resize(needed);
    Mesh mesh;
    for (const PlyPart& part : parts) {
        if (header.format == PlyFormat::ascii)
            read_ascii_part(lines, part, vertex_count, mesh);
        else
            read_binary_part(in, header.format, part, vertex_count, mesh);
    }
    return mesh;
}

}  // namespace raydix
