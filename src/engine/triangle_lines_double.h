// What triangles and boxes need of rays in double, in memory.
#pragma once

#include <raydix/types.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "base/math.h"
#include "trace/ray_frame.h"
#include "trace/triangle_test.h"

namespace raydix {

/// What the triangle test reads of a ray, but for its axes. A cache line.
struct alignas(64) TriangleLineD {
    double origin[3];
    double shear[2];
    double way, per_depth;  // the direction along its longest axis, and 1 / way
    double tmin;

    TriangleLineD() = default;
    explicit TriangleLineD(const RayFrameD& ray)
        : origin{ray.origin.x, ray.origin.y, ray.origin.z},
          shear{ray.shear_x, ray.shear_y},
          way(component(ray.direction, ray.kz)),
          per_depth(1.0 / way),
          tmin(ray.tmin) {}

    /// For the test of one triangle: of the direction it reads one component.
    [[nodiscard]] TriangleRayD ray(const RayClass& kind) const {
        return {{origin[0], origin[1], origin[2]},
                {way, way, way},
                static_cast<int>(kind.kx),
                static_cast<int>(kind.ky),
                static_cast<int>(kind.kz),
                shear[0],
                shear[1],
                tmin};
    }
};
static_assert(sizeof(TriangleLineD) == 64);

/// The best hit so far, t in units of the line. u and v are kept as numerators and what both are
/// divided by.
struct BestD {
    double t;
    std::uint32_t prim = no_primitive;
    double u = 0, v = 0, area = 1;

    [[nodiscard]] bool found() const { return prim != no_primitive; }
    /// At equal t the lower primitive wins, whatever order the leaves come in.
    [[nodiscard]] bool is_behind(double other_t, std::uint32_t other) const {
        return other_t < t || (other_t == t && other < prim);
    }
};

/// Distances of a line in double as its float ray through boxes has them: t * rate - start. Boxes
/// see the ray from `start` on, and in units that keep floats near 1.
struct BoxDistances {
    double rate = 1, start = 0;

    static constexpr double most = std::numeric_limits<float>::max();

    /// Not less than t is there; at most the largest float.
    [[nodiscard]] float above(double t) const {
        const double at = (t * rate - start) * (1.0 + 0x1p-22) + 0x1p-140;
        return static_cast<float>(min_of(at, most));
    }
    /// Not more than t is there; at least 0.
    [[nodiscard]] float below(double t) const {
        const double at = (t * rate - start) * (1.0 - 0x1p-22) - 0x1p-140;
        return static_cast<float>(max_of(min_of(at, most), 0.0));
    }
};

}  // namespace raydix
