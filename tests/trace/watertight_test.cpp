// Rays that start inside a closed surface must hit it, whatever they are aimed at and wherever the
// surface is; and the signed number of crossings must be right even through edges and vertices.
#include <raydix/bvh.h>
#include <raydix/model.h>
#include <raydix/trace.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <random>

#include "base/math.h"
#include "support/sanitized.h"
#include "support/support.h"
#include "trace/triangle_test.h"

namespace raydix {
namespace {

constexpr std::uint64_t watertight_seed = 20120731;

/// A closed mesh, and points inside it that are far from its surface.
struct ClosedMesh {
    Mesh mesh;
    std::vector<Vec3> inside;
};

class Random {
public:
    float unit() { return static_cast<float>(engine_() >> 40) * 0x1p-24f; }
    std::uint32_t below(std::size_t n) { return static_cast<std::uint32_t>(engine_() % n); }
    Vec3 direction() {
        for (;;) {
            const Vec3 d{2 * unit() - 1, 2 * unit() - 1, 2 * unit() - 1};
            if (dot(d, d) > 0.01f && dot(d, d) < 1.0f) return d;
        }
    }

private:
    std::mt19937_64 engine_{watertight_seed};
};

double longest_edge(const Mesh& mesh) {
    double longest = 0;
    for (const Triangle& t : mesh.triangles)
        for (int k = 0; k < 3; ++k) {
            const Vec3 e = mesh.vertices[t[static_cast<std::size_t>(k)]] -
                           mesh.vertices[t[static_cast<std::size_t>((k + 1) % 3)]];
            longest = std::max(longest, std::sqrt(double(dot(e, e))));
        }
    return longest;
}

/// The surface is at least this far: no point of a triangle is farther from a vertex of it than its
/// longest edge.
double clearance(const Mesh& mesh, double edge, Vec3 p) {
    double nearest = 1e30;
    for (const Vec3& v : mesh.vertices) {
        const double x = double(v.x) - p.x, y = double(v.y) - p.y, z = double(v.z) - p.z;
        nearest = std::min(nearest, x * x + y * y + z * z);
    }
    return std::sqrt(nearest) - edge;
}

/// Whether rays along three directions all leave the mesh an odd number of times.
bool is_inside(const Bvh& bvh, Vec3 p) {
    const std::vector<Ray> rays{
        {p, 0, {1, 0, 0}}, {p, 0, {0, 1, 0.001f}}, {p, 0, {0.3f, -0.2f, 1}}};
    const AllHits all = trace_all(bvh, rays);
    for (std::size_t i = 0; i < rays.size(); ++i)
        if ((all.offsets[i + 1] - all.offsets[i]) % 2 == 0) return false;
    return true;
}

/// The figure, a thousand times as large as it comes: 1e5 away, 1000 ulp are 7.8 units, and it must
/// have room for that.
const ClosedMesh& large_figure() {
    static const ClosedMesh solid = [] {
        ClosedMesh s{load_model("builtin:figure?triangles=20000").mesh(), {}};
        for (Vec3& v : s.mesh.vertices) v = 1000.0f * v;
        const Bvh bvh = build_bvh(s.mesh);
        const Aabb box = bvh.bounds();
        const double edge = longest_edge(s.mesh);
        Random random;
        for (int tries = 0; tries < 20000 && s.inside.size() < 100; ++tries) {
            const Vec3 at{random.unit(), random.unit(), random.unit()}, size = box.hi - box.lo;
            const Vec3 p = box.lo + Vec3{at.x * size.x, at.y * size.y, at.z * size.z};
            if (is_inside(bvh, p) && clearance(s.mesh, edge, p) > 10.0) s.inside.push_back(p);
        }
        return s;
    }();
    return solid;
}

ClosedMesh transformed(float scale, Vec3 move) {
    ClosedMesh solid = large_figure();
    for (Vec3& v : solid.mesh.vertices) v = scale * v + move;
    for (Vec3& p : solid.inside) p = scale * p + move;
    return solid;
}

/// One third anywhere, one third at vertices, one third at middles of edges.
Ray inside_ray(const ClosedMesh& solid, Random& random) {
    const Vec3 from = solid.inside[random.below(solid.inside.size())];
    const Triangle& t = solid.mesh.triangles[random.below(solid.mesh.triangles.size())];
    const Vec3 a = solid.mesh.vertices[t[0]], b = solid.mesh.vertices[t[1]];
    switch (random.below(3)) {
        case 0:
            return {from, 0, random.direction()};
        case 1:
            return {from, 0, a - from};
        default:
            return {from, 0, 0.5f * (a + b) - from};
    }
}

std::size_t rays_wanted() {
    const char* given = std::getenv("RAYDIX_WATERTIGHT_RAYS");
    return given ? std::strtoull(given, nullptr, 10) : test::fewer(500'000 * test::thorough, 10);
}

void expect_no_leak(const char* name, const ClosedMesh& solid) {
    ASSERT_GT(solid.inside.size(), 20u) << "too few points inside to start from";
    const Bvh bvh = build_bvh(solid.mesh);
    ASSERT_EQ(bvh.left_out(), 0u);
    Random random;
    std::size_t rays_done = 0, leaks = 0;
    for (const std::size_t wanted = rays_wanted(); rays_done < wanted;) {
        std::vector<Ray> rays(std::min<std::size_t>(wanted - rays_done, 1u << 18));
        for (Ray& ray : rays) ray = inside_ray(solid, random);
        const std::vector<Hit> hits = trace(bvh, rays);
        for (std::size_t i = 0; i < rays.size(); ++i) {
            if (hits[i].hit()) continue;
            if (++leaks > 5) continue;
            const Ray& r = rays[i];
            ADD_FAILURE() << name << ", seed " << watertight_seed << ": ray " << rays_done + i
                          << " from (" << r.origin.x << ", " << r.origin.y << ", " << r.origin.z
                          << ") along (" << r.direction.x << ", " << r.direction.y << ", "
                          << r.direction.z << ") slips out";
        }
        rays_done += rays.size();
    }
    std::printf("watertight, %s: %zu rays compared, %zu hits, %zu wrong\n", name, rays_done,
                rays_done - leaks, leaks);
    EXPECT_EQ(leaks, 0u);
    EXPECT_GT(rays_done, 0u);
}

TEST(Watertight, WhereItIs) { expect_no_leak("1000 x", large_figure()); }
TEST(Watertight, MovedByAHundredThousand) {
    expect_no_leak("1000 x, moved by 1e5", transformed(1.0f, {1e5f, 1e5f, 1e5f}));
    expect_no_leak("1000 x, moved by -1e5 in y", transformed(1.0f, {0, -1e5f, 0}));
}
TEST(Watertight, TinyAndHuge) {
    expect_no_leak("1e-6 x", transformed(1e-9f, {0, 0, 0}));
    expect_no_leak("1e6 x", transformed(1e3f, {0, 0, 0}));
}

/// Out minus in along the ray; normals point outward. Which way a triangle faces is read in the
/// ray's sheared plane, where the crossings are counted: for a triangle seen nearly edge-on,
/// rounding may turn it against its normal.
int signed_crossings(const Mesh& mesh, const Ray& ray, std::span<const Hit> hits) {
    const RayFrame frame = make_frame(ray);
    int sum = 0;
    for (const Hit& hit : hits) {
        const Triangle& t = mesh.triangles[hit.prim];
        sum += perturbed_edge_sign(shear(frame, mesh.vertices[t[0]]),
                                   shear(frame, mesh.vertices[t[1]]));
    }
    return sum;
}

std::size_t count_wrong_crossings(const ClosedMesh& solid, const std::vector<Ray>& rays,
                                  int expected) {
    const AllHits all = trace_all(build_bvh(solid.mesh), rays);
    std::size_t wrong = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
        const std::span<const Hit> own =
            std::span(all.hits).subspan(all.offsets[i], all.offsets[i + 1] - all.offsets[i]);
        wrong += signed_crossings(solid.mesh, rays[i], own) != expected;
    }
    std::printf("crossings, expected %d: %zu rays compared, %zu hits, %zu wrong\n", expected,
                rays.size(), all.hits.size(), wrong);
    EXPECT_GT(all.hits.size(), 0u);
    return wrong;
}

TEST(Watertight, CrossingsAreExactThroughEdgesAndVertices) {
    for (const Vec3 move : {Vec3{0, 0, 0}, Vec3{1e5f, 0, -1e5f}}) {
        const ClosedMesh solid = transformed(1.0f, move);
        Random random;
        std::vector<Ray> from_inside(10000 * test::thorough), from_outside(from_inside.size());
        for (Ray& ray : from_inside) ray = inside_ray(solid, random);
        EXPECT_EQ(count_wrong_crossings(solid, from_inside, 1), 0u);
        // The same lines from far outside: what goes in comes out again.
        for (std::size_t i = 0; i < from_outside.size(); ++i) {
            const Triangle& t = solid.mesh.triangles[random.below(solid.mesh.triangles.size())];
            const Vec3 target =
                random.below(2) ? solid.mesh.vertices[t[0]]
                                : 0.5f * (solid.mesh.vertices[t[1]] + solid.mesh.vertices[t[2]]);
            const Vec3 d = random.direction();
            from_outside[i] = {target - 20000.0f * d, 0, d};
        }
        EXPECT_EQ(count_wrong_crossings(solid, from_outside, 0), 0u);
    }
}

}  // namespace
}  // namespace raydix
