// Affine maps in double: their inverses, and rays through them.
#pragma once

#include <raydix/transform.h>
#include <raydix/types.h>

#include <cmath>
#include <optional>

#include "base/double3.h"
#include "base/math.h"

namespace raydix {

struct Affine {
    Double3 x, y, z;  // rows
    Double3 move;

    [[nodiscard]] Double3 vector(Double3 v) const { return {dot(x, v), dot(y, v), dot(z, v)}; }
    [[nodiscard]] Double3 point(Double3 p) const { return vector(p) + move; }
};

inline Affine affine_of(const Transform& t) {
    const auto row = [&](std::size_t i) { return Double3(t.m[i][0], t.m[i][1], t.m[i][2]); };
    return {row(0), row(1), row(2), {t.m[0][3], t.m[1][3], t.m[2][3]}};
}

/// None if the map flattens: rows that are dependent up to what their float entries can tell, or an
/// inverse that is not finite.
inline std::optional<Affine> inverse_of(const Affine& a) {
    const Double3 yz = cross(a.y, a.z), zx = cross(a.z, a.x), xy = cross(a.x, a.y);
    const double det = dot(a.x, yz);
    // As a part of the box of its rows; exact for what floats hold but for the last bits.
    const double size = length(a.x) * length(a.y) * length(a.z);
    if (!(std::fabs(det) > 0x1p-40 * size) || !std::isfinite(size)) return {};
    const double s = 1.0 / det;
    Affine inverse{Double3(yz.x, zx.x, xy.x) * s,
                   Double3(yz.y, zx.y, xy.y) * s,
                   Double3(yz.z, zx.z, xy.z) * s,
                   {}};
    inverse.move = inverse.vector(a.move) * -1.0;
    if (!is_finite(inverse.x) || !is_finite(inverse.y) || !is_finite(inverse.z) ||
        !is_finite(inverse.move) || !is_finite(a.move))
        return {};
    return inverse;
}

/// A ray in double; t keeps its meaning from space to space.
struct WideRayLine {
    Double3 origin, direction;

    /// `limits`: where tmin and tmax come from.
    [[nodiscard]] Ray rounded(float tmin, float tmax) const {
        return {origin.rounded(), tmin, direction.rounded(), tmax};
    }
    [[nodiscard]] WideRayLine into(const Affine& inverse) const {
        return {inverse.point(origin), inverse.vector(direction)};
    }
};

}  // namespace raydix
