// A triangle cut down to a box, in double: Sutherland and Hodgman's algorithm, one plane at a time.
#pragma once

#include <raydix/types.h>

#include <array>
#include <cmath>
#include <cstddef>

namespace raydix {

struct Polygon {
    using Point = std::array<double, 3>;
    // A plane turns each run of outside corners into two at most, so it adds at most half of the
    // corners there were, rounding or not: 3, 4, 6, 9, 13, 19, 28 after six planes.
    std::array<Point, 28> corners;
    std::size_t count = 0;

    void add(const Point& p) { corners[count++] = p; }

    [[nodiscard]] double area() const {
        const Point n = twice_normal();
        return 0.5 * std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    }
    /// Sum of the areas of its shadows on the three coordinate planes: half the surface of the
    /// boxes around very many small parts of it, together.
    [[nodiscard]] double projected_area() const {
        const Point n = twice_normal();
        return 0.5 * (std::fabs(n[0]) + std::fabs(n[1]) + std::fabs(n[2]));
    }

private:
    /// Along the normal, twice as long as the area is large.
    [[nodiscard]] Point twice_normal() const {
        Point sum{};
        for (std::size_t i = 1; i + 1 < count; ++i) {
            Point a{}, b{};
            for (std::size_t k = 0; k < 3; ++k) {
                a[k] = corners[i][k] - corners[0][k];
                b[k] = corners[i + 1][k] - corners[0][k];
            }
            for (std::size_t k = 0; k < 3; ++k)
                sum[k] += a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3];
        }
        return sum;
    }
};

inline Polygon polygon_of(Vec3 a, Vec3 b, Vec3 c) {
    Polygon polygon;
    for (const Vec3& p : {a, b, c}) polygon.add({p.x, p.y, p.z});
    return polygon;
}

/// What lies on the side of the plane where sign * (coordinate - plane) <= 0. Points on it stay.
inline Polygon clip(const Polygon& in, std::size_t axis, double plane, double sign) {
    Polygon out;
    for (std::size_t i = 0; i < in.count; ++i) {
        const Polygon::Point& a = in.corners[i];
        const Polygon::Point& b = in.corners[i + 1 < in.count ? i + 1 : 0];
        const double from = sign * (a[axis] - plane), to = sign * (b[axis] - plane);
        if (from <= 0) out.add(a);
        if ((from < 0 && to > 0) || (from > 0 && to < 0)) {
            const double t = from / (from - to);
            Polygon::Point p;
            for (std::size_t k = 0; k < 3; ++k) p[k] = a[k] + t * (b[k] - a[k]);
            p[axis] = plane;  // exactly, so that flat boxes keep what lies in them
            out.add(p);
        }
    }
    return out;
}

/// The part of `polygon` inside the closed box, larger by `room` on all sides; no corners if there
/// is none.
inline Polygon clip(Polygon polygon, const Aabb& box, double room = 0.0) {
    const Polygon::Point lo{box.lo.x - room, box.lo.y - room, box.lo.z - room},
        hi{box.hi.x + room, box.hi.y + room, box.hi.z + room};
    for (std::size_t axis = 0; axis < 3 && polygon.count; ++axis) {
        double least = polygon.corners[0][axis], most = least;
        for (std::size_t i = 1; i < polygon.count; ++i) {
            least = std::fmin(least, polygon.corners[i][axis]);
            most = std::fmax(most, polygon.corners[i][axis]);
        }
        if (least > hi[axis] || most < lo[axis]) return {};
        if (least < lo[axis]) polygon = clip(polygon, axis, lo[axis], -1.0);
        if (most > hi[axis]) polygon = clip(polygon, axis, hi[axis], 1.0);
    }
    return polygon;
}

}  // namespace raydix
