// The watertight ray-triangle test (Woop, Benthin, Wald 2013) as a pure function of ray and
// triangle, with the two edge rules of contract.md 3. Every kernel, builder and brute force calls
// this one function, in float or in double.
#pragma once

#include <raydix/bvh.h>
#include <raydix/types.h>

#include <cmath>
#include <cstdint>
#include <cstring>

#include "base/double3.h"
#include "base/exact_product.h"
#include "base/hd.h"
#include "base/math.h"
#include "primitives/zero_area.h"
#include "trace/ray_frame.h"

// Never a call: vectors of doubles would go through memory.
#if defined(__CUDACC__) || defined(__HIP__)
#define RAYDIX_WEIGHTS __host__ __device__ __forceinline__
#else
#define RAYDIX_WEIGHTS [[gnu::always_inline]] inline
#endif

namespace raydix {

#include "trace/corner_weights.h"

enum class EdgeRule {
    closed,    // an edge belongs to both triangles: closest and any hit
    half_open  // to exactly one of them: all hits and counts
};

template <class Scalar>
struct BasicTriangleHit {
    Scalar t, u, v;  // t in the units of the frame
};
using TriangleHit = BasicTriangleHit<float>;

/// A vertex in the ray's sheared plane, where the ray is the origin, and its distance along the
/// ray's longest axis.
template <class Scalar>
struct BasicShearedVertex {
    Scalar x, y, z;
};
using ShearedVertex = BasicShearedVertex<float>;
using ShearedVertexD = BasicShearedVertex<double>;

template <class Scalar>
RAYDIX_HD inline BasicShearedVertex<Scalar> shear(const BasicTriangleRay<Scalar>& ray,
                                                  BasicVec3<Scalar> vertex) {
    const BasicVec3<Scalar> v = vertex - ray.origin;
    const Scalar z = component(v, ray.kz);
    return {component(v, ray.kx) - ray.shear_x * z, component(v, ray.ky) - ray.shear_y * z, z};
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

/// The edge functions of a hit in double. Cancellation may leave nothing of their ratios, and t
/// would then be that of any place of the triangle: `accurate` has them once more.
struct EdgesD {
    double u, v, w;

    [[nodiscard]] RAYDIX_HD double sum() const { return (u + v) + w; }

    /// Whether the weighed corners, which should meet the ray, may miss it by more than 16
    /// roundings of (their distance beside it + along it): each function is off by at most two
    /// roundings of the largest product.
    [[nodiscard]] RAYDIX_HD bool may_stray(const ShearedVertexD& a, const ShearedVertexD& b,
                                           const ShearedVertexD& c, double per_depth) const {
        const auto beside = [](const ShearedVertexD& p) {
            return max_of(std::fabs(p.x), std::fabs(p.y));
        };
        const double m = max_of(max_of(beside(a), beside(b)), beside(c));
        const double z = max_of(max_of(std::fabs(a.z), std::fabs(b.z)), std::fabs(c.z));
        const double scale = std::fabs(per_depth);  // z is in units of the ray's t
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

/// Whether the ray passes the triangle a, b, c on the inside of all edges, or on one of them as the
/// rule has it. u, v and w become the edge functions opposite a, b and c, once more and exactly
/// where rounding left one without a sign.
template <EdgeRule rule, class Scalar>
RAYDIX_HD inline bool passes_inside(const BasicShearedVertex<Scalar>& a,
                                    const BasicShearedVertex<Scalar>& b,
                                    const BasicShearedVertex<Scalar>& c, Scalar& u, Scalar& v,
                                    Scalar& w) {
    u = edge_function(c, b), v = edge_function(a, c), w = edge_function(b, a);
    if ((u < 0 || v < 0 || w < 0) && (u > 0 || v > 0 || w > 0)) return false;
    if (std::fabs(u) > 0 && std::fabs(v) > 0 && std::fabs(w) > 0) return true;
    // 0 may be lost precision, NaN is the difference of two products that overflow. Signs before
    // the conversion: what is too small for a float would lose its own.
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
    return true;
}

/// The upper 26 of a double's 53 digits.
inline constexpr std::uint64_t narrow_digits = ~((std::uint64_t{1} << 27) - 1);
RAYDIX_HD inline double narrowed(double x) {
    std::uint64_t bits;
    std::memcpy(&bits, &x, sizeof(bits));
    bits &= narrow_digits;
    std::memcpy(&x, &bits, sizeof(x));
    return x;
}

/// Corners as a ray sees them, in double, and its direction; axes in the order kx, ky, kz.
struct SeenTriangle {
    double corner[3][3], direction[3];

    /// The largest distance of a corner along kz.
    [[nodiscard]] RAYDIX_HD double farthest() const {
        return max_of(max_of(std::fabs(corner[0][2]), std::fabs(corner[1][2])),
                      std::fabs(corner[2][2]));
    }
};
RAYDIX_HD inline SeenTriangle seen_by(const TriangleRay& ray, const LeafTriangle& triangle) {
    const int axis[3] = {ray.kx, ray.ky, ray.kz};
    SeenTriangle out;
    for (int k = 0; k < 3; ++k) {
        const double origin = component(ray.origin, axis[k]);
        out.direction[k] = component(ray.direction, axis[k]);
        out.corner[0][k] = component(triangle.v0, axis[k]) - origin;
        out.corner[1][k] = component(triangle.v1, axis[k]) - origin;
        out.corner[2][k] = component(triangle.v2, axis[k]) - origin;
    }
    return out;
}

/// Products of what narrowed() leaves are exact, so that edge functions are, but for one rounding.
RAYDIX_HD inline CornerWeights<double> weigh_corners(const SeenTriangle& seen) {
    return weigh_corners(
        seen.corner, seen.direction, 1.0, [](double x) { return narrowed(x); },
        [](double a, double b, double c, double d) { return a * b - c * d; });
}
/// With all digits: products with what rounding took from them. None underflows, since all come
/// from floats.
RAYDIX_RARE CornerWeights<double> weigh_corners_closely(const SeenTriangle& seen) {
    return weigh_corners(
        seen.corner, seen.direction, 1.0, [](double x) { return x; },
        [](double a, double b, double c, double d) {
            const double ab = a * b, cd = c * d;
            return (ab - cd) + (std::fma(a, b, -ab) - std::fma(c, d, -cd));
        });
}

/// The digits that narrowed() drops show in t where a ray starts next to a triangle and a corner
/// lies so many times farther off along the ray's longest axis.
inline constexpr double far_corner = 64;
/// Nearer than tmin by this part of the way to that corner: no digit will help.
inline constexpr double far_corner_slack = 0x1p-20;
RAYDIX_HD inline bool has_far_corner(double farthest, double depth, double first) {
    return farthest > std::fabs(depth) * far_corner && depth + farthest * far_corner_slack >= first;
}

/// -0 becomes +0.
RAYDIX_HD inline TriangleHit rounded_hit(double t, double u, double v) {
    return {static_cast<float>(t) + 0.0f, static_cast<float>(u) + 0.0f,
            static_cast<float>(v) + 0.0f};
}

/// For rays that pass within rounding of an edge on its outside; `at` is where, in double. The
/// point is moved into the triangle where it is beside it by at most 2^-23 of the way to v0 along
/// the ray's longest axis, and no weight is below -1/4. Else t, u and v are those of the sheared
/// corners as the test in float had them, whose edge functions are exact.
RAYDIX_RARE bool hit_near_edge(const TriangleRay& ray, const LeafTriangle& triangle,
                               const CornerWeights<double>& at, TriangleHit& hit) {
    const auto between = [](Vec3 a, Vec3 b) {
        const Double3 d = Double3(b) - Double3(a);
        return (std::fabs(d.x) + std::fabs(d.y)) + std::fabs(d.z);
    };
    const double extent = between(triangle.v0, triangle.v1) + between(triangle.v0, triangle.v2);
    const double way = double(component(triangle.v0, ray.kz)) - component(ray.origin, ray.kz);
    const double room = min_of(0x1p-23 * std::fabs(way) / extent, 0.25);
    if (at.u >= -room && at.v >= -room && at.w >= -room) {
        const double u = max_of(at.u, 0.0), v = max_of(at.v, 0.0), sum = max_of(u + v, 1.0);
        hit = rounded_hit(at.t, u / sum, v / sum);
        return true;
    }
    const ShearedVertex a = shear(ray, triangle.v0), b = shear(ray, triangle.v1),
                        c = shear(ray, triangle.v2);
    const double u = exact_edge_function(c, b), v = exact_edge_function(a, c),
                 w = exact_edge_function(b, a), sum = (u + v) + w;
    // Not finite: the ray starts so far away that the corners overflow.
    if (!(sum != 0.0 && std::fabs(sum) < double(infinity))) return false;
    const double depth = (u * a.z + v * b.z) + w * c.z;
    hit = rounded_hit(depth / (sum * component(ray.direction, ray.kz)), v / sum, w / sum);
    return true;
}

/// The second half of intersect_triangle in float, for rays that pass inside.
RAYDIX_HD inline bool finish_hit(const TriangleRay& ray, const LeafTriangle& triangle, float tmax,
                                 TriangleHit& hit) {
    const SeenTriangle seen = seen_by(ray, triangle);
    const double way = std::fabs(seen.direction[2]);
    CornerWeights<double> at = weigh_corners(seen);
    if (has_far_corner(seen.farthest(), at.t * way, ray.tmin * way))
        at = weigh_corners_closely(seen);
    hit = rounded_hit(at.t, at.u, at.v);
    // NaN where all corners fall together.
    const bool inside = at.u >= 0.0 && at.v >= 0.0 && at.w >= 0.0;
    if (!inside && !hit_near_edge(ray, triangle, at, hit)) return false;
    return hit.t >= ray.tmin && hit.t <= tmax && !has_zero_area(triangle);
}

/// True if the ray hits within [ray.tmin, tmax]. u weighs v1, v weighs v2. The point of the ray at
/// t is within a few roundings of a point of the triangle, whatever its shape: no box around that
/// point can be missed (slab.h).
template <EdgeRule rule>
RAYDIX_HD inline bool intersect_triangle(const TriangleRay& ray, const LeafTriangle& triangle,
                                         float tmax, TriangleHit& hit) {
    float u, v, w;
    return passes_inside<rule>(shear(ray, triangle.v0), shear(ray, triangle.v1),
                               shear(ray, triangle.v2), u, v, w) &&
           finish_hit(ray, triangle, tmax, hit);
}

/// In double, too, the point of the triangle at t is within the pads of the ray. Corners:
/// LeafTriangleD.
template <EdgeRule rule, class Corners>
RAYDIX_HD bool intersect_triangle(const TriangleRayD& ray, const Corners& triangle, double tmax,
                                  BasicTriangleHit<double>& hit) {
    ShearedVertexD a = shear(ray, triangle.v0), b = shear(ray, triangle.v1),
                   c = shear(ray, triangle.v2);
    double u, v, w;
    if (!passes_inside<rule>(a, b, c, u, v, w)) return false;
    const double per_depth = 1.0 / component(ray.direction, ray.kz);
    a.z *= per_depth, b.z *= per_depth, c.z *= per_depth;
    const EdgesD rounded{u, v, w};
    if (rounded.may_stray(a, b, c, per_depth))
        if (const EdgesD edges = EdgesD::accurate(a, b, c); edges.sum() != 0)
            u = edges.u, v = edges.v, w = edges.w;
    const double determinant = (u + v) + w;
    // Not finite: the ray starts so far away that the edge functions overflow.
    if (!(determinant != 0 && std::fabs(determinant) < double(infinity))) return false;
    double t = ((u * a.z + v * b.z) + w * c.z) / determinant;
    // Within its corners, along the ray's longest axis: a slower one could move t much farther than
    // rounding did.
    t = max_of(t, min_of(min_of(a.z, b.z), c.z));
    t = min_of(t, max_of(max_of(a.z, b.z), c.z));
    if (!(t >= ray.tmin && t <= tmax)) return false;
    if (has_zero_area(triangle)) return false;
    hit = {t + 0.0, v / determinant, w / determinant};
    return true;
}

}  // namespace raydix
