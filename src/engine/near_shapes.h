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

inline double largest_component(Double3 v) {
    return std::max({std::fabs(v.x), std::fabs(v.y), std::fabs(v.z)});
}
/// A power of two that leaves the products of a vector's components finite: 1 but for vectors so
/// long that their squares overflow.
inline double scale_of_products(Double3 v) {
    return largest_component(v) > 0x1p500 ? 0x1p-600 : 1.0;
}

/// Of the points within `radius` of the segment a, b.
template <class Vec>
auto closest_on_capsule(Double3 a, Double3 b, double radius, Vec q) {
    const Double3 query(q), axis = b - a, from = query - a;
    const double length2 = dot(axis, axis), scale = scale_of_products(from);
    const double u =
        length2 > 0.0 ? std::clamp(dot(from * scale, axis) / length2 / scale, 0.0, 1.0) : 0.0;
    const Double3 on_axis = u == 1.0 ? b : a + axis * u;
    const Double3 off = (query - on_axis) * scale;
    const double distance = length(off);
    const Double3 position =
        distance <= radius * scale ? query : on_axis + off * (radius / distance);
    const auto least = [&](double x, double y) { return std::min(x, y) - radius; };
    const auto largest = [&](double x, double y) { return std::max(x, y) + radius; };
    return rounded_point(position, {least(a.x, b.x), least(a.y, b.y), least(a.z, b.z)},
                         {largest(a.x, b.x), largest(a.y, b.y), largest(a.z, b.z)}, u, q);
}

/// The image of a ball around 0 under a linear map, as queries of distance need it: an ellipsoid.
class BallImage {
public:
    BallImage(const Affine& map, double radius)
        : reach_(Double3{length(map.x), length(map.y), length(map.z)} * radius) {
        std::array<Double3, 3> rows{map.x, map.y, map.z};
        turn_to_axes(rows);
        double least = infinity, most = 0.0;
        for (const Double3& row : rows)
            least = std::min(least, dot(row, row)), most = std::max(most, dot(row, row));
        scale_ = least >= most * (1.0 - 1e-12) ? std::sqrt(most) : 0.0;
        most_ = std::sqrt(most) * radius;
        for (std::size_t k = 0; k < 3; ++k)  // no axis is 0: thinner is below all rounding
            part_[k] = most > 0.0 ? std::max(length(rows[k]) / std::sqrt(most), 0x1p-60) : 1.0;
    }

    /// The scale of a map that keeps shapes; 0: this one does not.
    [[nodiscard]] double scale() const { return scale_; }
    /// How far it reaches along each axis.
    [[nodiscard]] Double3 reach() const { return reach_; }
    /// Its point that is closest to y; y itself inside. Along the main axes, in units of the
    /// longest: part^2 g / (part^2 + s) by the one root of |w(s)| = 1, w(s) = part g / (part^2 + s)
    /// (Newton's steps for 1 / |w|, which come from one side; More, Sorensen 1983).
    [[nodiscard]] Double3 closest(Double3 y) const {
        if (most_ == 0.0) return {};
        if (const double far = largest_component(y); far > 0x1p500)  // its direction decides
            y = y * std::scalbn(1.0, 300 - std::ilogb(far));
        double g[3], outside = 0.0, s = 0.0;
        for (std::size_t k = 0; k < 3; ++k) {
            g[k] = dot(axis_[k], y) / most_;
            outside += (g[k] / part_[k]) * (g[k] / part_[k]);
            s = std::max(s,
                         part_[k] * (std::fabs(g[k]) - part_[k]));  // no w is above 1 at the root
        }
        if (outside <= 1.0) return y;
        for (int step = 0; step < 100; ++step) {
            double sum = 0.0, slope = 0.0;  // |w|^2, and its slope / -2
            for (std::size_t k = 0; k < 3; ++k) {
                const double below = part_[k] * part_[k] + s, w = part_[k] * g[k] / below;
                sum += w * w;
                slope += w * w / below;
            }
            const double next = s + (std::sqrt(sum) - 1.0) * sum / slope;
            const bool still = next > s * (1.0 + 0x1p-50);
            s = std::max(s, next);
            if (!still) break;
        }
        Double3 point;
        for (std::size_t k = 0; k < 3; ++k) {
            const double square = part_[k] * part_[k];
            point = point + axis_[k] * (square * g[k] / (square + s) * most_);
        }
        return point;
    }

private:
    /// Jacobi's rotations from one side (Hestenes 1958) until no two rows have a common part. The
    /// least axis keeps its digits, which the square of the map would lose.
    void turn_to_axes(std::array<Double3, 3>& rows) {
        axis_ = {Double3{1, 0, 0}, Double3{0, 1, 0}, Double3{0, 0, 1}};
        bool turned = true;
        for (int sweep = 0; sweep < 16 && turned; ++sweep) {
            turned = turn(rows, 0, 1);
            turned = turn(rows, 0, 2) || turned;
            turned = turn(rows, 1, 2) || turned;
        }
    }
    bool turn(std::array<Double3, 3>& rows, std::size_t p, std::size_t q) {
        const double common = dot(rows[p], rows[q]), pp = dot(rows[p], rows[p]),
                     qq = dot(rows[q], rows[q]);
        if (std::fabs(common) <= 0x1p-50 * std::sqrt(pp) * std::sqrt(qq)) return false;
        const double angle = 0.5 * (qq - pp) / common;
        const double t = std::copysign(1.0, angle) / (std::fabs(angle) + std::hypot(angle, 1.0)),
                     c = 1.0 / std::sqrt(t * t + 1.0), s = t * c;
        for (auto* of : {&rows, &axis_}) {
            const Double3 a = (*of)[p], b = (*of)[q];
            (*of)[p] = a * c - b * s, (*of)[q] = a * s + b * c;
        }
        return true;
    }

    Double3 reach_;
    double scale_, most_;          // most_: the longest half axis
    std::array<double, 3> part_;   // half axes as parts of the longest
    std::array<Double3, 3> axis_;  // their directions
};

/// Of all that images of balls of a radius have around points of the segment a, b.
template <class Vec>
auto closest_on_image(Double3 a, Double3 b, const BallImage& ball, double radius, Vec q) {
    if (const double scale = ball.scale(); scale > 0.0)
        return closest_on_capsule(a, b, scale * radius, q);
    const Double3 query(q), axis = b - a;
    const double products = scale_of_products(query - a);
    // The distance from a + u * axis + ball is convex in u: its slope has the sign of -off . axis.
    double u = 0.0;
    Double3 on_ball = ball.closest(query - a);
    if (dot(axis, axis) > 0.0 && dot((query - a - on_ball) * products, axis) > 0.0) {
        double from = 0.0, to = 1.0;
        const auto goes_on = [&](double at) {
            on_ball = ball.closest(query - a - axis * at);
            return dot((query - a - axis * at - on_ball) * products, axis) > 0.0;
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
