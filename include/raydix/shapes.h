// Shapes that are not triangles: what queries ask with, and what rays can hit in a Scene.
#pragma once

#include <raydix/types.h>

namespace raydix {

/// Closed; a and b may be one point. Invalid unless both are finite. In double an end beyond 1e12
/// is invalid too: signs would overflow.
template <class Scalar>
struct BasicSegment {
    BasicVec3<Scalar> a, b;
};
using Segment = BasicSegment<float>;
using SegmentD = BasicSegment<double>;

/// Closed ball; radius 0 is a point. Invalid if anything is not finite or the radius is negative.
template <class Scalar>
struct BasicSphere {
    BasicVec3<Scalar> center;
    Scalar radius;
};
using Sphere = BasicSphere<float>;
using SphereD = BasicSphere<double>;

/// All points within `radius` of the segment a, b. Invalid as a sphere is.
template <class Scalar>
struct BasicCapsule {
    BasicVec3<Scalar> a, b;
    Scalar radius;
};
using Capsule = BasicCapsule<float>;
using CapsuleD = BasicCapsule<double>;

/// A ball whose center moves along a ray, for t in [tmin, tmax]. Radius 0 is a ray. A sweep is
/// invalid if its ray is, or if its radius is negative or not finite. In double a start or a radius
/// beyond 1e150 is invalid too: its square would overflow.
template <class Scalar>
struct BasicSphereSweep {
    BasicRay<Scalar> path;
    Scalar radius;
};
using SphereSweep = BasicSphereSweep<float>;
using SphereSweepD = BasicSphereSweep<double>;

}  // namespace raydix
