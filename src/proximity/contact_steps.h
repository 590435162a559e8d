// The first contact of a moving ball with any triangle, by Newton's steps on its distance, in
// double. Nothing is divided by the triangle's height, so that needles and triangles without area
// cost no digits.
#pragma once

#include <algorithm>
#include <cmath>

#include "base/double3.h"
#include "proximity/closest_on_triangle.h"
#include "trace/grown_boxes.h"

namespace raydix {

/// Corners where the path is, and edges. Those are of the corners as they are in the scene:
/// differences of rounded corners would turn a needle's plane.
struct PathTriangle {
    Double3 a, b, c, ab, ac, bc;

    /// `start`: where the path's 0 is in the scene.
    template <class Corners>
    PathTriangle(const Corners& t, Double3 start)
        : a(Double3(t.v0) - start),
          b(Double3(t.v1) - start),
          c(Double3(t.v2) - start),
          ab(Double3(t.v1) - Double3(t.v0)),
          ac(Double3(t.v2) - Double3(t.v0)),
          bc(Double3(t.v2) - Double3(t.v1)) {}
};

/// A moving point's distance from something, and what that gains with each unit of t.
struct Approach {
    double distance, rate;
};

/// `off`: from the closest place to the point; `drift`: how `off` changes with t.
inline Approach approach_along(Double3 off, Double3 drift) {
    const double distance = length(off);
    return {distance, dot(off, drift) / distance};
}

class ContactSteps {
public:
    ContactSteps(const Path& path, const PathTriangle& triangle, double radius)
        : path_(path),
          t_(triangle),
          normal_(accurate_cross(t_.ab, t_.ac)),
          normal2_(dot(normal_, normal_)),
          radius_(radius),
          lengths_(sum(path.origin) + sum(t_.a) + sum(t_.ab) + sum(t_.ac) + radius) {}

    /// The first t from `from` on at which the ball touches, or never. The distance along a line is
    /// convex, so a step from before the contact ends before it. The product of what is left and
    /// its rate shrinks to a quarter with each step: one that takes more than `most_steps` misses.
    [[nodiscard]] double run(double from) const {
        constexpr int most_steps = 64;
        double t = from;
        for (int step = 0; step < most_steps; ++step) {
            const Double3 center = path_.at(t);
            const Approach near = approach(center);
            const double left = near.distance - radius_;
            if (left <= resolution * (lengths_ + sum(center))) return t <= path_.tmax ? t : never;
            if (!(near.rate < 0.0)) return never;
            const double next = t - left / near.rate;
            if (!(next <= path_.tmax)) return never;
            if (!(next > t)) return t;  // nearer than numbers go
            t = next;
        }
        return never;
    }

private:
    /// Above what rounding adds to a distance, as a part of all lengths in it.
    static constexpr double resolution = 0x1p-49;

    static double sum(Double3 v) { return (std::fabs(v.x) + std::fabs(v.y)) + std::fabs(v.z); }

    [[nodiscard]] Approach approach(Double3 center) const {
        const Double3 from_a = center - t_.a, from_b = center - t_.b, from_c = center - t_.c;
        if (normal2_ > 0.0 && is_over(from_a)) {
            const double side = std::copysign(1.0 / std::sqrt(normal2_), dot(from_a, normal_));
            return {dot(from_a, normal_) * side, dot(path_.direction, normal_) * side};
        }
        Approach best = approach_to_edge(from_a, from_b, t_.ab);
        for (const Approach& other :
             {approach_to_edge(from_b, from_c, t_.bc), approach_to_edge(from_a, from_c, t_.ac)})
            if (other.distance < best.distance) best = other;
        return best;
    }

    /// Whether the foot on the plane is in the triangle. The weights of a point in the plane are
    /// sums of products of one sign: they are right for a foot that is a rounding away.
    [[nodiscard]] bool is_over(Double3 from_a) const {
        const Double3 foot = from_a - normal_ * (dot(from_a, normal_) / normal2_);
        const double of_b = dot(accurate_cross(foot, t_.ac), normal_),
                     of_c = dot(accurate_cross(t_.ab, foot), normal_);
        return of_b >= 0.0 && of_c >= 0.0 && of_b + of_c <= normal2_;
    }

    /// The rate at an edge leaves out what of the direction is along it, which is nearly all for a
    /// path that is nearly parallel.
    [[nodiscard]] Approach approach_to_edge(Double3 from_start, Double3 from_end,
                                            Double3 edge) const {
        const double length2 = dot(edge, edge), along = dot(from_start, edge);
        if (!(along > 0.0)) return approach_along(from_start, path_.direction);
        if (!(along < length2)) return approach_along(from_end, path_.direction);
        const double drift = dot(path_.direction, edge) / length2;
        return approach_along(from_start - edge * (along / length2),
                              path_.direction - edge * drift);
    }

    Path path_;
    PathTriangle t_;
    Double3 normal_;
    double normal2_, radius_, lengths_;
};

}  // namespace raydix
