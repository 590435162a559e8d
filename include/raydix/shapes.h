// Shapes that are not triangles: what queries ask with, and what rays can hit in a Scene.
#pragma once

#include <raydix/types.h>

namespace raydix {

/// Closed; a and b may be one point. Invalid unless both are finite.
struct Segment {
    Vec3 a, b;
};

/// Closed ball; radius 0 is a point. Invalid if anything is not finite or the radius is negative.
struct Sphere {
    Vec3 center;
    float radius;
};

/// All points within `radius` of the segment a, b. Invalid as a sphere is.
struct Capsule {
    Vec3 a, b;
    float radius;
};

}  // namespace raydix
