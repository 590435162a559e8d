// Valid triangles, and the distance from one, by the regions of Ericson (2005), 5.1.5.
#include "attack/parts.h"

#include <algorithm>
#include <cmath>

namespace raydix::attack {
namespace {

struct Wide {
    long double x, y, z;
};
Wide minus(Wide a, Wide b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
long double dot(Wide a, Wide b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
Wide along(Wide a, Wide d, long double s) { return {a.x + d.x * s, a.y + d.y * s, a.z + d.z * s}; }

/// The squared distance of 0 from the segment a, b.
long double from_segment(Wide a, Wide b) {
    const Wide d = minus(b, a);
    const long double length2 = dot(d, d);
    long double s = length2 > 0 ? -dot(a, d) / length2 : 0;
    s = std::min(std::max(s, 0.0L), 1.0L);
    const Wide p = along(a, d, s);
    return dot(p, p);
}

/// p * q - r * s to two roundings (Kahan).
long double difference(long double p, long double q, long double r, long double s) {
    const long double rs = r * s;
    return std::fma(p, q, -rs) + std::fma(-r, s, rs);
}

/// The squared distance of 0 from the triangle's inside, or infinity if its foot is outside. Plain
/// products would turn the plane of a needle: at its far end by 2^-64 of its length squared over
/// its width.
long double from_face(Wide a, Wide b, Wide c) {
    const Wide e = minus(b, a), f = minus(c, a);
    const Wide n{difference(e.y, f.z, e.z, f.y), difference(e.z, f.x, e.x, f.z),
                 difference(e.x, f.y, e.y, f.x)};
    const long double n2 = dot(n, n);
    if (!(n2 > 0)) return INFINITY;
    const auto side = [&](Wide p, Wide q) {
        const Wide pq = minus(q, p);
        const Wide m{n.y * pq.z - n.z * pq.y, n.z * pq.x - n.x * pq.z, n.x * pq.y - n.y * pq.x};
        return -dot(m, p);
    };
    if (side(a, b) < 0 || side(b, c) < 0 || side(c, a) < 0) return INFINITY;
    const long double h = dot(a, n);
    return h * h / n2;
}

template <class AnyMesh>
std::vector<std::uint32_t> valid_of(const AnyMesh& mesh) {
    std::vector<std::uint32_t> valid;
    for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i) {
        const auto& t = mesh.triangles[i];
        auto lo = mesh.vertices[t[0]], hi = lo;
        bool in_range = true;
        for (const std::uint32_t corner : t) {
            const auto& p = mesh.vertices[corner];
            in_range = in_range && std::fabs(p.x) <= 1e12 && std::fabs(p.y) <= 1e12 &&
                       std::fabs(p.z) <= 1e12;
            lo = {std::min(lo.x, p.x), std::min(lo.y, p.y), std::min(lo.z, p.z)};
            hi = {std::max(hi.x, p.x), std::max(hi.y, p.y), std::max(hi.z, p.z)};
        }
        const double x = double(hi.x) - lo.x, y = double(hi.y) - lo.y, z = double(hi.z) - lo.z;
        const double longest = std::max({x, y, z});
        if (in_range && (longest == 0 || longest >= 1e-12 || std::hypot(x, y, z) >= 1e-12))
            valid.push_back(i);
    }
    return valid;
}

}  // namespace

std::vector<std::uint32_t> valid_triangles(const Mesh& mesh) { return valid_of(mesh); }
std::vector<std::uint32_t> valid_triangles(const MeshD& mesh) { return valid_of(mesh); }

long double stretch_of(const Corners& triangle) {
    const auto edge = [&](std::size_t i, std::size_t j) {
        return Wide{static_cast<long double>(triangle[j].x) - triangle[i].x,
                    static_cast<long double>(triangle[j].y) - triangle[i].y,
                    static_cast<long double>(triangle[j].z) - triangle[i].z};
    };
    const Wide e = edge(0, 1), f = edge(0, 2), g = edge(1, 2);
    const Wide n{e.y * f.z - e.z * f.y, e.z * f.x - e.x * f.z, e.x * f.y - e.y * f.x};
    const long double longest2 = std::max({dot(e, e), dot(f, f), dot(g, g)});
    const long double area = std::sqrt(dot(n, n));
    return area > 0 ? longest2 / area : 1;
}

long double distance_to(const Corners& triangle, Vec3d point) {
    const auto from_point = [&](Vec3d p) {
        return Wide{static_cast<long double>(p.x) - point.x,
                    static_cast<long double>(p.y) - point.y,
                    static_cast<long double>(p.z) - point.z};
    };
    const Wide a = from_point(triangle[0]), b = from_point(triangle[1]),
               c = from_point(triangle[2]);
    const long double d2 = std::min(std::min(from_segment(a, b), from_segment(b, c)),
                                    std::min(from_segment(c, a), from_face(a, b, c)));
    return std::sqrt(d2);
}

}  // namespace raydix::attack
