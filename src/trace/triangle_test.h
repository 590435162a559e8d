// The watertight ray-triangle test (Woop, Benthin, Wald 2013) as a pure function of ray and
// triangle, with the two edge rules of contract.md 3. Every kernel, builder and brute force calls
// this one function, in float or in double.
#pragma once

#include <raydix/bvh.h>
#include <raydix/types.h>

#include <cmath>
#include <type_traits>

#include "base/exact_product.h"
#include "base/hd.h"
#include "base/math.h"
#include "primitives/zero_area.h"
#include "trace/ray_frame.h"

namespace raydix {

enum class EdgeRule {
    closed,    // an edge belongs to both triangles: closest and any hit
    half_open  // to exactly one of them: all hits and counts
};

template <class Scalar>
struct BasicTriangleHit {
    Scalar t, u, v;  // t in the units of the frame
};
using TriangleHit = BasicTriangleHit<float>;

/// A vertex in the ray's sheared plane: the ray is the origin there.
template <class Scalar>
struct BasicShearedVertex {
    Scalar x, y, z;
};
using ShearedVertex = BasicShearedVertex<float>;
using ShearedVertexD = BasicShearedVertex<double>;

template <class Scalar>
RAYDIX_HD inline BasicShearedVertex<Scalar> shear(const BasicRayFrame<Scalar>& ray,
                                                  VecOf<Scalar> vertex) {
    const VecOf<Scalar> v = vertex - ray.origin;
    const Scalar z = component(v, ray.kz);
    return {component(v, ray.kx) - ray.shear_x * z, component(v, ray.ky) - ray.shear_y * z,
            ray.shear_z * z};
}

/// Twice the signed area of (ray, a, b): which side of the edge the ray passes. edge(a, b) ==
/// -edge(b, a) bit for bit, and the sign is exact wherever the value is not 0, since rounding is
/// monotone.
template <class Scalar>
RAYDIX_HD inline Scalar edge_function(const BasicShearedVertex<Scalar>& a,
                                      const BasicShearedVertex<Scalar>& b) {
    return a.x * b.y - a.y * b.x;
}

/// Products of two floats are exact in double, so this sign is exact always.
RAYDIX_HD inline double exact_edge_function(const ShearedVertex& a, const ShearedVertex& b) {
    return double(a.x) * double(b.y) - double(a.y) * double(b.x);
}
/// Of doubles, what rounding took from the two products decides.
RAYDIX_HD inline double exact_edge_function(const ShearedVertexD& a, const ShearedVertexD& b) {
    return product_difference(a.x, b.y, a.y, b.x);
}

/// Sign of the edge function with the ray moved by an infinitesimal step along x and a smaller one
/// along y, so that it lies on no edge: the top-left rule. 0 only if a and b coincide in the plane.
template <class Scalar>
RAYDIX_HD inline int perturbed_edge_sign(const BasicShearedVertex<Scalar>& a,
                                         const BasicShearedVertex<Scalar>& b) {
    const double e = exact_edge_function(a, b);
    if (e != 0.0) return e > 0.0 ? 1 : -1;
    if (a.y != b.y) return a.y > b.y ? 1 : -1;
    if (a.x != b.x) return b.x > a.x ? 1 : -1;
    return 0;
}

/// t of the slab planes of the triangle's own box; the same arithmetic as the traversal's, without
/// its pads.
template <class Scalar>
struct BoxInterval {
    Scalar entry, exit;
};

template <class Scalar, class Corners>
RAYDIX_HD inline BoxInterval<Scalar> own_box_interval(const BasicRayFrame<Scalar>& ray,
                                                      const Corners& triangle) {
    const BoxOf<Scalar> box = box_of(triangle.v0, triangle.v1, triangle.v2);
    BoxInterval<Scalar> interval{-infinity, infinity};
    const auto axis = [&](Scalar lo, Scalar hi, Scalar origin, Scalar inverse) {
        const bool negative = std::signbit(inverse);
        const Scalar near = ((negative ? hi : lo) - origin) * inverse,
                     far = ((negative ? lo : hi) - origin) * inverse;
        interval.entry = max_of(near, interval.entry);
        interval.exit = min_of(far, interval.exit);
    };
    axis(box.lo.x, box.hi.x, ray.origin.x, ray.inverse.x);
    axis(box.lo.y, box.hi.y, ray.origin.y, ray.inverse.y);
    axis(box.lo.z, box.hi.z, ray.origin.z, ray.inverse.z);
    return interval;
}

/// The edge functions of a hit in double. Cancellation may leave nothing of their ratios, and t
/// would then be that of any place of the triangle: `accurate` has them once more.
struct EdgesD {
    double u, v, w;

    [[nodiscard]] RAYDIX_HD double sum() const { return (u + v) + w; }

    /// Whether the weighed corners, which should meet the ray, may miss it by more than 16
    /// roundings of (their distance beside it + along it): each function is off by at most two
    /// roundings of the largest product.
    [[nodiscard]] RAYDIX_HD bool may_stray(const ShearedVertexD& a, const ShearedVertexD& b,
                                           const ShearedVertexD& c, double shear_z) const {
        const auto beside = [](const ShearedVertexD& p) {
            return max_of(std::fabs(p.x), std::fabs(p.y));
        };
        const double m = max_of(max_of(beside(a), beside(b)), beside(c));
        const double z = max_of(max_of(std::fabs(a.z), std::fabs(b.z)), std::fabs(c.z));
        const double scale = std::fabs(shear_z);  // z is in units of the ray's t
        return 3.0 * (m * m) * (m * scale) > 8.0 * std::fabs(sum()) * (m * scale + z);
    }
    [[nodiscard]] RAYDIX_HD static EdgesD accurate(const ShearedVertexD& a, const ShearedVertexD& b,
                                                   const ShearedVertexD& c) {
        const auto edge = [](const ShearedVertexD& p, const ShearedVertexD& q) {
            return accurate_product_difference(p.x, q.y, p.y, q.x);
        };
        return {edge(c, b), edge(a, c), edge(b, a)};
    }
};

/// True if the ray hits within [ray.tmin, tmax]. u weighs v1, v weighs v2.
/// One step beyond the paper, so that culling cannot change which hit is closest. In float t is
/// held within the triangle's own box: a traversal's entry into any box around the triangle is then
/// never greater than t (rounding is monotone). In double the point of the triangle at t is within
/// the pads of the ray, so that this holds for boxes around parts too.
/// Corners: LeafTriangle or LeafTriangleD.
template <EdgeRule rule, class Scalar, class Corners>
RAYDIX_HD bool intersect_triangle(const BasicRayFrame<Scalar>& ray, const Corners& triangle,
                                  std::type_identity_t<Scalar> tmax,
                                  BasicTriangleHit<Scalar>& hit) {
    const BasicShearedVertex<Scalar> a = shear(ray, triangle.v0), b = shear(ray, triangle.v1),
                                     c = shear(ray, triangle.v2);
    Scalar u = edge_function(c, b), v = edge_function(a, c), w = edge_function(b, a);
    if ((u < 0 || v < 0 || w < 0) && (u > 0 || v > 0 || w > 0)) return false;
    if (u == 0 || v == 0 || w == 0) {
        // A zero may be lost precision: the ray passes near an edge. Once more, exactly.
        // Signs before the conversion: what is too small for a float would lose its own.
        const double du = exact_edge_function(c, b), dv = exact_edge_function(a, c),
                     dw = exact_edge_function(b, a);
        if ((du < 0 || dv < 0 || dw < 0) && (du > 0 || dv > 0 || dw > 0)) return false;
        u = static_cast<Scalar>(du);
        v = static_cast<Scalar>(dv);
        w = static_cast<Scalar>(dw);
        if constexpr (rule == EdgeRule::half_open) {
            const int su = perturbed_edge_sign(c, b), sv = perturbed_edge_sign(a, c),
                      sw = perturbed_edge_sign(b, a);
            if (su != sv || sv != sw) return false;
        }
    }
    if constexpr (sizeof(Scalar) == 8) {
        const EdgesD rounded{u, v, w};
        if (rounded.may_stray(a, b, c, ray.shear_z))
            if (const EdgesD edges = EdgesD::accurate(a, b, c); edges.sum() != 0)
                u = edges.u, v = edges.v, w = edges.w;
    }
    const Scalar determinant = (u + v) + w;
    // Not finite: the ray starts so far away that the edge functions overflow.
    if (!(determinant != 0 && std::fabs(determinant) < infinity)) return false;
    Scalar t = ((u * a.z + v * b.z) + w * c.z) / determinant;
    if constexpr (sizeof(Scalar) == 8) {
        // Within its corners, along the ray's longest axis: a slower one could move t much farther
        // than rounding did.
        t = max_of(t, min_of(min_of(a.z, b.z), c.z));
        t = min_of(t, max_of(max_of(a.z, b.z), c.z));
    } else {
        const BoxInterval<Scalar> own = own_box_interval(ray, triangle);
        if (own.entry <= own.exit) t = min_of(max_of(t, own.entry), own.exit);
    }
    if (!(t >= ray.tmin && t <= tmax)) return false;
    if (has_zero_area(triangle)) return false;
    hit = {t, v / determinant, w / determinant};
    return true;
}

}  // namespace raydix
