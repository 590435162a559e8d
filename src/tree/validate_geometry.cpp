// The invariants of coordinates: primitives fit for a tree, boxes tight bit for bit, primitives
// those of the mesh. Each element is checked on its own, in parallel; the lowest one at fault is
// named.
#include <fmt/format.h>

#include <vector>

#include "base/math.h"
#include "base/same_bits.h"
#include "exec/search.h"
#include "tree/validate.h"

namespace raydix {
namespace {

std::string text_of(Vec3 p) { return fmt::format("({}, {}, {})", p.x, p.y, p.z); }
std::string text_of(const Aabb& b) { return text_of(b.lo) + " to " + text_of(b.hi); }

bool is_usable_triangle(Vec3 a, Vec3 b, Vec3 c) {
    return in_range(a) && in_range(b) && in_range(c) && diagonal_in_range(box_of(a, b, c));
}

bool is_clean_primitive(const Bvh& bvh, std::size_t position) {
    switch (bvh.kind()) {
        case PrimitiveKind::triangles: {
            const LeafTriangle& t = bvh.triangles()[position];
            return is_clean(t.v0) && is_clean(t.v1) && is_clean(t.v2) &&
                   is_usable_triangle(t.v0, t.v1, t.v2);
        }
        case PrimitiveKind::boxes: {
            const Aabb& b = bvh.boxes()[position];
            return is_clean(b.lo) && is_clean(b.hi) && !is_empty(b) && diagonal_in_range(b);
        }
        case PrimitiveKind::points:
            break;
    }
    return is_clean(bvh.points()[position]);
}

/// What the box of a node must be.
Aabb union_below(const Bvh& bvh, const BvhNode& node) {
    if (!node.is_leaf()) {
        const BvhNode& left = bvh.nodes()[node.first];
        const BvhNode& right = bvh.nodes()[node.first + 1];
        return unite({left.lo, left.hi}, {right.lo, right.hi});
    }
    Aabb box = primitive_box(bvh, node.first);
    for (std::uint32_t i = 1; i < node.count; ++i)
        box = unite(box, primitive_box(bvh, node.first + i));
    return box;
}

/// A box of parts: not empty, without -0, and around no more than the whole primitives.
bool is_box_of_parts(const Aabb& box, const Aabb& whole) {
    return is_clean(box.lo) && is_clean(box.hi) && !is_empty(box) &&
           min_of(box.lo, whole.lo) == whole.lo && max_of(box.hi, whole.hi) == whole.hi;
}

bool is_tight(const Bvh& bvh, const BvhNode& node) {
    const Aabb box = union_below(bvh, node);
    if (node.is_leaf() && may_split_primitives(bvh))
        return is_box_of_parts({node.lo, node.hi}, box);
    return same_bits(node.lo, box.lo) && same_bits(node.hi, box.hi);
}

bool matches_mesh(const Bvh& bvh, const MeshView& mesh, std::size_t position) {
    const auto vertex = [&](std::uint32_t i) { return without_negative_zero(mesh.vertices[i]); };
    const std::uint32_t primitive_id = bvh.order()[position];
    if (bvh.kind() == PrimitiveKind::points)
        return same_bits(bvh.points()[position], vertex(primitive_id));
    const Triangle& corners = mesh.triangles[primitive_id];
    const LeafTriangle& t = bvh.triangles()[position];
    return same_bits(t.v0, vertex(corners[0])) && same_bits(t.v1, vertex(corners[1])) &&
           same_bits(t.v2, vertex(corners[2]));
}

/// The lowest primitive that the tree leaves out for no reason, or the number of primitives.
std::size_t first_missing(const Bvh& bvh, const MeshView& mesh) {
    std::vector<bool> held(bvh.input_count());
    for (const std::uint32_t primitive_id : bvh.order()) held[primitive_id] = true;
    return first_index_where(held.size(), [&](std::size_t i) {
        if (held[i]) return false;
        if (bvh.kind() == PrimitiveKind::points) return in_range(mesh.vertices[i]);
        const Triangle& t = mesh.triangles[i];
        return is_usable_triangle(mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]]);
    });
}

}  // namespace

Aabb primitive_box(const Bvh& bvh, std::size_t position) {
    switch (bvh.kind()) {
        case PrimitiveKind::triangles: {
            const LeafTriangle& t = bvh.triangles()[position];
            return box_of(t.v0, t.v1, t.v2);
        }
        case PrimitiveKind::boxes:
            return bvh.boxes()[position];
        case PrimitiveKind::points:
            break;
    }
    return {bvh.points()[position], bvh.points()[position]};
}

Fault validate_primitives(const Bvh& bvh) {
    const std::size_t n = bvh.order().size();
    const std::size_t bad =
        first_index_where(n, [&](std::size_t i) { return !is_clean_primitive(bvh, i); });
    if (bad == n) return {};
    return fmt::format(
        "primitives: the one at position {} belongs in no tree (not finite, out of range, -0 or "
        "inverted): {}",
        bad, text_of(primitive_box(bvh, bad)));
}

Fault validate_boxes(const Bvh& bvh) {
    const std::span<const BvhNode> nodes = bvh.nodes();
    const auto is_node = [](std::size_t slot) { return slot != 1; };
    const std::size_t bad = first_index_where(
        nodes.size(), [&](std::size_t i) { return is_node(i) && !is_tight(bvh, nodes[i]); });
    if (bad == nodes.size()) return {};
    const BvhNode& node = nodes[bad];
    return fmt::format("nodes: the box of {} {} is {}, but what it holds spans {}",
                       node.is_leaf() ? "leaf" : "inner node", bad, text_of(Aabb{node.lo, node.hi}),
                       text_of(union_below(bvh, node)));
}

Fault validate_mesh_counts(const Bvh& bvh, const MeshView& mesh) {
    const std::size_t vertices = mesh.vertices.size(), triangles = mesh.triangles.size();
    const std::size_t bad = first_index_where(triangles, [&](std::size_t i) {
        const Triangle& t = mesh.triangles[i];
        return t[0] >= vertices || t[1] >= vertices || t[2] >= vertices;
    });
    if (bad != triangles)
        return fmt::format("triangles: triangle {} has the vertices {} {} {} of {}", bad,
                           mesh.triangles[bad][0], mesh.triangles[bad][1], mesh.triangles[bad][2],
                           vertices);
    if (bvh.kind() == PrimitiveKind::boxes) return {};
    const bool points = bvh.kind() == PrimitiveKind::points;
    if (points && triangles != 0)
        return fmt::format("triangles: a tree of points, but a mesh with {} triangles", triangles);
    if (bvh.input_count() != (points ? vertices : triangles))
        return fmt::format("info: a tree built from {} {}, but a mesh with {}", bvh.input_count(),
                           points ? "points" : "triangles", points ? vertices : triangles);
    return {};
}

Fault validate_against_mesh(const Bvh& bvh, const MeshView& mesh) {
    if (bvh.kind() == PrimitiveKind::boxes) return {};
    const std::size_t n = bvh.order().size();
    const std::size_t bad =
        first_index_where(n, [&](std::size_t i) { return !matches_mesh(bvh, mesh, i); });
    if (bad != n)
        return fmt::format(
            "primitives: the one at position {} is not what the mesh holds as number {}", bad,
            bvh.order()[bad]);
    if (bvh.left_out() == 0) return {};
    const std::size_t missing = first_missing(bvh, mesh);
    if (missing == bvh.input_count()) return {};
    return fmt::format("order: primitive {} is left out, though nothing is wrong with it", missing);
}

}  // namespace raydix
