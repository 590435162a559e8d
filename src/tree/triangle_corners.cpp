#include "tree/triangle_corners.h"

#include <algorithm>
#include <cmath>

#include "base/exact_sign_double.h"
#include "base/math.h"

namespace raydix {

double TriangleCorners::local_room(const Polygon& triangle) {
    double most = 0.0;
    for (std::size_t k = 0; k < 3; ++k)
        for (const double x : triangle.corners[k]) most = std::max(most, std::fabs(x));
    return 0x1p-47 * most;
}

Vec3d TriangleCorners::local(std::uint32_t id, std::size_t k) const {
    return scale_ * (without_tiny(mesh_d_.vertices[mesh_d_.triangles[id][k]]) - center_);
}

std::array<Vec3, 3> TriangleCorners::rounded_local(std::uint32_t id) const {
    std::array<Vec3, 3> corners;
    for (std::size_t k = 0; k < 3; ++k) {
        const Vec3d p = local(id, k);
        corners[k] = {static_cast<float>(p.x), static_cast<float>(p.y), static_cast<float>(p.z)};
    }
    return corners;
}

Polygon TriangleCorners::local_polygon(std::uint32_t id) const {
    Polygon polygon;
    for (std::size_t k = 0; k < 3; ++k) {
        const Vec3d p = local(id, k);
        polygon.add({p.x, p.y, p.z});
    }
    return polygon;
}

}  // namespace raydix
