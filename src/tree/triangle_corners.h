// Corners of the triangles that builders cut into parts: of a mesh in float, or of one in double
// where the nodes of its tree are.
#pragma once

#include <raydix/double.h>
#include <raydix/mesh.h>

#include <array>
#include <cstdint>

#include "tree/clip.h"

namespace raydix {

/// The mesh must outlive it.
class TriangleCorners {
public:
    TriangleCorners(const MeshView& mesh) : mesh_(mesh) {}  // NOLINT: meant to be implicit
    /// Nodes are at (p - center) * scale, scale a power of two.
    TriangleCorners(const MeshViewD& mesh, Vec3d center, double scale)
        : in_double_(true), mesh_d_(mesh), center_(center), scale_(scale) {}

    /// False: the nodes' space is reached by a rounded difference, see `room`.
    [[nodiscard]] bool exact() const { return !in_double_; }

    /// As floats; in double rounded to nearest.
    [[nodiscard]] std::array<Vec3, 3> rounded(std::uint32_t id) const {
        if (in_double_) [[unlikely]]
            return rounded_local(id);
        const Triangle& t = mesh_.triangles[id];
        return {mesh_.vertices[t[0]], mesh_.vertices[t[1]], mesh_.vertices[t[2]]};
    }
    [[nodiscard]] Polygon polygon(std::uint32_t id) const {
        if (in_double_) [[unlikely]]
            return local_polygon(id);
        const Triangle& t = mesh_.triangles[id];
        return polygon_of(mesh_.vertices[t[0]], mesh_.vertices[t[1]], mesh_.vertices[t[2]]);
    }
    /// By how much cuts must reach farther for their boxes to hold the true triangle's parts: 64
    /// roundings of its largest coordinate. One made the corners; each of up to six cuts adds four
    /// along the edge that it cuts. 0 where corners are exact.
    [[nodiscard]] double room(const Polygon& triangle) const {
        return in_double_ ? local_room(triangle) : 0.0;
    }

private:
    [[nodiscard]] Vec3d local(std::uint32_t id, std::size_t k) const;
    [[nodiscard]] std::array<Vec3, 3> rounded_local(std::uint32_t id) const;
    [[nodiscard]] Polygon local_polygon(std::uint32_t id) const;
    [[nodiscard]] static double local_room(const Polygon& triangle);

    bool in_double_ = false;
    MeshView mesh_;
    MeshViewD mesh_d_;
    Vec3d center_{0.0, 0.0, 0.0};
    double scale_ = 1.0;
};

}  // namespace raydix
