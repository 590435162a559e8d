// The point of a sphere or capsule that is closest to a query, and whether a segment touches it, in
// double: closed balls and capsules, or what an instance's map makes of them. A sphere is a capsule
// whose ends are one point.
#pragma once

#include <raydix/shapes.h>
#include <raydix/types.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "base/distance.h"
#include "base/double3.h"
#include "base/math.h"
#include "base/scalar.h"
#include "engine/affine.h"
#include "tree/outward_box.h"

namespace raydix {

template <class Scalar>
struct BasicShapePoint {
    BasicVec3<Scalar> position;
    Scalar u;  // along the axis
    Scalar d2;
};
using ShapePoint = BasicShapePoint<float>;
using ShapePointD = BasicShapePoint<double>;

inline Capsule capsule_of(const Sphere& s) { return {s.center, s.center, s.radius}; }

/// Rounded to float, but not out of the boxes that trees have around the shape.
inline ShapePoint rounded_point(Double3 position, Double3 lo, Double3 hi, double u, Vec3 query) {
    const Vec3 low{round_down(lo.x), round_down(lo.y), round_down(lo.z)},
        high{round_up(hi.x), round_up(hi.y), round_up(hi.z)};
    const Vec3 p = without_negative_zero(min_of(max_of(position.rounded(), low), high));
    return {p, static_cast<float>(u), squared_distance(p, query)};
}

inline ShapePointD rounded_point(Double3 position, Double3 lo, Double3 hi, double u, Vec3d query) {
    Vec3d p, low, high;
    position.round_to(p), lo.round_to(low), hi.round_to(high);
    p = without_negative_zero(min_of(max_of(p, low), high));
    return {p, u, squared_distance(p, query)};
}

/// Of the points within `radius` of the segment a, b.
template <class Vec>
auto closest_on_capsule(Double3 a, Double3 b, double radius, Vec q) {
    const Double3 query(q), axis = b - a;
    const double length2 = dot(axis, axis);
    const double u = length2 > 0.0 ? std::clamp(dot(query - a, axis) / length2, 0.0, 1.0) : 0.0;
    const Double3 on_axis = u == 1.0 ? b : a + axis * u;
    const Double3 off = query - on_axis;
    const double distance = length(off);
    const Double3 position = distance <= radius ? query : on_axis + off * (radius / distance);
    const auto least = [&](double x, double y) { return std::min(x, y) - radius; };
    const auto largest = [&](double x, double y) { return std::max(x, y) + radius; };
    return rounded_point(position, {least(a.x, b.x), least(a.y, b.y), least(a.z, b.z)},
                         {largest(a.x, b.x), largest(a.y, b.y), largest(a.z, b.z)}, u, q);
}

/// The image of a ball around 0 under a linear map, as queries of distance need it: an ellipsoid.
class BallImage {
public:
    BallImage(const Affine& map, double radius) : map_(map), radius_(radius) {
        const Double3 x{map.x.x, map.y.x, map.z.x}, y{map.x.y, map.y.y, map.z.y},
            z{map.x.z, map.y.z, map.z.z};
        square_ = {{{dot(x, x), dot(x, y), dot(x, z)},
                    {dot(y, x), dot(y, y), dot(y, z)},
                    {dot(z, x), dot(z, y), dot(z, z)}}};
        turn_to_axes();
    }

    /// The scale of a map that keeps shapes; 0: this one does not.
    [[nodiscard]] double scale() const {
        const double most = std::max({square_[0][0], square_[1][1], square_[2][2]}),
                     least = std::min({square_[0][0], square_[1][1], square_[2][2]});
        return least >= most * (1.0 - 1e-12) ? std::sqrt(most) : 0.0;
    }
    /// How far it reaches along each axis.
    [[nodiscard]] Double3 reach() const {
        return Double3{length(map_.x), length(map_.y), length(map_.z)} * radius_;
    }
    /// Its point that is closest to y; y itself inside. The least |map w - y| with |w| <= radius:
    /// by the one root of |w(s)| = radius, w(s) = (map^T map + s)^-1 map^T y (Newton's steps for
    /// 1 / |w|, which come from one side; More, Sorensen 1983).
    [[nodiscard]] Double3 closest(Double3 y) const {
        // map^T y along the main axes.
        const Double3 back{map_.x.x * y.x + map_.y.x * y.y + map_.z.x * y.z,
                           map_.x.y * y.x + map_.y.y * y.y + map_.z.y * y.z,
                           map_.x.z * y.x + map_.y.z * y.y + map_.z.z * y.z};
        const double g[3] = {dot(axis_[0], back), dot(axis_[1], back), dot(axis_[2], back)};
        if (norm_at(g, 0.0) <= radius_) return y;
        if (radius_ == 0.0) return {};
        double s = 0.0;
        for (int step = 0; step < 100; ++step) {
            const double norm = norm_at(g, s);
            double slope = 0.0;  // of |w|^2 / -2
            for (std::size_t k = 0; k < 3; ++k) {
                const double w = g[k] / (square_[k][k] + s);
                slope += w * w / (square_[k][k] + s);
            }
            const double next = s + (norm / radius_ - 1.0) * norm * norm / slope;
            const bool still = next > s * (1.0 + 0x1p-50);
            s = std::max(s, next);
            if (!still) break;
        }
        Double3 w;
        for (std::size_t k = 0; k < 3; ++k) w = w + axis_[k] * (g[k] / (square_[k][k] + s));
        return map_.vector(w);
    }

private:
    [[nodiscard]] double norm_at(const double (&g)[3], double s) const {
        double sum = 0.0;
        for (std::size_t k = 0; k < 3; ++k) {
            const double w = g[k] / (square_[k][k] + s);
            sum += w * w;
        }
        return std::sqrt(sum);
    }
    /// Jacobi's rotations: square_ becomes diagonal.
    void turn_to_axes() {
        axis_ = {Double3{1, 0, 0}, Double3{0, 1, 0}, Double3{0, 0, 1}};
        for (int sweep = 0; sweep < 16; ++sweep)
            for (std::size_t p = 0; p < 2; ++p)
                for (std::size_t q = p + 1; q < 3; ++q) turn(p, q);
    }
    void turn(std::size_t p, std::size_t q) {
        auto& m = square_;
        if (m[p][q] == 0.0) return;
        const double angle = 0.5 * (m[q][q] - m[p][p]) / m[p][q];
        const double t = std::copysign(1.0, angle) / (std::fabs(angle) + std::hypot(angle, 1.0)),
                     c = 1.0 / std::sqrt(t * t + 1.0), s = t * c;
        for (std::size_t k = 0; k < 3; ++k) {
            const double a = m[k][p], b = m[k][q];
            m[k][p] = c * a - s * b, m[k][q] = s * a + c * b;
        }
        for (std::size_t k = 0; k < 3; ++k) {
            const double a = m[p][k], b = m[q][k];
            m[p][k] = c * a - s * b, m[q][k] = s * a + c * b;
        }
        const Double3 a = axis_[p], b = axis_[q];
        axis_[p] = a * c - b * s, axis_[q] = a * s + b * c;
    }

    Affine map_;
    double radius_;
    std::array<std::array<double, 3>, 3> square_;  // map^T map, turned to its axes
    std::array<Double3, 3> axis_;
};

/// Of all that images of balls of a radius have around points of the segment a, b.
template <class Vec>
auto closest_on_image(Double3 a, Double3 b, const BallImage& ball, double radius, Vec q) {
    if (const double scale = ball.scale(); scale > 0.0)
        return closest_on_capsule(a, b, scale * radius, q);
    const Double3 query(q), axis = b - a;
    // The distance from a + u * axis + ball is convex in u: its slope has the sign of -off . axis.
    double u = 0.0;
    Double3 on_ball = ball.closest(query - a);
    if (dot(axis, axis) > 0.0 && dot(query - a - on_ball, axis) > 0.0) {
        double from = 0.0, to = 1.0;
        const auto goes_on = [&](double at) {
            on_ball = ball.closest(query - a - axis * at);
            return dot(query - a - axis * at - on_ball, axis) > 0.0;
        };
        u = 1.0;
        if (!goes_on(1.0)) {
            for (int step = 0; step < 60; ++step) {
                u = 0.5 * (from + to);
                (goes_on(u) ? from : to) = u;
            }
            static_cast<void>(goes_on(u));
        }
    }
    const Double3 on_axis = a + axis * u, reach = ball.reach();
    const auto least = [](double x, double y, double by) { return std::min(x, y) - by; };
    const auto largest = [](double x, double y, double by) { return std::max(x, y) + by; };
    return rounded_point(
        on_axis + on_ball,
        {least(a.x, b.x, reach.x), least(a.y, b.y, reach.y), least(a.z, b.z, reach.z)},
        {largest(a.x, b.x, reach.x), largest(a.y, b.y, reach.y), largest(a.z, b.z, reach.z)}, u, q);
}
/// Of a capsule in the space of an instance; `map` leads from there to the query.
inline ShapePoint closest_on_image(const Affine& map, const Capsule& capsule, Vec3 q) {
    const double radius = capsule.radius;
    return closest_on_image(map.point(Double3(capsule.a)), map.point(Double3(capsule.b)),
                            BallImage(map, radius), radius, q);
}

/// The square of the least distance between two segments.
inline double segment_distance2(Double3 a, Double3 b, Double3 c, Double3 d) {
    const auto point_to = [](Double3 p, Double3 from, Double3 to) {
        const Double3 along = to - from;
        const double length2 = dot(along, along);
        const double t = length2 > 0.0 ? std::clamp(dot(p - from, along) / length2, 0.0, 1.0) : 0.0;
        const Double3 off = from + along * t - p;
        return dot(off, off);
    };
    double best =
        std::min({point_to(a, c, d), point_to(b, c, d), point_to(c, a, b), point_to(d, a, b)});
    // Inside of both, where the line between them is across both.
    const Double3 ab = b - a, cd = d - c, across = cross(ab, cd);
    const double across2 = dot(across, across);
    if (!(across2 > 0.0)) return best;
    const double s = dot(cross(c - a, cd), across), t = dot(cross(c - a, ab), across);
    if (s >= 0.0 && s <= across2 && t >= 0.0 && t <= across2) {
        const double height = dot(c - a, across);
        best = std::min(best, height * height / across2);
    }
    return best;
}

/// Segment and capsule in one space.
template <class AnyCapsule>
bool segment_touches_capsule(Double3 from, Double3 to, const AnyCapsule& capsule) {
    const double r = capsule.radius;
    return segment_distance2(from, to, Double3(capsule.a), Double3(capsule.b)) <= r * r;
}

}  // namespace raydix
