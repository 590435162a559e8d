// A closed surface has no holes: whatever starts inside hits it, through edges and vertices too,
// wherever the mesh stands and whatever its size; and a line's signed crossings add up to 1 from
// inside and 0 from outside. RAYDIX_WATERTIGHT_RAYS sets the rays per variant.
#include <gtest/gtest.h>
#include <raydix/raydix.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <iostream>
#include <map>
#include <random>

#include "support/scenes.h"
#include "support/support.h"
#include "trace/triangle_test.h"

namespace raydix::test {
namespace {

using Random = std::mt19937_64;
constexpr std::uint64_t seed = 1357;

std::size_t rays_per_variant() {
    const char* wanted = std::getenv("RAYDIX_WATERTIGHT_RAYS");
    return wanted != nullptr ? std::strtoull(wanted, nullptr, 10) : 500'000 * thorough;
}

float unit(Random& random) { return static_cast<float>(random() >> 40) * 0x1p-24f; }

struct Point {
    double x, y, z;
};
Point to_double(const Vec3& p) { return {p.x, p.y, p.z}; }
Point minus(Point a, Point b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
double dot(Point a, Point b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
Point cross(Point a, Point b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
double distance(Point a, Point b) { return std::sqrt(dot(minus(a, b), minus(a, b))); }

/// Solid angle of the surface seen from p, over 4 pi: 1 inside, 0 outside (Van Oosterom and
/// Strackee 1983). No ray and no edge rule is involved.
double winding_number(const Mesh& mesh, Point p) {
    double sum = 0;
    for (const Triangle& t : mesh.triangles) {
        const Point a = minus(to_double(mesh.vertices[t[0]]), p),
                    b = minus(to_double(mesh.vertices[t[1]]), p),
                    c = minus(to_double(mesh.vertices[t[2]]), p);
        const double la = std::sqrt(dot(a, a)), lb = std::sqrt(dot(b, b)),
                     lc = std::sqrt(dot(c, c));
        sum += 2 * std::atan2(dot(a, cross(b, c)),
                              la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb);
    }
    return sum / (4 * std::acos(-1.0));
}

double longest_edge(const Mesh& mesh) {
    double longest = 0;
    for (const Triangle& t : mesh.triangles)
        for (std::size_t k = 0; k < 3; ++k)
            longest = std::max(longest, distance(to_double(mesh.vertices[t[k]]),
                                                 to_double(mesh.vertices[t[(k + 1) % 3]])));
    return longest;
}

/// Points inside and outside with at least `clearance` to the surface: a triangle has no point
/// farther from its nearest vertex than its longest edge.
struct Places {
    std::vector<Vec3> inside, outside;
};

Places find_places(const Mesh& mesh, double clearance, std::size_t count) {
    Random random(seed);
    const Aabb box = inspect(mesh).bounds;
    const double needed = clearance + longest_edge(mesh);
    Places places;
    for (int tries = 0; tries < 20'000; ++tries) {
        if (places.inside.size() >= count && places.outside.size() >= count) return places;
        const Vec3 p{box.lo.x + unit(random) * (box.hi.x - box.lo.x),
                     box.lo.y + unit(random) * (box.hi.y - box.lo.y),
                     box.lo.z + unit(random) * (box.hi.z - box.lo.z)};
        const Point at = to_double(p);
        if (std::ranges::any_of(mesh.vertices,
                                [&](const Vec3& v) { return distance(to_double(v), at) < needed; }))
            continue;
        const double turns = winding_number(mesh, at);
        auto& list = turns > 0.5 ? places.inside : places.outside;
        EXPECT_NEAR(turns, turns > 0.5 ? 1.0 : 0.0, 1e-6);
        if (list.size() < count) list.push_back(p);
    }
    return places;
}

/// The figure as it is, or made so large that 1000 ulp of its place are little beside it.
struct Variant {
    const char* name;
    float scale;
    Vec3 shift;
    double clearance_ulp;
};

struct Surface {
    Mesh mesh;
    Places places;
};

Surface make_surface(const Variant& variant) {
    Mesh mesh = load_scene("builtin:figure?triangles=30000").mesh;
    mesh = moved(scaled(std::move(mesh), variant.scale), variant.shift);
    const Aabb box = inspect(mesh).bounds;
    const float far = std::max({std::abs(box.lo.x), std::abs(box.hi.x), std::abs(box.lo.y),
                                std::abs(box.hi.y), std::abs(box.lo.z), std::abs(box.hi.z)});
    const double ulp = double(std::nextafter(far, infinity)) - double(far);
    Places places = find_places(mesh, variant.clearance_ulp * ulp, 40);
    return {std::move(mesh), std::move(places)};
}

/// Ray i: a third anywhere, a third through a vertex, a third through the middle of an edge; of the
/// first some along axes.
Ray outward(const Surface& s, const std::vector<Vec3>& starts, Random& random, std::size_t i) {
    const Vec3 origin = starts[random() % starts.size()];
    const Triangle& t = s.mesh.triangles[random() % s.mesh.triangles.size()];
    const std::size_t k = random() % 3;
    const Vec3 &a = s.mesh.vertices[t[k]], &b = s.mesh.vertices[t[(k + 1) % 3]];
    if (i % 3 == 1) return {origin, 0, a - origin, infinity};
    if (i % 3 == 2) return {origin, 0, 0.5f * (a + b) - origin, infinity};
    Vec3 direction{unit(random) - 0.5f, unit(random) - 0.5f, unit(random) - 0.5f};
    if (i % 7 == 0) (&direction.x)[random() % 3] = random() % 2 ? 0.0f : -0.0f;
    if (i % 11 == 0) direction = {0, (i % 2) ? -1.0f : 1.0f, -0.0f};
    return {origin, 0, direction, infinity};
}

void expect_no_ray_escapes(const Variant& variant) {
    const Surface surface = make_surface(variant);
    ASSERT_GE(surface.places.inside.size(), 10u);
    const Bvh bvh = build_bvh(surface.mesh);
    Random random(seed);
    constexpr std::size_t batch = 1u << 20;
    std::vector<Ray> rays;
    std::vector<Hit> hits;
    std::vector<std::uint8_t> occluded;
    std::uint64_t total = 0, escaped = 0, any_escaped = 0;
    for (const std::size_t wanted = rays_per_variant(); total < wanted; total += rays.size()) {
        rays.resize(std::min(batch, wanted - total));
        for (std::size_t i = 0; i < rays.size(); ++i)
            rays[i] = outward(surface, surface.places.inside, random, i);
        hits.resize(rays.size());
        escaped += rays.size() - trace(bvh, rays, hits).hits;
        const std::size_t some = rays.size() / 8;
        occluded.resize(some);
        any_escaped += some - trace_any(bvh, std::span(rays).first(some), occluded).hits;
    }
    std::cout << variant.name << ": " << surface.mesh.triangles.size() << " triangles, " << total
              << " rays from " << surface.places.inside.size() << " points inside, "
              << total - escaped << " hits, " << escaped << " escaped, " << any_escaped
              << " escaped any-hit (seed " << seed << ")\n";
    EXPECT_GT(total, 0u);
    EXPECT_EQ(escaped, 0u);
    EXPECT_EQ(any_escaped, 0u);
}

/// From the normal in double: the crossing leads out (+1) or in (-1).
int side_of(const Mesh& mesh, const Hit& hit, const Ray& ray) {
    const Triangle& t = mesh.triangles[hit.prim];
    const Point a = to_double(mesh.vertices[t[0]]);
    const Point normal =
        cross(minus(to_double(mesh.vertices[t[1]]), a), minus(to_double(mesh.vertices[t[2]]), a));
    return dot(normal, to_double(ray.direction)) > 0 ? 1 : -1;
}

/// As the triangle test sees it, in the ray's sheared plane.
int sheared_side_of(const Mesh& mesh, const Hit& hit, const Ray& ray) {
    const RayFrame frame = make_frame(ray);
    const Triangle& t = mesh.triangles[hit.prim];
    const ShearedVertex a = shear(frame, mesh.vertices[t[0]]),
                        b = shear(frame, mesh.vertices[t[1]]);
    return -perturbed_edge_sign(b, a);
}

struct Crossings {
    std::uint64_t rays = 0, crossings = 0, wrong = 0, wrong_by_normal = 0;
};

Crossings count_crossings(const Surface& surface, const std::vector<Vec3>& starts, int wanted) {
    const Bvh bvh = build_bvh(surface.mesh);
    Random random(seed + 1);
    std::vector<Ray> rays(10'000 * thorough);
    for (std::size_t i = 0; i < rays.size(); ++i) rays[i] = outward(surface, starts, random, i);
    const AllHits all = trace_all(bvh, rays);
    Crossings result{rays.size(), all.hits.size()};
    for (std::size_t i = 0; i < rays.size(); ++i) {
        int sum = 0, by_normal = 0;
        for (std::uint64_t k = all.offsets[i]; k < all.offsets[i + 1]; ++k) {
            sum += sheared_side_of(surface.mesh, all.hits[k], rays[i]);
            by_normal += side_of(surface.mesh, all.hits[k], rays[i]);
        }
        result.wrong += sum != wanted;
        result.wrong_by_normal += by_normal != wanted;
    }
    return result;
}

void expect_crossings(const Variant& variant) {
    const Surface surface = make_surface(variant);
    ASSERT_GE(surface.places.inside.size(), 10u);
    ASSERT_GE(surface.places.outside.size(), 10u);
    for (const int inside : {1, 0}) {
        const auto& starts = inside ? surface.places.inside : surface.places.outside;
        const Crossings found = count_crossings(surface, starts, inside);
        std::cout << variant.name << (inside ? ", from inside: " : ", from outside: ") << found.rays
                  << " rays, " << found.crossings << " crossings, " << found.wrong
                  << " wrong sums, " << found.wrong_by_normal << " with the normals in double\n";
        EXPECT_GT(found.crossings, inside ? found.rays - 1 : found.rays / 100);
        EXPECT_EQ(found.wrong, 0u);
        // A triangle seen edge-on within rounding may turn the other side to a normal in double.
        EXPECT_LE(found.wrong_by_normal, found.rays / 10'000);
    }
}

const Variant plain{"figure", 1, {0, 0, 0}, 1000};
const Variant far_off{"figure, 100 times larger, moved by 1e5", 100, {1e5f, -1e5f, 1e5f}, 1000};
const Variant tiny{"figure scaled by 1e-6", 1e-6f, {0, 0, 0}, 1000};
const Variant huge{"figure scaled by 1e6", 1e6f, {0, 0, 0}, 1000};

TEST(Watertight, TheFigureIsClosed) {
    const Mesh mesh = load_scene("builtin:figure?triangles=30000").mesh;
    ASSERT_GT(mesh.triangles.size(), 10'000u);
    std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges;
    for (const Triangle& t : mesh.triangles)
        for (std::size_t k = 0; k < 3; ++k) ++edges[{t[k], t[(k + 1) % 3]}];
    for (const auto& [edge, count] : edges) {
        ASSERT_EQ(count, 1);
        ASSERT_TRUE(edges.contains({edge.second, edge.first}));
    }
}

TEST(Watertight, Figure) { expect_no_ray_escapes(plain); }
TEST(Watertight, FaultRaysSlipBetweenTrianglesNear1e5) { expect_no_ray_escapes(far_off); }
TEST(Watertight, TinyFigure) { expect_no_ray_escapes(tiny); }
TEST(Watertight, HugeFigure) { expect_no_ray_escapes(huge); }

TEST(Watertight, FaultInsideFlipsOnSharedEdges) { expect_crossings(plain); }
TEST(Watertight, CrossingsNear1e5) { expect_crossings(far_off); }
TEST(Watertight, CrossingsOfTheTiny) { expect_crossings(tiny); }
TEST(Watertight, CrossingsOfTheHuge) { expect_crossings(huge); }

}  // namespace
}  // namespace raydix::test
