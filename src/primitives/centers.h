// Triangles by the centers of their boxes, which codes are made from: kept by whoever looks at all
// triangles first, so that nobody has to look up their corners again. triangles [n] -> centers [n].
#pragma once

#include <cstdint>
#include <limits>

#include "primitives/host_box.h"

namespace raydix {

/// A source of primitives: points. NaN: invalid, or without area.
struct Centers {
    const Vec3* centers;
};
inline Box3 valid_box(const Centers& source, std::uint32_t i) {
    const Float3 center = Float3::load(source.centers[i]);
    return {center, center};
}
inline bool host_box(const Centers& source, std::uint32_t i, Box3& box) {
    box = valid_box(source, i);
    return source.centers[i].x == source.centers[i].x;
}

/// Of scene_bounds.
struct KeepCenters {
    const TriangleSource& source;
    Vec3* centers;  // [n], out

    [[nodiscard]] bool valid(std::uint32_t i, const Box3& box) const {
        const Float3 center = Float3::all(0.5f) * (box.lo + box.hi);
        center.store(centers[i]);
        const bool flat = host_zero_area(source, i);
        if (flat) left_out(i);
        return flat;
    }
    void left_out(std::uint32_t i) const { centers[i].x = std::numeric_limits<float>::quiet_NaN(); }
};

}  // namespace raydix
