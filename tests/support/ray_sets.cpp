#include "support/ray_sets.h"

#include <raydix/rays.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "base/math.h"

namespace raydix::test {
namespace {

class Maker {
public:
    Maker(const Model& scene, std::uint64_t seed)
        : mesh_(scene.mesh()), box_(inspect(scene.mesh()).bounds), random_(seed) {
        const Vec3 size = box_.hi - box_.lo;
        longest_ = std::max({size.x, size.y, size.z, 1e-12f});
    }

    Ray make(RaySet set) {
        switch (set) {
            case RaySet::at_vertex:
                return at(corner(triangle()));
            case RaySet::at_edge:
                return at_edge();
            case RaySet::axis_aligned:
                return axis_aligned();
            case RaySet::zero_component:
                return zero_component();
            case RaySet::short_tmax:
                return short_tmax();
            case RaySet::tmin_above_zero:
                return tmin_above_zero();
            case RaySet::from_surface:
                return {on_surface(), 0, direction(), infinity};
            case RaySet::any_length:
                return any_length();
            case RaySet::along_edge:
                return along_edge();
            default:
                return at(point());
        }
    }

private:
    float unit() { return static_cast<float>(random_() >> 40) * 0x1p-24f; }
    /// In the box, a little widened.
    Vec3 point() {
        const auto within = [&](float lo, float hi) {
            const float margin = 0.05f * longest_;
            return lo - margin + unit() * (hi - lo + 2 * margin);
        };
        return {within(box_.lo.x, box_.hi.x), within(box_.lo.y, box_.hi.y),
                within(box_.lo.z, box_.hi.z)};
    }
    Vec3 direction() { return {unit() - 0.5f, unit() - 0.5f, unit() - 0.5f}; }
    const Triangle& triangle() { return mesh_.triangles[random_() % mesh_.triangles.size()]; }
    Vec3 corner(const Triangle& t) { return mesh_.vertices[t[random_() % 3]]; }

    Ray at(Vec3 target) {
        const Vec3 origin = point();
        return {origin, 0, target - origin, infinity};
    }
    Ray at_edge() {
        const Triangle& t = triangle();
        const std::size_t k = random_() % 3;
        return at(0.5f * (mesh_.vertices[t[k]] + mesh_.vertices[t[(k + 1) % 3]]));
    }
    Ray axis_aligned() {
        Ray ray{corner(triangle()), 0, {}, infinity};
        const std::size_t axis = random_() % 3;
        const Vec3 start = point();
        (&ray.origin.x)[axis] = component(start, axis);
        for (std::size_t k = 0; k < 3; ++k) (&ray.direction.x)[k] = random_() % 2 ? 0.0f : -0.0f;
        (&ray.direction.x)[axis] = random_() % 2 ? 1.0f : -1.0f;
        return ray;
    }
    Ray zero_component() {
        const Vec3 target = corner(triangle());
        Ray ray = at(target);
        const std::size_t axis = random_() % 3;
        (&ray.origin.x)[axis] = component(target, axis);
        (&ray.direction.x)[axis] = random_() % 2 ? 0.0f : -0.0f;
        return ray;
    }
    Ray short_tmax() {
        Ray ray = at(corner(triangle()));
        ray.tmax = 2.0f * unit();
        return ray;
    }
    Ray tmin_above_zero() {
        Ray ray = at(corner(triangle()));
        ray.tmin = 1.5f * unit();
        return ray;
    }
    Vec3 on_surface() {
        const Triangle& t = triangle();
        float u = unit(), v = unit();
        if (u + v > 1.0f) u = 1.0f - u, v = 1.0f - v;
        return (1.0f - u - v) * mesh_.vertices[t[0]] + u * mesh_.vertices[t[1]] +
               v * mesh_.vertices[t[2]];
    }
    Ray any_length() {
        Ray ray = at(point());
        const auto power = static_cast<float>(static_cast<int>(random_() % 61) - 30);
        ray.direction = ray.direction * (std::pow(10.0f, power) / longest_);
        return ray;
    }
    Ray along_edge() {
        const Triangle& t = triangle();
        const std::size_t k = random_() % 3;
        const Vec3 a = mesh_.vertices[t[k]], b = mesh_.vertices[t[(k + 1) % 3]];
        return {a - (b - a) * static_cast<float>(random_() % 3), 0, b - a, infinity};
    }
    static float component(Vec3 p, std::size_t axis) { return (&p.x)[axis]; }

    const Mesh& mesh_;
    Aabb box_;
    float longest_ = 0;
    std::mt19937_64 random_;
};

std::vector<Ray> camera_rays(const Model& scene, std::size_t count) {
    const auto width = static_cast<std::uint32_t>(
        std::clamp(std::sqrt(1.4 * static_cast<double>(count)), 16.0, 2048.0));
    std::vector<Ray> rays =
        make_primary_rays(scene.cameras.cameras.at(0), width, std::max(width * 3 / 4, 1u));
    rays.resize(std::min(rays.size(), count));
    return rays;
}

}  // namespace

std::string_view name_of(RaySet set) {
    constexpr std::string_view names[] = {
        "camera",     "through box", "at vertex", "at edge",    "axis-aligned", "zero component",
        "short tmax", "tmin > 0",    "surface",   "any length", "along edge"};
    return names[static_cast<std::size_t>(set)];
}

std::vector<Ray> make_rays(const Model& scene, RaySet set, std::size_t count, std::uint64_t seed) {
    if (set == RaySet::camera) return camera_rays(scene, count);
    Maker maker(scene, seed + static_cast<std::uint64_t>(set));
    std::vector<Ray> rays(count);
    for (Ray& ray : rays) ray = maker.make(set);
    return rays;
}

std::vector<Ray> make_mixed_rays(const Model& scene, std::size_t count, std::uint64_t seed) {
    constexpr auto sets = static_cast<std::size_t>(RaySet::count);
    std::vector<Ray> rays;
    for (std::size_t set = sets; set-- > 0;) {
        // Whatever the camera falls short of is made up by the first of the others.
        const std::size_t wanted = set == 0 ? count - rays.size() : count / sets;
        const auto part = make_rays(scene, static_cast<RaySet>(set), wanted, seed);
        rays.insert(rays.end(), part.begin(), part.end());
    }
    const auto rest = make_rays(scene, RaySet::through_box, count - rays.size(), seed + 1000);
    rays.insert(rays.end(), rest.begin(), rest.end());
    return rays;
}

}  // namespace raydix::test
