#include "support/double_scenes.h"

#include <cmath>
#include <limits>

namespace raydix::test {

namespace {

Vec3d as_double(Vec3 p) { return {p.x, p.y, p.z}; }
double& coordinate(Vec3d& p, std::size_t axis) { return axis == 0 ? p.x : axis == 1 ? p.y : p.z; }

class RayMaker {
public:
    RayMaker(const MeshD& mesh, std::uint64_t seed)
        : mesh_(mesh), box_(box_of_mesh(mesh)), random_(seed) {
        const Vec3d size = box_.hi - box_.lo;
        const double margin = 0.05 * max_of(max_of(size.x, size.y), max_of(size.z, 1e-12));
        box_.lo = box_.lo - Vec3d{margin, margin, margin};
        box_.hi = box_.hi + Vec3d{margin, margin, margin};
    }

    RayD make(std::size_t kind) {
        RayD ray = toward(corner());
        switch (kind % 10) {
            case 0:
                return ray;
            case 1:
                return toward(edge_middle());
            case 2:
                return along_axis();
            case 3:
                return zero_component(ray);
            case 4:
                ray.tmax = 2.0 * random_.unit();
                return ray;
            case 5:
                ray.tmin = 1.5 * random_.unit();
                return ray;
            case 6:
                return {edge_middle(), 0.0, random_.direction()};
            case 7:
                ray.direction =
                    std::ldexp(1.0, static_cast<int>(random_.below(1201)) - 600) * ray.direction;
                return ray;
            case 8:
                return along_edge();
            default:
                return toward(random_.in(box_));
        }
    }

private:
    const Triangle& triangle() { return mesh_.triangles[random_.below(mesh_.triangles.size())]; }
    Vec3d corner() { return mesh_.vertices[triangle()[random_.below(3)]]; }
    Vec3d edge_middle() {
        const Triangle& t = triangle();
        const std::size_t k = random_.below(3);
        return 0.5 * (mesh_.vertices[t[k]] + mesh_.vertices[t[(k + 1) % 3]]);
    }
    RayD toward(Vec3d target) {
        const Vec3d origin = random_.in(box_);
        return {origin, 0.0, target - origin};
    }
    double zero() { return random_.below(2) != 0 ? 0.0 : -0.0; }
    RayD along_axis() {
        RayD ray{corner(), 0.0, {zero(), zero(), zero()}};
        const std::size_t axis = random_.below(3);
        Vec3d start = random_.in(box_);
        coordinate(ray.origin, axis) = coordinate(start, axis);
        coordinate(ray.direction, axis) = random_.below(2) != 0 ? 1.0 : -1.0;
        return ray;
    }
    RayD zero_component(RayD ray) {
        const std::size_t axis = random_.below(3);
        Vec3d target = ray.origin + ray.direction;
        coordinate(ray.origin, axis) = coordinate(target, axis);
        coordinate(ray.direction, axis) = zero();
        return ray;
    }
    RayD along_edge() {
        const Triangle& t = triangle();
        const std::size_t k = random_.below(3);
        const Vec3d a = mesh_.vertices[t[k]], b = mesh_.vertices[t[(k + 1) % 3]];
        return {a - static_cast<double>(random_.below(3)) * (b - a), 0.0, b - a};
    }

    const MeshD& mesh_;
    AabbD box_;
    RandomD random_;
};

}  // namespace

MeshD in_double(const Mesh& mesh, double scale, Vec3d move) {
    MeshD out{mesh.name, {}, mesh.triangles};
    for (const Vec3& v : mesh.vertices) out.vertices.push_back(scale * as_double(v) + move);
    return out;
}

Mesh in_float(const MeshD& mesh) {
    Mesh out{mesh.name, {}, mesh.triangles};
    for (const Vec3d& v : mesh.vertices)
        out.vertices.push_back(
            {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)});
    return out;
}

Vec3d RandomD::direction() {
    for (;;) {
        const Vec3d d{2 * unit() - 1, 2 * unit() - 1, 2 * unit() - 1};
        const double length2 = d.x * d.x + d.y * d.y + d.z * d.z;
        if (length2 > 0.01 && length2 < 1.0) return d;
    }
}

MeshD random_soup_d(std::size_t count, std::uint64_t seed, double size) {
    RandomD random(seed);
    MeshD mesh;
    for (std::uint32_t i = 0; i < count; ++i) {
        const Vec3d at{random.unit(), random.unit(), random.unit()};
        for (int k = 0; k < 3; ++k) mesh.vertices.push_back(at + size * random.direction());
        mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
    }
    return mesh;
}

MeshD slivers_d(std::size_t count, std::uint64_t seed, Vec3d place) {
    RandomD random(seed);
    MeshD mesh;
    const auto add = [&](Vec3d a, Vec3d b, Vec3d c) {
        const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
        mesh.vertices.insert(mesh.vertices.end(), {a, b, c});
        mesh.triangles.push_back({first, first + 1, first + 2});
    };
    for (std::size_t i = 0; i < count; ++i) {
        const bool small = i % 16 != 0;
        const Vec3d at = place + random.in({{0.0, 0.0, 0.0}, {100.0, 100.0, 100.0}});
        const Vec3d along = (small ? 1.0 : 60.0) * random.direction();
        const double width = small ? 1.0 : std::ldexp(30.0, -static_cast<int>(random.below(30)));
        add(at, at + along, at + 0.3 * along + width * random.direction());
    }
    return mesh;
}

MeshD with_stray(MeshD mesh, Vec3d at) {
    const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
    mesh.vertices.insert(mesh.vertices.end(),
                         {at, at + Vec3d{0.0, 1.0, 0.0}, at + Vec3d{1.0, 0.0, 1.0}});
    mesh.triangles.push_back({first, first + 1, first + 2});
    return mesh;
}

std::vector<RayD> rays_in_planes(const MeshD& mesh, std::size_t count, std::uint64_t seed) {
    RandomD random(seed);
    std::vector<RayD> rays;
    for (std::size_t i = 0; i < count; ++i) {
        const Triangle& t = mesh.triangles[random.below(mesh.triangles.size() / 16) * 16];
        const Vec3d a = mesh.vertices[t[0]], ab = mesh.vertices[t[1]] - a,
                    ac = mesh.vertices[t[2]] - a;
        const auto at = [&](double u, double v) { return a + u * ab + v * ac; };
        const Vec3d from = at(random.between(-2, 2), random.between(-2, 2));
        const double v = 0.5 * random.unit();
        rays.push_back({from, 0.0, at(random.unit() * (1 - v), v) - from});
    }
    return rays;
}

AabbD box_of_mesh(const MeshD& mesh) {
    AabbD box{{infinity, infinity, infinity}, {-infinity, -infinity, -infinity}};
    for (const Vec3d& v : mesh.vertices) {
        const double largest = max_of(max_of(std::fabs(v.x), std::fabs(v.y)), std::fabs(v.z));
        if (!(largest <= 1e12) || std::isnan(v.x + v.y + v.z)) continue;
        box = {min_of(box.lo, v), max_of(box.hi, v)};
    }
    return box;
}

std::vector<RayD> mixed_rays(const MeshD& mesh, std::size_t count, std::uint64_t seed) {
    RayMaker maker(mesh, seed);
    std::vector<RayD> rays(count);
    for (std::size_t i = 0; i < count; ++i) rays[i] = maker.make(i);
    return rays;
}

}  // namespace raydix::test
