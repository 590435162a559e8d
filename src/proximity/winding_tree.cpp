#include "proximity/winding_tree.h"

#include <raydix/types.h>

#include <cmath>
#include <numbers>

#include "tree/walk.h"

namespace raydix {
namespace {

/// A subtree is far if the query is this many radii away. The error of the two terms, summed over a
/// mesh, has no bound of its own: it grows with the area that is seen, so that layers add theirs
/// up.
constexpr double far_radii = 4.0;

struct AreaSum {
    double area = 0;
    Double3 place;  // sum of centers times areas
};

Double3 center_of_mass(const AreaSum& sum, const BvhNode& node) {
    if (sum.area > 0) return sum.place * (1.0 / sum.area);
    return (Double3(node.lo) + Double3(node.hi)) * 0.5;
}

double farthest_corner(const BvhNode& node, Double3 center) {
    const Double3 lo = center - Double3(node.lo), hi = Double3(node.hi) - center;
    return length({std::max(lo.x, hi.x), std::max(lo.y, hi.y), std::max(lo.z, hi.z)});
}

/// Adds what has normal n and its own center at `off` from that of the sum.
void add_part(FarTriangles& sum, Double3 n, Double3 off) {
    sum.normal = sum.normal + n;
    sum.moment_x = sum.moment_x + n * off.x;
    sum.moment_y = sum.moment_y + n * off.y;
    sum.moment_z = sum.moment_z + n * off.z;
}

struct Facet {
    Double3 center, normal;
    double area;
};

inline Facet facet_of(const LocalCorners& t) {
    const Double3 normal = cross(t.b - t.a, t.c - t.a) * 0.5;
    return {(t.a + t.b + t.c) * (1.0 / 3.0), normal, length(normal)};
}

/// The two terms at d = center - query; 0 where 1 / |d|^3 is beyond the range of numbers: the query
/// is that far away, or so close to triangles that are points.
inline double far_winding(const FarTriangles& far, Double3 d, double d2) {
    const double inverse3 = 1.0 / (d2 * std::sqrt(d2));
    if (!(inverse3 > 0.0 && inverse3 < infinity)) return 0.0;
    const Double3 turned{dot(far.moment_x, d), dot(far.moment_y, d), dot(far.moment_z, d)};
    const double trace = far.moment_x.x + far.moment_y.y + far.moment_z.z;
    const double sum = dot(far.normal, d) + trace - 3.0 * dot(turned, d) / d2;
    return sum * inverse3 * (0.25 * std::numbers::inv_pi);
}

inline double solid_angle_part(const LocalCorners& t, Double3 query) {
    const Double3 a = t.a - query, b = t.b - query, c = t.c - query;
    const double la = length(a), lb = length(b), lc = length(c);
    const double up = dot(a, cross(b, c));
    if (up == 0.0) return 0.0;
    const double down = la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb;
    return std::atan2(up, down) * (0.5 * std::numbers::inv_pi);
}

}  // namespace

double triangle_winding(const LocalCorners& t, Double3 query) { return solid_angle_part(t, query); }
double triangle_winding(const LeafTriangle& t, Vec3 query) {
    return solid_angle_part({Double3(t.v0), Double3(t.v1), Double3(t.v2)}, Double3(query));
}

template <class Tree>
WindingTree::WindingTree(const Tree& tree, std::span<const BvhNode> nodes) : far_(nodes.size()) {
    std::vector<std::uint32_t> slots;
    slots.reserve(far_.size());
    walk_preorder(nodes, tree.max_depth, [&](std::uint32_t slot) { slots.push_back(slot); });
    std::vector<AreaSum> areas(far_.size());
    for (auto at = slots.rbegin(); at != slots.rend(); ++at) {  // children before parents
        const BvhNode& node = nodes[*at];
        FarTriangles& far = far_[*at];
        AreaSum& sum = areas[*at];
        const auto add_area = [&](double area, Double3 place) {
            sum.area += area;
            sum.place = sum.place + place;
        };
        if (node.is_leaf()) {
            const std::uint32_t end = node.first + node.count;
            for (std::uint32_t k = node.first; k < end; ++k) {
                const Facet f = facet_of(local_corners(tree, k));
                add_area(f.area, f.center * f.area);
            }
            far.center = center_of_mass(sum, node);
            for (std::uint32_t k = node.first; k < end; ++k) {
                const Facet f = facet_of(local_corners(tree, k));
                add_part(far, f.normal, f.center - far.center);
            }
        } else {
            const std::uint32_t left = node.first, right = left + 1;
            for (const std::uint32_t k : {left, right}) add_area(areas[k].area, areas[k].place);
            far.center = center_of_mass(sum, node);
            for (const std::uint32_t k : {left, right}) {
                const FarTriangles& part = far_[k];
                add_part(far, part.normal, part.center - far.center);
                far.moment_x = far.moment_x + part.moment_x;
                far.moment_y = far.moment_y + part.moment_y;
                far.moment_z = far.moment_z + part.moment_z;
            }
        }
        far.radius = farthest_corner(node, far.center);
    }
}

template <class Tree, class Vec>
double WindingTree::at(const Tree& tree, Vec query,
                       BasicWalkStack<typename Tree::Scalar>& stack) const {
    const Double3 place = local_place(tree, query);
    auto* const bottom = stack.begin();
    auto* top = bottom;
    std::uint32_t slot = 0;
    double sum = 0;
    for (;;) {
        const BvhNode& node = tree.nodes[slot];
        const FarTriangles& far = far_[slot];
        const Double3 d = far.center - place;
        const double d2 = dot(d, d), limit = far_radii * far.radius;
        if (d2 > limit * limit) {
            sum += far_winding(far, d, d2);
        } else if (node.is_leaf()) {
            for (std::uint32_t k = node.first; k < node.first + node.count; ++k)
                sum += solid_angle_part(local_corners(tree, k), place);
        } else {
            RAYDIX_CHECK(static_cast<std::uint32_t>(top - bottom), <, stack.capacity());
            *top++ = {node.first + 1, 0};
            slot = node.first;
            continue;
        }
        if (top == bottom) return sum;
        slot = (--top)->slot;
    }
}

template WindingTree::WindingTree(const TriangleTree&, std::span<const BvhNode>);
template WindingTree::WindingTree(const TriangleTreeD&, std::span<const BvhNode>);
template double WindingTree::at(const TriangleTree&, Vec3, WalkStack&) const;
template double WindingTree::at(const TriangleTreeD&, Vec3d, WalkStackD&) const;

}  // namespace raydix
