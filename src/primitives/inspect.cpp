// Mesh -> counts of what a user should know about before building a tree over it.
#include <fmt/format.h>
#include <raydix/error.h>
#include <raydix/mesh.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/float_env.h"
#include "base/math.h"
#include "primitives/double_sources.h"
#include "primitives/sources.h"
#include "primitives/zero_area.h"

namespace raydix {
namespace {

template <class Point>
bool is_finite(Point p) {
    return std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z);
}

bool is_flat(const TriangleSource& source, std::uint32_t i) {
    return has_zero_area(source.corners(i));
}
/// The exact test is for numbers in range.
bool is_flat(const TriangleSourceD& source, std::uint32_t i) {
    const LeafTriangleD t = source.corners(i);
    return in_range(t.v0) && in_range(t.v1) && in_range(t.v2) && has_zero_area(t);
}

template <class Point, class Info>
void inspect_vertices(std::span<const Point> vertices, Info& info) {
    for (const Point& vertex : vertices) {
        const Point p = without_negative_zero(vertex);
        if (in_range(p))
            info.bounds = {min_of(info.bounds.lo, p), max_of(info.bounds.hi, p)};
        else if (is_finite(p))
            ++info.out_of_range_vertices;
        else
            ++info.non_finite_vertices;
    }
}

template <class Source, class Scalar>
void inspect_triangles(const BasicMeshView<Scalar>& mesh, BasicMeshInfo<Scalar>& info) {
    std::vector<bool> is_used(mesh.vertices.size());
    const Source source{mesh.vertices.data(), mesh.triangles.data(), mesh.vertices.size()};
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
        const auto& [a, b, c] = mesh.triangles[i];
        const std::uint32_t highest = std::max({a, b, c});
        if (highest >= mesh.vertices.size())
            throw InputError(fmt::format("mesh: triangle {}: index {} of {} vertices", i, highest,
                                         mesh.vertices.size()));
        is_used[a] = is_used[b] = is_used[c] = true;
        const bool repeats = a == b || b == c || c == a;
        const auto number = static_cast<std::uint32_t>(i);
        BasicAabb<Scalar> box;
        info.repeated_index_triangles += repeats ? 1 : 0;
        info.zero_area_triangles += repeats || is_flat(source, number) ? 1 : 0;
        info.left_out_triangles += source.box(number, box) ? 0 : 1;
    }
    info.unreferenced_vertices =
        static_cast<std::uint64_t>(std::count(is_used.begin(), is_used.end(), false));
}

template <class Source, class Scalar>
BasicMeshInfo<Scalar> inspect_mesh(const BasicMeshView<Scalar>& mesh) {
    const FloatEnvironment plain;
    BasicMeshInfo<Scalar> info;
    info.vertices = mesh.vertices.size();
    info.triangles = mesh.triangles.size();
    info.points = mesh.triangles.empty() ? mesh.vertices.size() : 0;
    info.bounds = {{infinity, infinity, infinity}, {-infinity, -infinity, -infinity}};
    info.bytes = mesh.vertices.size_bytes() + mesh.triangles.size_bytes();
    inspect_vertices(mesh.vertices, info);
    if (!mesh.triangles.empty()) inspect_triangles<Source>(mesh, info);
    return info;
}

}  // namespace

MeshInfo inspect(const MeshView& mesh) { return inspect_mesh<TriangleSource>(mesh); }
MeshInfoD inspect(const MeshViewD& mesh) { return inspect_mesh<TriangleSourceD>(mesh); }

}  // namespace raydix
