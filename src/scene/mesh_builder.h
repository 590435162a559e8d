// What all mesh readers do with a vertex, a triangle and a polygon, with the limits on their
// numbers.
#pragma once

#include <fmt/format.h>
#include <raydix/mesh.h>

#include <algorithm>

#include "base/math.h"
#include "scene/byte_source.h"

namespace raydix {

inline constexpr std::uint64_t max_vertices = 0xFFFFFFFFu;   // 2^32 - 1
inline constexpr std::uint64_t max_triangles = 0x7FFFFFFFu;  // 2^31 - 1

/// Throws InputError if the mesh could not be addressed any more.
inline void check_mesh_size(const ByteSource& in, std::uint64_t vertices, std::uint64_t triangles) {
    if (vertices > max_vertices) in.fail("mesh", "more than 2^32 - 1 vertices");
    if (triangles > max_triangles) in.fail("mesh", "more than 2^31 - 1 triangles");
}

inline void add_vertex(const ByteSource& in, Mesh& mesh, Vec3 position) {
    check_mesh_size(in, mesh.vertices.size() + 1, 0);
    mesh.vertices.push_back(without_negative_zero(position));
}

inline void add_triangle(const ByteSource& in, Mesh& mesh, const Triangle& triangle) {
    check_mesh_size(in, 0, mesh.triangles.size() + 1);
    mesh.triangles.push_back(triangle);
}

/// Room for `count` elements, but never for more than the rest of the source can hold.
template <class T>
void reserve_for(const ByteSource& in, std::vector<T>& array, std::uint64_t count,
                 std::uint64_t bytes_each) {
    const std::uint64_t held = in.expected_rest() / std::max<std::uint64_t>(bytes_each, 1);
    array.reserve(array.size() + static_cast<std::size_t>(std::min(count, held)));
}

/// Cuts a polygon into the triangles (v0, vi, vi+1), in order. Fewer than three corners give none.
class PolygonFan {
public:
    PolygonFan(const ByteSource& in, Mesh& mesh) : in_(in), mesh_(mesh) {}

    void add_corner(std::uint32_t vertex) {
        if (corners_ == 0) first_ = vertex;
        if (corners_ >= 2) add_triangle(in_, mesh_, {first_, previous_, vertex});
        previous_ = vertex;
        ++corners_;
    }

private:
    const ByteSource& in_;
    Mesh& mesh_;
    std::uint32_t first_ = 0, previous_ = 0;
    std::uint64_t corners_ = 0;
};

/// Throws InputError "FILE: face 7: index 12 of 8 vertices" unless `index` is in [0, vertex_count).
/// `face` counts from 1.
inline std::uint32_t checked_index(const ByteSource& in, std::uint64_t face, std::int64_t index,
                                   std::uint64_t vertex_count) {
    if (index < 0 || static_cast<std::uint64_t>(index) >= vertex_count ||
        index > std::int64_t{0xFFFFFFFF})
        in.fail(fmt::format("face {}", face),
                fmt::format("index {} of {} vertices", index, vertex_count));
    return static_cast<std::uint32_t>(index);
}

}  // namespace raydix
