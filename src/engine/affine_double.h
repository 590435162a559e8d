// Affine maps in double: inverses to the last digits, rays through them, and boxes around what they
// make of boxes, with what rounding may add.
#pragma once

#include <raydix/double.h>
#include <raydix/transform.h>
#include <raydix/types.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "base/double3.h"
#include "base/math.h"
#include "primitives/double_sources.h"

namespace raydix {

/// A sum of two doubles that do not overlap. Error bounds: Joldes, Muller, Popescu, "Tight and
/// rigorous error bounds for basic building blocks of double-word arithmetic", 2017.
struct TwoDoubles {
    double hi, lo;
};
inline TwoDoubles two_sum(double a, double b) {
    const double sum = a + b, back = sum - a;
    return {sum, (a - (sum - back)) + (b - back)};
}
inline TwoDoubles exact_product(double a, double b) {
    const double product = a * b;
    return {product, std::fma(a, b, -product)};
}
/// Relative error 2^-104 (AccurateDWPlusDW, algorithm 6), whatever cancels.
inline TwoDoubles operator+(TwoDoubles a, TwoDoubles b) {
    const TwoDoubles high = two_sum(a.hi, b.hi), low = two_sum(a.lo, b.lo);
    const TwoDoubles sum = two_sum(high.hi, high.lo + low.hi);
    return two_sum(sum.hi, low.lo + sum.lo);
}
/// Relative error 2^-104 (DWTimesFP3, algorithm 9).
inline TwoDoubles operator*(TwoDoubles a, double b) {
    const TwoDoubles high = exact_product(a.hi, b);
    return two_sum(high.hi, std::fma(a.lo, b, high.lo));
}

/// a * b - c * d.
inline TwoDoubles minor_of(double a, double b, double c, double d) {
    return exact_product(a, b) + exact_product(-c, d);
}

/// Rows and translation of a map.
struct AffineD {
    Double3 x, y, z;
    Double3 move;

    [[nodiscard]] Double3 vector(Double3 v) const { return {dot(x, v), dot(y, v), dot(z, v)}; }
    /// Largest sum of a row's magnitudes: what the map may make of a vector's largest component.
    [[nodiscard]] double norm() const {
        const auto sum = [](Double3 row) {
            return std::fabs(row.x) + std::fabs(row.y) + std::fabs(row.z);
        };
        return std::max({sum(x), sum(y), sum(z)});
    }
};

inline AffineD affine_of(const TransformD& t) {
    const auto row = [&](std::size_t i) { return Double3(t.m[i][0], t.m[i][1], t.m[i][2]); };
    return {row(0), row(1), row(2), {t.m[0][3], t.m[1][3], t.m[2][3]}};
}

/// The way into an object's space: v = rows * (p - move) with the move of the way out, since a
/// place far from the origin would cost digits if it were mapped before it is subtracted.
struct InverseD {
    AffineD rows;

    [[nodiscard]] Double3 vector(Double3 v) const { return rows.vector(v); }
    [[nodiscard]] Double3 point(Double3 p) const { return rows.vector(p - rows.move); }
};

/// The cofactors of rows of about unit size, and their determinant.
struct CofactorsD {
    Double3 x, y, z;  // rows of the transposed matrix of cofactors
    double determinant;

    CofactorsD(Double3 a, Double3 b, Double3 c) {
        const TwoDoubles bc_x = minor_of(b.y, c.z, b.z, c.y), bc_y = minor_of(b.z, c.x, b.x, c.z),
                         bc_z = minor_of(b.x, c.y, b.y, c.x);
        determinant = (bc_x * a.x + bc_y * a.y + bc_z * a.z).hi;
        x = {bc_x.hi, minor_of(c.y, a.z, c.z, a.y).hi, minor_of(a.y, b.z, a.z, b.y).hi};
        y = {bc_y.hi, minor_of(c.z, a.x, c.x, a.z).hi, minor_of(a.z, b.x, a.x, b.z).hi};
        z = {bc_z.hi, minor_of(c.x, a.y, c.y, a.x).hi, minor_of(a.x, b.y, a.y, b.x).hi};
    }
};

/// None if the map flattens: a determinant of at most 2^-40 of the product of the rows' lengths, as
/// what rounding makes of dependent rows has, or anything that is not finite. Else each entry of
/// the inverse is off by at most four roundings.
inline std::optional<InverseD> inverse_of(const AffineD& a) {
    const auto largest = [](Double3 row) {
        return std::max({std::fabs(row.x), std::fabs(row.y), std::fabs(row.z)});
    };
    if (!is_finite(a.x) || !is_finite(a.y) || !is_finite(a.z) || !is_finite(a.move)) return {};
    const double size = std::max({largest(a.x), largest(a.y), largest(a.z)});
    if (size == 0.0) return {};
    int exponent;
    std::frexp(size, &exponent);
    // In two steps: 2^1074 is no double.
    const auto scaled = [&](Double3 row) {
        return row * std::ldexp(1.0, -exponent / 2) * std::ldexp(1.0, -exponent - -exponent / 2);
    };
    const Double3 x = scaled(a.x), y = scaled(a.y), z = scaled(a.z);
    const CofactorsD c(x, y, z);
    const double box = length(x) * length(y) * length(z);
    // Rows so unlike each other that products lose digits count as flat too.
    if (!(std::fabs(c.determinant) > 0x1p-40 * box) || box < 0x1p-800) return {};
    const auto row = [&](Double3 cofactors) {
        return scaled({cofactors.x / c.determinant, cofactors.y / c.determinant,
                       cofactors.z / c.determinant});
    };
    const InverseD inverse{{row(c.x), row(c.y), row(c.z), a.move}};
    if (!is_finite(inverse.rows.x) || !is_finite(inverse.rows.y) || !is_finite(inverse.rows.z))
        return {};
    return inverse;
}

/// A ray in some space; t keeps its meaning from space to space.
struct LineD {
    Double3 origin, direction;

    explicit LineD(const RayD& ray) : origin(ray.origin), direction(ray.direction) {}
    LineD(Double3 o, Double3 d) : origin(o), direction(d) {}

    [[nodiscard]] RayD ray(double tmin, double tmax) const {
        RayD out{{}, tmin, {}, tmax};
        origin.round_to(out.origin);
        direction.round_to(out.direction);
        return out;
    }
    [[nodiscard]] LineD into(const InverseD& inverse) const {
        return {inverse.point(origin), inverse.vector(direction)};
    }
};

/// A box around something, and how far beside it rays may be told that they hit: at t, a ray is
/// within error * (the greatest distance from its origin to the box, by components) of the box.
struct ExtentD {
    AabbD box;
    double error;
};
inline constexpr AabbD nothing_d{{infinity, infinity, infinity}, {-infinity, -infinity, -infinity}};
[[nodiscard]] inline bool is_empty(const ExtentD& extent) {
    return extent.box.lo.x > extent.box.hi.x;
}
[[nodiscard]] inline bool in_range(const ExtentD& extent) {
    return in_range(extent.box.lo) && in_range(extent.box.hi);
}
/// Of triangles in `box`: at t the ray is as near to the triangle as slab.h says, twice over.
[[nodiscard]] inline ExtentD extent_of_triangles(const AabbD& box) { return {box, 0x1p-46}; }

/// What stands somewhere through maps, one after the other from the inside outward. As `Image` in
/// float (docs/algorithms/scenes.md): only the outermost box is a box.
struct ImageD {
    AffineD map{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {}};
    double size;       // at least the largest coordinate of the image, on all levels
    double slack = 0;  // how far rays may miss it, but for what grows with their distance
    double error;      // as in ExtentD

    /// In its own space. No extent may be asked of one that is empty.
    explicit ImageD(const ExtentD& own)
        : size(std::max({std::fabs(own.box.lo.x), std::fabs(own.box.hi.x), std::fabs(own.box.lo.y),
                         std::fabs(own.box.hi.y), std::fabs(own.box.lo.z),
                         std::fabs(own.box.hi.z)})),
          error(own.error) {}

    /// One map farther out. With M = |L| |L^-1| for its matrix L, rounding on the way in moves the
    /// point at t by at most 2^-49 M (|origin - move| + |point - origin|): L^-1 is off by 4
    /// roundings, the difference by 1, products and sums by 3, and there is as much to spare. The
    /// part of that which does not grow with the ray's distance is slack, as are the roundings of
    /// the product of maps.
    void go_through(const AffineD& a, const InverseD& inverse) {
        const auto row = [&](Double3 r) { return map.x * r.x + map.y * r.y + map.z * r.z; };
        const double norm = a.norm(), condition = norm * inverse.rows.norm();
        const double moved =
            std::max({std::fabs(a.move.x), std::fabs(a.move.y), std::fabs(a.move.z)});
        map = {row(a.x), row(a.y), row(a.z), a.vector(map.move) + a.move};
        slack = norm * slack + rounding * ((1.0 + condition) * norm * size + moved);
        size = norm * size + moved;
        error = condition * (error + rounding);
    }

    /// `own`: what it was made with.
    [[nodiscard]] ExtentD extent(const ExtentD& own) const {
        const Double3 lo(own.box.lo), hi(own.box.hi);
        const Double3 middle = lo * 0.5 + hi * 0.5, half = hi * 0.5 - lo * 0.5;
        // The origin inside may be off by slack too: at most half of what the box then spans, which
        // errors have to spare.
        const double room = slack + rounding * size;
        const auto side = [&](Double3 row) {
            return std::fabs(row.x) * half.x + std::fabs(row.y) * half.y +
                   std::fabs(row.z) * half.z + room;
        };
        const Double3 center = map.vector(middle) + map.move;
        const Double3 by{side(map.x), side(map.y), side(map.z)};
        ExtentD out{{}, error};
        (center - by).round_to(out.box.lo);
        (center + by).round_to(out.box.hi);
        return out;
    }

private:
    static constexpr double rounding = 0x1p-48;
};

}  // namespace raydix
