// The invariants of an octree's points: in the scene, in order, in the cell of their leaf, and
// those of the mesh.
#include <fmt/format.h>

#include <cstring>
#include <vector>

#include "base/math.h"
#include "base/same_bits.h"
#include "exec/search.h"
#include "tree/octree_validate.h"
#include "tree/octree_walk.h"

namespace raydix {
namespace {

/// The finest code of a point within the scene.
std::uint64_t code_of(const Grid& grid, Vec3 p) { return interleave<std::uint64_t>(grid.cell(p)); }

bool within(const Aabb& box, Vec3 p) {
    return p.x >= box.lo.x && p.y >= box.lo.y && p.z >= box.lo.z && p.x <= box.hi.x &&
           p.y <= box.hi.y && p.z <= box.hi.z;
}

/// Primitive -> its box; false if it belongs in no tree.
bool box_in_mesh(const MeshView& mesh, std::size_t id, Aabb& box) {
    const auto corner = [&](std::uint32_t vertex) {
        return without_negative_zero(mesh.vertices[vertex]);
    };
    if (mesh.triangles.empty()) {
        const Vec3 p = corner(static_cast<std::uint32_t>(id));
        box = {p, p};
        return in_range(p);
    }
    const auto [i, j, k] = mesh.triangles[id];
    const Vec3 a = corner(i), b = corner(j), c = corner(k);
    box = box_of(a, b, c);
    return in_range(a) && in_range(b) && in_range(c) && diagonal_in_range(box);
}

Fault validate_mesh_counts(const Octree& octree, const MeshView& mesh) {
    const std::size_t vertices = mesh.vertices.size(), triangles = mesh.triangles.size();
    const std::size_t bad = first_index_where(triangles, [&](std::size_t i) {
        const auto [a, b, c] = mesh.triangles[i];
        return a >= vertices || b >= vertices || c >= vertices;
    });
    if (bad != triangles)
        return fmt::format("triangles: triangle {} has a vertex past the last of {}", bad,
                           vertices);
    if ((octree.kind() == PrimitiveKind::points) != mesh.triangles.empty())
        return fmt::format("triangles: {} in the mesh of an octree of {}", triangles,
                           triangles != 0 ? "points" : "triangles");
    const std::size_t primitives = triangles != 0 ? triangles : vertices;
    if (octree.input_count() != primitives)
        return fmt::format("info: a tree built from {} primitives, but a mesh with {}",
                           octree.input_count(), primitives);
    return {};
}

/// Points ascend by (code, id).
Fault validate_code_order(const Octree& octree, const Grid& grid) {
    const std::span<const Vec3> points = octree.points();
    const std::span<const std::uint32_t> order = octree.order();
    const auto descends = [&](std::size_t k) {
        if (k == 0) return false;
        const std::uint64_t before = code_of(grid, points[k - 1]), own = code_of(grid, points[k]);
        return own < before || (own == before && order[k] <= order[k - 1]);
    };
    const std::size_t first = first_index_where(points.size(), descends);
    if (first == points.size()) return {};
    return fmt::format("order: position {}: before its predecessor by code and id", first);
}

}  // namespace

Fault validate_order(const Octree& octree) {
    std::vector<bool> seen(octree.input_count());
    for (std::size_t k = 0; k < octree.order().size(); ++k) {
        const std::uint32_t id = octree.order()[k];
        if (id >= seen.size())
            return fmt::format("order: position {}: primitive {} of {}", k, id, seen.size());
        if (seen[id]) return fmt::format("order: position {}: primitive {} again", k, id);
        seen[id] = true;
    }
    return {};
}

/// As codes ascend, the points between a node's first and last need no look.
Fault validate_cells(const Octree& octree) {
    if (octree.empty()) return {};
    const std::span<const Vec3> points = octree.points();
    const std::size_t stray = first_index_where(points.size(), [&](std::size_t k) {
        return !within(octree.bounds(), points[k]) ||
               !same_bits(points[k], without_negative_zero(points[k]));
    });
    if (stray != points.size())
        return fmt::format("points: position {}: outside of the scene's bounds, or -0", stray);
    const Grid grid = grid_of(octree);
    if (Fault f = validate_code_order(octree, grid)) return f;
    const std::span<const OctreeNode> nodes = octree.nodes();
    const auto strays = [&](std::size_t i) {
        const int below = 3 * (axis_bits_of(octree) - static_cast<int>(nodes[i].level));
        const std::uint32_t first = nodes[i].first_point, last = first + nodes[i].point_count - 1;
        return code_of(grid, points[first]) >> below != nodes[i].code ||
               code_of(grid, points[last]) >> below != nodes[i].code;
    };
    const std::size_t bad = first_index_where(nodes.size(), strays);
    if (bad == nodes.size()) return {};
    return fmt::format("nodes: node {}: a point is not in its cell", bad);
}

Fault validate_against_mesh(const Octree& octree, const MeshView& mesh) {
    if (Fault f = validate_mesh_counts(octree, mesh)) return f;
    Aabb scene = empty_box();
    std::uint64_t usable = 0;
    for (std::size_t id = 0; id < octree.input_count(); ++id) {
        Aabb box;
        if (!box_in_mesh(mesh, id, box)) continue;
        scene = unite(scene, box);
        ++usable;
    }
    if (usable != octree.order().size())
        return fmt::format("order: {} primitives where the mesh has {} usable ones",
                           octree.order().size(), usable);
    if (!same_bits(scene.lo, octree.bounds().lo) || !same_bits(scene.hi, octree.bounds().hi))
        return "info: the bounds are not the mesh's";
    const std::size_t n = octree.order().size();
    const std::size_t bad = first_index_where(n, [&](std::size_t k) {
        Aabb box;
        return !box_in_mesh(mesh, octree.order()[k], box) ||
               !same_bits(center_of(box), octree.points()[k]);
    });
    if (bad == n) return {};
    return fmt::format("points: the one at position {} is not what the mesh holds as number {}",
                       bad, octree.order()[bad]);
}

}  // namespace raydix
