// The names of one query in float and in double, so that one attack serves both.
#pragma once

#include <raydix/closest.h>
#include <raydix/double.h>
#include <raydix/overlap.h>
#include <raydix/solid.h>

#include <string>

#include "attack/attack.h"
#include "attack/ray_families.h"
#include "attack/vectors.h"

namespace raydix::attack {

struct InFloat {
    static constexpr const char* name = "float";
    using Scalar = float;
    using Point = Vec3;
    using AnyMesh = Mesh;
    using Tree = Bvh;
    using Closest = ClosestPoint;
    using Options = ClosestOptions;
    using AnySegment = Segment;
    using AnySphere = Sphere;
    using AnyRay = Ray;
    using Sweep = SphereSweep;
    using Contact = SweepHit;
    using Body = Solid;

    static Mesh mesh(Random&, Mesh made) { return made; }
    static Vec3 point(Random&, Vec3 p) { return p; }
    static Ray ray(const Ray& r) { return r; }
};

struct InDouble {
    static constexpr const char* name = "double";
    using Scalar = double;
    using Point = Vec3d;
    using AnyMesh = MeshD;
    using Tree = BvhD;
    using Closest = ClosestPointD;
    using Options = ClosestOptionsD;
    using AnySegment = SegmentD;
    using AnySphere = SphereD;
    using AnyRay = RayD;
    using Sweep = SphereSweepD;
    using Contact = SweepHitD;
    using Body = SolidD;

    static MeshD mesh(Random& random, const Mesh& made) { return to_double(random, made); }
    static Vec3d point(Random& random, Vec3 p) {
        return wide(p) * (1 + (random.chance(0.5) ? 1e-9 * random.unit() : 0));
    }
    static RayD ray(const Ray& r) { return to_double(r); }
};

/// Around the vertices in range, as floats.
inline Aabb float_bounds(const Mesh& mesh) { return finite_bounds(mesh); }
inline Mesh to_float(const Mesh& mesh) { return mesh; }
inline Mesh to_float(const MeshD& mesh) {
    Mesh made;
    made.triangles = mesh.triangles;
    for (const Vec3d& p : mesh.vertices) made.vertices.push_back(narrow(p));
    return made;
}

/// A mesh in this precision, and places near it.
template <class In>
struct Scenery {
    Scenery(Random& random, TestMesh made)
        : family(made.family), mesh(In::mesh(random, std::move(made.mesh))), near_(to_float(mesh)) {
        bounds = finite_bounds(near_);
    }
    typename In::Point place(Random& random) const {
        return In::point(random, make_point(random, near_, bounds));
    }
    /// Now and then a corner, bit for bit.
    typename In::Point place_or_corner(Random& random) const {
        return random.chance(0.2) && !mesh.vertices.empty()
                   ? mesh.vertices[random.below(mesh.vertices.size())]
                   : place(random);
    }
    std::vector<typename In::AnyRay> rays(Random& random, std::size_t count) const {
        std::vector<typename In::AnyRay> made;
        for (const Ray& ray : make_rays(random, near_, count)) made.push_back(In::ray(ray));
        return made;
    }
    [[nodiscard]] float size() const {
        const Vec3 d = bounds.hi - bounds.lo;
        return std::max({d.x, d.y, d.z, 1e-6f});
    }

    Family family;
    typename In::AnyMesh mesh;
    Aabb bounds;

private:
    Mesh near_;
};

/// Byte equality of what results say, padding apart.
inline bool same(const ClosestPoint& a, const ClosestPoint& b) {
    return std::memcmp(&a, &b, sizeof(a)) == 0;
}
inline bool same_place(Vec3d a, Vec3d b) { return std::memcmp(&a, &b, sizeof(a)) == 0; }
inline bool same(const ClosestPointD& a, const ClosestPointD& b) {
    return same_place(a.position, b.position) && a.distance == b.distance && a.prim == b.prim &&
           a.u == b.u && a.v == b.v;
}
inline bool same(const SweepHit& a, const SweepHit& b) {
    return std::memcmp(&a, &b, sizeof(a)) == 0;
}
inline bool same(const SweepHitD& a, const SweepHitD& b) {
    return a.t == b.t && a.prim == b.prim && same_place(a.position, b.position) && a.u == b.u &&
           a.v == b.v;
}

inline Vec3d as_double(Vec3 p) { return wide(p); }
inline Vec3d as_double(Vec3d p) { return p; }

}  // namespace raydix::attack
