// Triangles against triangles and points against closed meshes, without rounding.
#include "attack/exact.h"

#include <algorithm>
#include <boost/multiprecision/cpp_int.hpp>
#include <cmath>

namespace raydix::attack {
namespace {

using Integer = boost::multiprecision::cpp_int;

struct Point {
    Integer x, y, z;
};
Point minus(const Point& a, const Point& b) {
    return {Integer(a.x - b.x), Integer(a.y - b.y), Integer(a.z - b.z)};
}
Point cross(const Point& a, const Point& b) {
    return {Integer(a.y * b.z - a.z * b.y), Integer(a.z * b.x - a.x * b.z),
            Integer(a.x * b.y - a.y * b.x)};
}
Integer dot(const Point& a, const Point& b) { return Integer(a.x * b.x + a.y * b.y + a.z * b.z); }
bool is_zero(const Point& p) { return p.x == 0 && p.y == 0 && p.z == 0; }

/// Doubles as multiples of the least power of two that any of them needs.
class Scale {
public:
    void include(double x) {
        if (x != 0.0) least_ = std::min(least_, std::ilogb(x) - 52);
    }
    void include(const Vec3d& p) {
        include(p.x);
        include(p.y);
        include(p.z);
    }
    [[nodiscard]] Integer whole(double x) const {
        if (x == 0.0) return 0;
        const int exponent = std::ilogb(x) - 52;
        return Integer(static_cast<long long>(std::ldexp(x, -exponent))) *
               (Integer(1) << static_cast<unsigned>(exponent - least_));
    }
    [[nodiscard]] Point whole(const Vec3d& p) const { return {whole(p.x), whole(p.y), whole(p.z)}; }

private:
    int least_ = 2000;
};

using Triple = std::array<Point, 3>;

bool separates(const Point& direction, const Triple& p, const Triple& q) {
    std::array<Integer, 3> a, b;
    for (std::size_t k = 0; k < 3; ++k) {
        a[k] = dot(direction, p[k]);
        b[k] = dot(direction, q[k]);
    }
    const auto ends_a = std::minmax({a[0], a[1], a[2]}), ends_b = std::minmax({b[0], b[1], b[2]});
    return ends_a.second < ends_b.first || ends_b.second < ends_a.first;
}

/// Disjoint triangles are parted by the direction in which they come closest: between two corners,
/// across an edge from a corner, across two edges, or across a face.
bool disjoint(const Triple& p, const Triple& q) {
    if (separates(cross(minus(p[1], p[0]), minus(p[2], p[0])), p, q)) return true;
    if (separates(cross(minus(q[1], q[0]), minus(q[2], q[0])), p, q)) return true;
    for (std::size_t i = 0; i < 3; ++i)
        for (std::size_t j = 0; j < 3; ++j) {
            const Point e = minus(p[(i + 1) % 3], p[i]), f = minus(q[(j + 1) % 3], q[j]);
            if (separates(minus(q[j], p[i]), p, q) || separates(cross(e, f), p, q)) return true;
            for (std::size_t k = 0; k < 3; ++k)
                if (separates(cross(cross(e, minus(q[k], p[i])), e), p, q) ||
                    separates(cross(cross(f, minus(p[k], q[j])), f), p, q))
                    return true;
        }
    return false;
}

int sign(const Integer& x) { return x > 0 ? 1 : x < 0 ? -1 : 0; }

enum class Crossing { none, in, out, unclear };

/// The ray from 0 along `d` against a triangle that does not hold 0.
Crossing crossing(const Triple& t, const Point& d) {
    const Point ab = cross(t[0], t[1]), bc = cross(t[1], t[2]), ca = cross(t[2], t[0]);
    const int volume = sign(dot(t[0], bc));
    if (volume == 0) return Crossing::none;  // 0 is in its plane
    const int u = sign(dot(d, ab)), v = sign(dot(d, bc)), w = sign(dot(d, ca));
    if (u == 0 || v == 0 || w == 0) return Crossing::unclear;
    if (u != v || v != w || u != volume) return Crossing::none;
    return u > 0 ? Crossing::out : Crossing::in;
}

/// Directions that few edges and corners lie in.
constexpr std::array<std::array<int, 3>, 4> directions{{{1000003, 999979, 130363},
                                                        {-7919, 104729, 1299709},
                                                        {15485863, -32452843, 49979687},
                                                        {-86028121, -67867967, 122949823}}};

}  // namespace

bool exact_touch(const Corners& a, const Corners& b) {
    Scale scale;
    for (const Corners* corners : {&a, &b})
        for (const Vec3d& p : *corners) scale.include(p);
    const auto whole = [&](const Corners& c) {
        return Triple{scale.whole(c[0]), scale.whole(c[1]), scale.whole(c[2])};
    };
    return !disjoint(whole(a), whole(b));
}

ExactPlace exact_place(const MeshViewD& mesh, Vec3d point) {
    Scale scale;
    scale.include(point);
    for (const Triangle& t : mesh.triangles)
        for (const std::uint32_t corner : t) scale.include(mesh.vertices[corner]);
    const Point origin = scale.whole(point);
    std::vector<Triple> triangles;
    const Triple at_origin{};
    for (const Triangle& t : mesh.triangles) {
        triangles.emplace_back();
        for (std::size_t k = 0; k < 3; ++k)
            triangles.back()[k] = minus(scale.whole(mesh.vertices[t[k]]), origin);
        if (is_zero(triangles.back()[0]) || !disjoint(triangles.back(), at_origin))
            return {.on_surface = true};
    }
    for (const auto& d : directions) {
        ExactPlace place;
        bool clear = true;
        for (const Triple& t : triangles) {
            const Crossing here = crossing(t, {d[0], d[1], d[2]});
            clear = clear && here != Crossing::unclear;
            place.winding += here == Crossing::out ? 1 : here == Crossing::in ? -1 : 0;
            place.crossings += here == Crossing::out || here == Crossing::in;
        }
        if (clear) return place;
    }
    throw std::runtime_error("exact_place: no direction is clear of edges");
}

}  // namespace raydix::attack
