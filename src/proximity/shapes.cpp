// Spheres, capsules and points with a radius: their boxes, and where rays meet their surfaces.
#include <raydix/user_geometry.h>

#include "proximity/sweep_walk.h"
#include "tree/outward_box.h"

namespace raydix {
namespace {

bool is_radius(float r) { return r >= 0.0f && r < infinity; }

/// Around balls of one radius; NaN for shapes that are none, so that builders leave them out.
Aabb grown(const Aabb& box, float radius) {
    constexpr float nan = std::numeric_limits<float>::quiet_NaN();
    if (!is_finite(box.lo) || !is_finite(box.hi) || !is_radius(radius))
        return {{nan, nan, nan}, {nan, nan, nan}};
    const double r = radius;
    return {{round_down(box.lo.x - r), round_down(box.lo.y - r), round_down(box.lo.z - r)},
            {round_up(box.hi.x + r), round_up(box.hi.y + r), round_up(box.hi.z + r)}};
}

/// The first end of the line's stay within the ray's limits.
bool surface_hit(const Ray& ray, const Stay& stay, Hit& hit) {
    if (!(stay.enter <= stay.leave)) return false;
    // As floats: what rounds to the end of the ray is a hit, or ties would be lost.
    const auto enter = static_cast<float>(stay.enter), leave = static_cast<float>(stay.leave);
    hit.t = enter >= ray.tmin ? enter : leave;
    return hit.t >= ray.tmin && hit.t <= ray.tmax;
}

bool hit_ball(Vec3 center, float radius, const Ray& ray, Hit& hit) {
    return surface_hit(ray, stay_in_ball(path_of(ray), Double3(center), radius), hit);
}

Stay unite(const Stay& a, const Stay& b) {
    if (!(a.enter <= a.leave)) return b;
    if (!(b.enter <= b.leave)) return a;
    return {std::min(a.enter, b.enter), std::max(a.leave, b.leave)};
}

/// Two balls and the cylinder between them: together convex, so the stay is one interval.
bool hit_capsule(const Capsule& capsule, const Ray& ray, Hit& hit) {
    const Path path = path_of(ray);
    const Double3 a(capsule.a), b(capsule.b);
    const double r = capsule.radius;
    const Stay stay = unite(unite(stay_in_ball(path, a, r), stay_in_ball(path, b, r)),
                            stay_in_cylinder(path, a, b, r));
    if (!surface_hit(ray, stay, hit)) return false;
    const Double3 axis = b - a;
    const double length2 = dot(axis, axis);
    const double along = length2 > 0.0 ? dot(path.at(hit.t) - a, axis) / length2 : 0.0;
    hit.u = static_cast<float>(std::clamp(along, 0.0, 1.0));
    return true;
}

}  // namespace

std::vector<Aabb> boxes_of(std::span<const Sphere> spheres) {
    std::vector<Aabb> boxes(spheres.size());
    for (std::size_t i = 0; i < boxes.size(); ++i)
        boxes[i] = grown({spheres[i].center, spheres[i].center}, spheres[i].radius);
    return boxes;
}

std::vector<Aabb> boxes_of(std::span<const Capsule> capsules) {
    std::vector<Aabb> boxes(capsules.size());
    for (std::size_t i = 0; i < boxes.size(); ++i) {
        const Capsule& c = capsules[i];
        const bool finite = is_finite(c.a) && is_finite(c.b);  // a minimum may lose a NaN
        boxes[i] = grown({min_of(c.a, c.b), max_of(c.a, c.b)}, finite ? c.radius : -1.0f);
    }
    return boxes;
}

std::vector<Aabb> boxes_of(std::span<const Vec3> points, float radius) {
    std::vector<Aabb> boxes(points.size());
    for (std::size_t i = 0; i < boxes.size(); ++i) boxes[i] = grown({points[i], points[i]}, radius);
    return boxes;
}

IntersectPrimitive intersect_spheres(std::span<const Sphere> spheres) {
    return [spheres](std::uint32_t prim, const Ray& ray, Hit& hit) {
        return hit_ball(spheres[prim].center, spheres[prim].radius, ray, hit);
    };
}

IntersectPrimitive intersect_capsules(std::span<const Capsule> capsules) {
    return [capsules](std::uint32_t prim, const Ray& ray, Hit& hit) {
        return hit_capsule(capsules[prim], ray, hit);
    };
}

IntersectPrimitive intersect_points(std::span<const Vec3> points, float radius) {
    return [points, radius](std::uint32_t prim, const Ray& ray, Hit& hit) {
        return hit_ball(points[prim], radius, ray, hit);
    };
}

}  // namespace raydix
