// Geometry in whole numbers of any length: doubles become integers on one common scale, and no step
// rounds.
#pragma once

#include <raydix/double.h>

#include <array>

namespace raydix::attack {

using Corners = std::array<Vec3d, 3>;

/// Whether two triangles have a point in common. Segments and points are triangles with equal
/// corners. All coordinates are finite.
bool exact_touch(const Corners& a, const Corners& b);

/// Where a point lies relative to a closed mesh of finite coordinates.
struct ExactPlace {
    bool on_surface = false;
    int winding = 0;         // signed crossings of a ray from the point outward
    unsigned crossings = 0;  // all of them
};
ExactPlace exact_place(const MeshViewD& mesh, Vec3d point);

}  // namespace raydix::attack
