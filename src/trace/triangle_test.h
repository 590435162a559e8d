// The watertight ray-triangle test (Woop, Benthin, Wald 2013) as a pure function of ray and
// triangle, with the two edge rules of contract.md 3. Every kernel, builder and brute force calls
// this one function.
#pragma once

#include <raydix/bvh.h>
#include <raydix/types.h>

#include <cmath>

#include "base/hd.h"
#include "base/math.h"
#include "primitives/zero_area.h"
#include "trace/ray_frame.h"

namespace raydix {

enum class EdgeRule {
    closed,    // an edge belongs to both triangles: closest and any hit
    half_open  // to exactly one of them: all hits and counts
};

struct TriangleHit {
    float t, u, v;  // t in the units of the frame
};

/// A vertex in the ray's sheared plane: the ray is the origin there.
struct ShearedVertex {
    float x, y, z;
};

RAYDIX_HD inline ShearedVertex shear(const RayFrame& ray, Vec3 vertex) {
    const Vec3 v = vertex - ray.origin;
    const float z = component(v, ray.kz);
    return {component(v, ray.kx) - ray.shear_x * z, component(v, ray.ky) - ray.shear_y * z,
            ray.shear_z * z};
}

/// Twice the signed area of (ray, a, b): which side of the edge the ray passes. edge(a, b) ==
/// -edge(b, a) bit for bit, and the sign is exact wherever the value is not 0, since rounding is
/// monotone.
RAYDIX_HD inline float edge_function(const ShearedVertex& a, const ShearedVertex& b) {
    return a.x * b.y - a.y * b.x;
}

/// Products of two floats are exact in double, so this sign is exact always.
RAYDIX_HD inline double exact_edge_function(const ShearedVertex& a, const ShearedVertex& b) {
    return double(a.x) * double(b.y) - double(a.y) * double(b.x);
}

/// Sign of the edge function with the ray moved by an infinitesimal step along x and a smaller one
/// along y, so that it lies on no edge: the top-left rule. 0 only if a and b coincide in the plane.
RAYDIX_HD inline int perturbed_edge_sign(const ShearedVertex& a, const ShearedVertex& b) {
    const double e = exact_edge_function(a, b);
    if (e != 0.0) return e > 0.0 ? 1 : -1;
    if (a.y != b.y) return a.y > b.y ? 1 : -1;
    if (a.x != b.x) return b.x > a.x ? 1 : -1;
    return 0;
}

/// t of the slab planes of the triangle's own box; the same arithmetic as the traversal's, without
/// its pads.
struct BoxInterval {
    float entry, exit;
};

RAYDIX_HD inline BoxInterval own_box_interval(const RayFrame& ray, const LeafTriangle& triangle) {
    const Aabb box = box_of(triangle.v0, triangle.v1, triangle.v2);
    BoxInterval interval{-infinity, infinity};
    const auto axis = [&](float lo, float hi, float origin, float inverse) {
        const bool negative = std::signbit(inverse);
        const float near = ((negative ? hi : lo) - origin) * inverse,
                    far = ((negative ? lo : hi) - origin) * inverse;
        interval.entry = max_of(near, interval.entry);
        interval.exit = min_of(far, interval.exit);
    };
    axis(box.lo.x, box.hi.x, ray.origin.x, ray.inverse.x);
    axis(box.lo.y, box.hi.y, ray.origin.y, ray.inverse.y);
    axis(box.lo.z, box.hi.z, ray.origin.z, ray.inverse.z);
    return interval;
}

/// True if the ray hits within [ray.tmin, tmax]. u weighs v1, v weighs v2.
/// One step beyond the paper: t is held within the triangle's own box. A traversal's entry into any
/// box around the triangle is then never greater than t (rounding is monotone), so culling cannot
/// change which hit is closest.
template <EdgeRule rule>
RAYDIX_HD bool intersect_triangle(const RayFrame& ray, const LeafTriangle& triangle, float tmax,
                                  TriangleHit& hit) {
    const ShearedVertex a = shear(ray, triangle.v0), b = shear(ray, triangle.v1),
                        c = shear(ray, triangle.v2);
    float u = edge_function(c, b), v = edge_function(a, c), w = edge_function(b, a);
    if ((u < 0.0f || v < 0.0f || w < 0.0f) && (u > 0.0f || v > 0.0f || w > 0.0f)) return false;
    if (u == 0.0f || v == 0.0f || w == 0.0f) {
        // A zero may be lost precision: the ray passes near an edge. Once more, exactly.
        // Signs before the conversion: what is too small for a float would lose its own.
        const double du = exact_edge_function(c, b), dv = exact_edge_function(a, c),
                     dw = exact_edge_function(b, a);
        if ((du < 0 || dv < 0 || dw < 0) && (du > 0 || dv > 0 || dw > 0)) return false;
        u = static_cast<float>(du);
        v = static_cast<float>(dv);
        w = static_cast<float>(dw);
        if constexpr (rule == EdgeRule::half_open) {
            const int su = perturbed_edge_sign(c, b), sv = perturbed_edge_sign(a, c),
                      sw = perturbed_edge_sign(b, a);
            if (su != sv || sv != sw) return false;
        }
    }
    const float determinant = (u + v) + w;
    // Not finite: the ray starts so far away that the edge functions overflow.
    if (!(determinant != 0.0f && std::fabs(determinant) < infinity)) return false;
    float t = ((u * a.z + v * b.z) + w * c.z) / determinant;
    const BoxInterval own = own_box_interval(ray, triangle);
    if (own.entry <= own.exit) t = min_of(max_of(t, own.entry), own.exit);
    if (!(t >= ray.tmin && t <= tmax)) return false;
    if (has_zero_area(triangle)) return false;
    hit = {t, v / determinant, w / determinant};
    return true;
}

}  // namespace raydix
