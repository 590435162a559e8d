// Geometry of one's own: ellipsoids, cylinders and cones as quadrics, traced beside a mesh and in
// instances. Step by step: docs/add-a-geometry.md.
#include <raydix/raydix.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>
#include <vector>

using raydix::Aabb;
using raydix::Vec3;

namespace {

/// All points p within `box` where a (p-c).x^2 + b (p-c).y^2 + d (p-c).z^2 = k, c being `center`.
struct Quadric {
    Vec3 center;
    double a, b, d, k;
    Aabb box;
};

bool is_inside(const Aabb& box, double x, double y, double z) {
    return x >= box.lo.x && x <= box.hi.x && y >= box.lo.y && y <= box.hi.y && z >= box.lo.z &&
           z <= box.hi.z;
}

/// Both places where the ray's line meets the quadric, the nearer first. False if there are none.
bool roots(const Quadric& q, const raydix::Ray& ray, double t[2]) {
    const double ox = double{ray.origin.x} - q.center.x, oy = double{ray.origin.y} - q.center.y,
                 oz = double{ray.origin.z} - q.center.z;
    const double dx = ray.direction.x, dy = ray.direction.y, dz = ray.direction.z;
    const double square = q.a * dx * dx + q.b * dy * dy + q.d * dz * dz;
    const double half = q.a * ox * dx + q.b * oy * dy + q.d * oz * dz;
    const double rest = q.a * ox * ox + q.b * oy * oy + q.d * oz * oz - q.k;
    if (square == 0) {  // along a line of the surface's cone: one root at most
        if (half == 0) return false;
        t[0] = t[1] = -rest / (2 * half);
        return true;
    }
    const double under = half * half - square * rest;
    if (under < 0) return false;
    // The root whose terms have one sign loses no digits; the product of both is rest / square.
    const double sum = -(half + std::copysign(std::sqrt(under), half));
    t[0] = sum / square;
    t[1] = sum != 0 ? rest / sum : t[0];
    if (t[1] < t[0]) std::swap(t[0], t[1]);
    return true;
}

/// What the library calls: the first root of ray k that lies in its limits and in the box.
class HitQuadrics {
public:
    explicit HitQuadrics(std::vector<Quadric> quadrics) : quadrics_(std::move(quadrics)) {}

    void operator()(std::uint32_t prim, raydix::RaysAtPrimitive& rays) const {
        const Quadric& q = quadrics_[prim];
        for (std::uint32_t k = 0; k < rays.count(); ++k) {
            const raydix::Ray& ray = rays.ray(k);
            double t[2];
            if (!roots(q, ray, t)) continue;
            for (const double at : t) {
                const float rounded = static_cast<float>(at);  // before it meets tmin and tmax
                if (rounded >= std::max(ray.tmin, 0.0f) && rounded <= ray.tmax &&
                    is_inside(q.box, ray.origin.x + at * ray.direction.x,
                              ray.origin.y + at * ray.direction.y,
                              ray.origin.z + at * ray.direction.z)) {
                    rays.hit(k, rounded);
                    break;
                }
            }
        }
    }

private:
    std::vector<Quadric> quadrics_;
};

/// The scene keeps the function and the boxes, so nothing of `quadrics` must stay.
std::uint32_t add_quadrics(raydix::Scene& scene, const std::vector<Quadric>& quadrics) {
    std::vector<Aabb> boxes;
    boxes.reserve(quadrics.size());
    for (const Quadric& q : quadrics) boxes.push_back(q.box);
    return scene.add(raydix::UserGeometry(boxes, HitQuadrics(quadrics)));
}

bool is_near(double a, double b) { return std::fabs(a - b) <= 1e-5 * std::max(1.0, std::fabs(b)); }

}  // namespace

int main() {
    const std::vector<Quadric> quadrics = {
        {{0, 0, 0}, 1, 1, 0.25, 1, {{-1, -1, -2}, {1, 1, 2}}},  // an ellipsoid, 2 high
        {{5, 0, 0}, 1, 1, 0, 1, {{4, -1, -3}, {6, 1, 3}}},      // an open cylinder
        {{-5, 0, 0}, 1, 1, -1, 0, {{-7, -2, -2}, {-3, 2, 0}}},  // a cone under its tip
    };
    raydix::Scene shapes;
    add_quadrics(shapes, quadrics);
    shapes.commit();
    raydix::Scene scene;
    scene.add(shapes, raydix::Transform{});
    scene.add(shapes, {{{{2, 0, 0, 0}, {0, 2, 0, 20}, {0, 0, 2, 0}}}});  // twice as large, beside
    scene.commit();

    bool right = true;
    const auto expect = [&](Vec3 from, Vec3 way, double t, std::uint32_t prim,
                            std::uint32_t instance) {
        const raydix::Hit hit = raydix::closest_hit(scene, {.origin = from, .direction = way});
        const bool is_right =
            std::isinf(t) ? !hit.hit()
                          : is_near(hit.t, t) && hit.prim == prim && hit.instance == instance;
        if (!is_right)
            std::printf("from (%g, %g, %g): t %g, prim %u, instance %u; t must be %g\n",
                        static_cast<double>(from.x), static_cast<double>(from.y),
                        static_cast<double>(from.z), static_cast<double>(hit.t), hit.prim,
                        hit.instance, t);
        right = right && is_right;
    };
    const double none = INFINITY;
    expect({0, 0, 10}, {0, 0, -1}, 8, 0, 1);      // the top of the ellipsoid
    expect({0, 0, 0}, {0, 0, -1}, 2, 0, 1);       // from inside
    expect({0, 20, 10}, {0, 0, -1}, 6, 0, 2);     // the one of twice the size
    expect({5, -10, 0}, {0, 1, 0}, 9, 1, 1);      // the side of the cylinder
    expect({5, 0, 10}, {0, 0, -1}, none, 0, 0);   // through it: it has no lid
    expect({-5, -10, -1}, {0, 1, 0}, 9, 2, 1);    // the cone, 1 under its tip
    expect({-5, -10, 1}, {0, 1, 0}, none, 0, 0);  // above its tip: outside of its box

    // Many rays give what single ones give, for every way through the scene.
    std::vector<raydix::Ray> rays;
    for (int y = 0; y < 120; ++y)
        for (int x = 0; x < 160; ++x)
            rays.push_back({.origin = {-8 + 0.1f * static_cast<float>(x), -15,
                                       -3 + 0.05f * static_cast<float>(y)},
                            .direction = {0, 1, 0.01f}});
    raydix::Scene equal;  // of equal hits the first geometry's counts
    add_quadrics(equal, quadrics);
    add_quadrics(equal, quadrics);
    equal.commit();
    std::size_t hits = 0, differences = 0;
    for (const raydix::SimdPath path : {raydix::SimdPath::automatic, raydix::SimdPath::single,
                                        raydix::SimdPath::packet, raydix::SimdPath::stream}) {
        const std::vector<raydix::Hit> found = raydix::trace(scene, rays, {.path = path});
        for (std::size_t i = 0; i < rays.size(); ++i) {
            const raydix::Hit alone = raydix::closest_hit(scene, rays[i]);
            hits += found[i].hit();
            differences += found[i].t != alone.t || found[i].prim != alone.prim ||
                           found[i].instance != alone.instance;
        }
        for (const raydix::Hit& hit : raydix::trace(equal, rays, {.path = path}))
            differences += hit.hit() && hit.geometry != 0;
    }
    std::printf("%zu hits of %zu rays by four ways, %zu differences\n", hits, 4 * rays.size(),
                differences);
    return right && hits > 0 && differences == 0 ? 0 : 1;
}
