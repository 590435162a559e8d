// Triangles as affine maps to the unit triangle (Woop 2004, as Aila and Laine 2009 use them):
// corners [references] -> maps [references], 48 bytes each.
#pragma once

#include <raydix/bvh.h>

#include <cmath>
#include <cstdint>

#include "base/double3.h"
#include "base/hd.h"

namespace raydix {

/// Rows of the map that takes v0, v1, v2 to (0, 0, 0), (1, 0, 0), (0, 1, 0). The z row comes first,
/// so that t is known, and may reject, before u and v are computed; its fourth value has the sign
/// turned: t = (z[3] - z . origin) / (z . direction), u = x[3] + x . point, v = y[3] + y . point.
/// Not watertight: neighbours round their common edge apart.
struct alignas(16) WoopTriangle {
    float z[4], x[4], y[4];
};
static_assert(sizeof(WoopTriangle) == 48);

/// All zero, which no ray hits, for triangles without area and those whose map float32 cannot hold.
RAYDIX_HD inline WoopTriangle make_woop_triangle(const LeafTriangle& corners) {
    const Double3 v0(corners.v0);
    const Double3 e1 = Double3(corners.v1) - v0, e2 = Double3(corners.v2) - v0;
    const Double3 n = cross(e1, e2);
    const double square = dot(n, n);
    WoopTriangle out{};
    if (!(square > 0)) return out;
    const double inverse = 1.0 / square, unit = 1.0 / std::sqrt(square);
    const Double3 z = n * unit, x = cross(e2, n) * inverse, y = cross(n, e1) * inverse;
    const auto row = [](float* to, Double3 a, double last) {
        to[0] = static_cast<float>(a.x), to[1] = static_cast<float>(a.y);
        to[2] = static_cast<float>(a.z), to[3] = static_cast<float>(last);
        float sum = 0.0f;  // 0, or NaN if a value is not finite
        for (int k = 0; k < 4; ++k) sum += to[k] * 0.0f;
        return sum == 0.0f;
    };
    const bool z_fits = row(out.z, z, dot(z, v0)), x_fits = row(out.x, x, -dot(x, v0)),
               y_fits = row(out.y, y, -dot(y, v0));
    if (!(z_fits && x_fits && y_fits)) return WoopTriangle{};
    return out;
}

/// Map of the triangle at position i of the leaf order.
struct EmitWoopTriangle {
    const LeafTriangle* corners;  // [references]
    WoopTriangle* maps;           // [references], out
    RAYDIX_HD void operator()(std::uint32_t i) const { maps[i] = make_woop_triangle(corners[i]); }
};

}  // namespace raydix
