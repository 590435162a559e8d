// Queries over points by looking at every one of them, for each kind of index; and the point sets
// of point_sets.h as its points.
#pragma once

#include <raydix/points.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "support/point_sets.h"

namespace raydix::test {

/// Of float32 points; in double each coordinate gets digits that float32 does not have.
template <class Index>
std::vector<typename Index::Point> points_as(const std::vector<Vec3>& points) {
    using T = typename Index::Scalar;
    std::vector<typename Index::Point> converted;
    std::uint32_t noise = 1;
    const auto value = [&](float x) {
        noise = noise * 1664525u + 1013904223u;
        return static_cast<T>(x) * (1 + static_cast<T>(noise >> 20) * static_cast<T>(1e-13));
    };
    for (const Vec3& p : points) {
        typename Index::Point q{};
        q.x = std::is_same_v<T, float> ? static_cast<T>(p.x) : value(p.x);
        q.y = std::is_same_v<T, float> ? static_cast<T>(p.y) : value(p.y);
        if constexpr (Index::dimension == 3)
            q.z = std::is_same_v<T, float> ? static_cast<T>(p.z) : value(p.z);
        converted.push_back(q);
    }
    return converted;
}

template <class T>
struct Near {
    T d2;
    std::uint32_t id;
};

template <class Index>
class EveryPoint {
public:
    using T = typename Index::Scalar;
    using Point = typename Index::Point;

    explicit EveryPoint(const std::vector<Point>& points) : points_(points) {}

    static T coordinate(const Point& p, int d) { return (&p.x)[d]; }
    static bool is_finite(const Point& p) {
        for (int d = 0; d < Index::dimension; ++d)
            if (!std::isfinite(coordinate(p, d))) return false;
        return true;
    }
    static bool is_valid(const Point& p) {
        for (int d = 0; d < Index::dimension; ++d)
            if (!(std::abs(coordinate(p, d)) <= static_cast<T>(1e12f))) return false;
        return true;
    }
    static T squared_distance(const Point& a, const Point& b) {
        const T dx = a.x - b.x, dy = a.y - b.y;
        if constexpr (Index::dimension == 2)
            return dx * dx + dy * dy;
        else {
            const T dz = a.z - b.z;
            return (dx * dx + dy * dy) + dz * dz;
        }
    }

    /// All valid points, nearest first; none if the query is not finite.
    [[nodiscard]] std::vector<Near<T>> by_distance(const Point& query) const {
        std::vector<Near<T>> all;
        if (!is_finite(query)) return all;
        for (std::uint32_t i = 0; i < points_.size(); ++i)
            if (is_valid(points_[i])) all.push_back({squared_distance(points_[i], query), i});
        std::ranges::sort(all, [](const Near<T>& a, const Near<T>& b) {
            return a.d2 != b.d2 ? a.d2 < b.d2 : a.id < b.id;
        });
        return all;
    }
    [[nodiscard]] std::vector<Near<T>> within(const Point& query, T radius, bool sorted) const {
        std::vector<Near<T>> found = by_distance(query);
        std::erase_if(found, [&](const Near<T>& n) { return !(n.d2 <= radius * radius); });
        if (!sorted) std::ranges::sort(found, {}, &Near<T>::id);
        return found;
    }
    [[nodiscard]] std::vector<std::uint32_t> in_box(const typename Index::Box& box) const {
        std::vector<std::uint32_t> found;
        if (!is_finite(box.lo) || !is_finite(box.hi)) return found;
        for (std::uint32_t i = 0; i < points_.size(); ++i) {
            bool inside = is_valid(points_[i]);
            for (int d = 0; d < Index::dimension; ++d)
                inside = inside && coordinate(box.lo, d) <= coordinate(points_[i], d) &&
                         coordinate(points_[i], d) <= coordinate(box.hi, d);
            if (inside) found.push_back(i);
        }
        return found;
    }

private:
    const std::vector<Point>& points_;
};

}  // namespace raydix::test
