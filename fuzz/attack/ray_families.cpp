// Hard rays: a mesh and random numbers -> rays.
#include "attack/ray_families.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "attack/meshes.h"
#include "attack/vectors.h"

namespace raydix::attack {
namespace {

constexpr float not_a_number = std::numeric_limits<float>::quiet_NaN();

/// Picks places relative to a mesh.
class Places {
public:
    Places(Random& random, const Mesh& mesh, const Aabb& bounds)
        : random_(random), mesh_(mesh), bounds_(bounds), size_(bounds.hi - bounds.lo) {
        longest_ = std::max({size_.x, size_.y, size_.z, 1e-6f});
        center_ = bounds.lo * 0.5f + bounds.hi * 0.5f;
    }

    float longest() const { return longest_; }
    Vec3 inside() {
        return {bounds_.lo.x + size_.x * float(random_.unit()),
                bounds_.lo.y + size_.y * float(random_.unit()),
                bounds_.lo.z + size_.z * float(random_.unit())};
    }
    Vec3 corner() {
        return mesh_.vertices.empty() ? center_
                                      : mesh_.vertices[random_.below(mesh_.vertices.size())];
    }
    /// A corner, the middle of an edge, or a place within a triangle.
    Vec3 on_surface() {
        if (mesh_.triangles.empty()) return center_;
        const Triangle& t = mesh_.triangles[random_.below(mesh_.triangles.size())];
        const Vec3 a = mesh_.vertices[t[0]], b = mesh_.vertices[t[1]], c = mesh_.vertices[t[2]];
        switch (random_.below(4)) {
            case 0:
                return a;
            case 1:
                return (a + b) * 0.5f;
            case 2:
                return (b + c) * 0.5f;
            default: {
                const auto u = static_cast<float>(random_.unit());
                const float v = (1 - u) * static_cast<float>(random_.unit());
                return (a * (1 - u - v) + b * u) + c * v;
            }
        }
    }
    Vec3 around(float reach) { return center_ + random_.cube() * (longest_ * reach); }
    /// Coordinates of three corners, one of them outside of the box: what axis-aligned rays need.
    Vec3 aligned() {
        Vec3 place{corner().x, corner().y, corner().z};
        const std::uint32_t axis = random_.below(3);
        at(place, axis) =
            random_.chance(0.5) ? at(bounds_.lo, axis) - longest_ : at(bounds_.hi, axis) + longest_;
        return place;
    }
    Vec3 lattice() { return center_ + random_.whole_point(1) * longest_; }

private:
    Random& random_;
    const Mesh& mesh_;
    Aabb bounds_;
    Vec3 size_, center_;
    float longest_;
};

Vec3 make_origin(Random& random, Places& places) {
    switch (random.below(7)) {
        case 0:
            return places.inside();
        case 1:
            return places.around(2);
        case 2:
            return places.corner();
        case 3:
            return places.on_surface();
        case 4:
            return places.aligned();
        case 5:
            return places.around(random.power_of_ten(0, 6));
        default:
            return places.lattice();
    }
}

Vec3 along_axis(Random& random) {
    Vec3 d{0, 0, 0};
    at(d, random.below(3)) = random.chance(0.5) ? 1.0f : -1.0f;
    if (random.chance(0.3)) at(d, random.below(3)) = -0.0f;
    return d;
}

Vec3 make_direction(Random& random, Places& places, Vec3 origin) {
    switch (random.below(8)) {
        case 0:
            return random.cube();
        case 1:
            return along_axis(random);
        case 2:
        case 3:
            return places.on_surface() - origin;
        case 4:
            return places.corner() - origin;
        case 5:  // within the plane of two corners, often of a triangle
            return places.corner() - places.corner();
        case 6:
            return random.whole_point(2);
        default: {
            const Vec3 d = random.cube();
            return {d.x * random.power_of_ten(-7, 0), d.y * random.power_of_ten(-7, 0),
                    d.z * random.power_of_ten(-7, 0)};
        }
    }
}

void spoil(Random& random, Ray& ray) {
    constexpr float bad[] = {not_a_number, infinity, -infinity, 0.0f, 3.4e38f};
    const float value = random.one_of(bad);
    switch (random.below(4)) {
        case 0:
            at(ray.origin, random.below(3)) = value;
            break;
        case 1:
            at(ray.direction, random.below(3)) = value;
            break;
        case 2:
            ray.tmin = value;
            break;
        default:
            ray.tmax = value;
    }
}

Ray make_ray(Random& random, Places& places) {
    Ray ray;
    ray.origin = make_origin(random, places);
    ray.direction = make_direction(random, places, ray.origin);
    if (random.chance(0.1))
        ray.direction = ray.direction * (random.chance(0.5) ? random.power_of_ten(-30, 30)
                                                            : random.power_of_ten(-44, 38));
    if (random.chance(0.03)) at(ray.direction, random.below(3)) = 0;
    if (random.chance(0.03)) at(ray.direction, random.below(3)) *= 1e-38f;
    if (random.chance(0.02)) at(ray.origin, random.below(3)) *= random.power_of_ten(-44, -20);
    if (random.chance(0.15))
        ray.tmin = random.chance(0.3) ? -1.0f : static_cast<float>(random.unit());
    if (random.chance(0.15)) ray.tmax = 3 * static_cast<float>(random.unit());
    if (random.chance(0.02)) ray.tmax = ray.tmin;
    if (random.chance(0.01)) ray.tmin = infinity;
    if (random.chance(0.02)) spoil(random, ray);
    return ray;
}

/// From up to the largest float away, along an axis or nearly so; or from beside a place of the
/// mesh, with a direction near the least float.
Ray make_extreme_ray(Random& random, Places& places) {
    Ray ray;
    ray.origin = random.chance(0.5) ? places.on_surface() : places.inside();
    const std::uint32_t axis = random.below(3);
    const float side = random.chance(0.5) ? 1.0f : -1.0f;
    if (random.chance(0.3)) {
        if (random.chance(0.5)) at(ray.origin, axis) *= random.power_of_ten(-44, -20);
        ray.direction = random.cube() * random.power_of_ten(-44, -36);
        return ray;
    }
    at(ray.origin, axis) =
        random.chance(0.3) ? side * 3.4e38f : side * random.power_of_ten(15, 38.5);
    const float along = random.chance(0.3) ? 1.0f : random.power_of_ten(-44, 38);
    if (random.chance(0.5))
        ray.direction = random.cube() * (along * random.power_of_ten(-45, -25));
    else
        ray.direction = {0, 0, 0};
    at(ray.direction, axis) = -side * along;
    if (random.chance(0.2)) ray.tmin = random.power_of_ten(-44, 38);
    if (random.chance(0.2)) ray.tmax = random.power_of_ten(-44, 38);
    return ray;
}

}  // namespace

std::vector<Ray> make_extreme_rays(Random& random, const Mesh& mesh, std::size_t count) {
    Places places(random, mesh, finite_bounds(mesh));
    std::vector<Ray> rays(count);
    for (Ray& ray : rays) ray = make_extreme_ray(random, places);
    return rays;
}

std::vector<Ray> make_rays(Random& random, const Mesh& mesh, std::size_t count) {
    Places places(random, mesh, finite_bounds(mesh));
    std::vector<Ray> rays(count);
    for (Ray& ray : rays) ray = make_ray(random, places);
    return rays;
}

std::vector<Ray> tightened(Random& random, std::span<const Ray> rays, std::span<const Hit> hits,
                           std::size_t most) {
    std::vector<Ray> made;
    for (std::size_t i = 0; i < rays.size() && made.size() < most; ++i) {
        if (!hits[i].hit()) continue;
        Ray ray = rays[i];
        const float t = hits[i].t;
        switch (random.below(5)) {
            case 0:
                ray.tmin = t;
                break;
            case 1:
                ray.tmin = ray.tmax = t;
                break;
            case 2:
                ray.tmax = std::nextafter(t, random.chance(0.5) ? infinity : 0.0f);
                break;
            case 3:
                ray.tmin = std::nextafter(t, random.chance(0.5) ? infinity : 0.0f);
                break;
            default:
                ray.tmax = t;
        }
        made.push_back(ray);
    }
    return made;
}

Vec3 make_point(Random& random, const Mesh& mesh, const Aabb& bounds) {
    Places places(random, mesh, bounds);
    Vec3 p = make_origin(random, places);
    if (random.chance(0.01)) at(p, random.below(3)) = random.chance(0.5) ? not_a_number : infinity;
    return p;
}

RayD to_double(const Ray& ray) {
    return {wide(ray.origin), ray.tmin, wide(ray.direction), ray.tmax};
}

}  // namespace raydix::attack
