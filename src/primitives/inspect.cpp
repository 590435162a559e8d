// Mesh -> counts of what a user should know about before building a tree over it.
#include <fmt/format.h>
#include <raydix/error.h>
#include <raydix/mesh.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/math.h"
#include "primitives/sources.h"

namespace raydix {
namespace {

bool is_finite(Vec3 p) { return std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z); }

bool has_zero_area(Vec3 a, Vec3 b, Vec3 c) {
    const double ux = double(b.x) - a.x, uy = double(b.y) - a.y, uz = double(b.z) - a.z;
    const double vx = double(c.x) - a.x, vy = double(c.y) - a.y, vz = double(c.z) - a.z;
    return uy * vz == uz * vy && uz * vx == ux * vz && ux * vy == uy * vx;
}

void inspect_vertices(std::span<const Vec3> vertices, MeshInfo& info) {
    for (const Vec3& vertex : vertices) {
        const Vec3 p = without_negative_zero(vertex);
        if (in_range(p))
            info.bounds = unite(info.bounds, {p, p});
        else if (is_finite(p))
            ++info.out_of_range_vertices;
        else
            ++info.non_finite_vertices;
    }
}

void inspect_triangles(const MeshView& mesh, MeshInfo& info) {
    std::vector<bool> is_used(mesh.vertices.size());
    const TriangleSource source{mesh.vertices.data(), mesh.triangles.data(), mesh.vertices.size()};
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
        const auto& [a, b, c] = mesh.triangles[i];
        const std::uint32_t highest = std::max({a, b, c});
        if (highest >= mesh.vertices.size())
            throw InputError(fmt::format("mesh: triangle {}: index {} of {} vertices", i, highest,
                                         mesh.vertices.size()));
        is_used[a] = is_used[b] = is_used[c] = true;
        const bool repeats = a == b || b == c || c == a;
        Aabb box;
        info.repeated_index_triangles += repeats ? 1 : 0;
        info.zero_area_triangles +=
            repeats || has_zero_area(mesh.vertices[a], mesh.vertices[b], mesh.vertices[c]) ? 1 : 0;
        info.left_out_triangles += source.box(static_cast<std::uint32_t>(i), box) ? 0 : 1;
    }
    info.unreferenced_vertices =
        static_cast<std::uint64_t>(std::count(is_used.begin(), is_used.end(), false));
}

}  // namespace

MeshInfo inspect(const MeshView& mesh) {
    MeshInfo info;
    info.vertices = mesh.vertices.size();
    info.triangles = mesh.triangles.size();
    info.points = mesh.triangles.empty() ? mesh.vertices.size() : 0;
    info.bounds = empty_box();
    info.bytes = mesh.vertices.size_bytes() + mesh.triangles.size_bytes();
    inspect_vertices(mesh.vertices, info);
    if (!mesh.triangles.empty()) inspect_triangles(mesh, info);
    return info;
}

}  // namespace raydix
