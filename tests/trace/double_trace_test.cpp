// Rays in double: against every triangle bit for bit, against exact arithmetic, far from the
// origin, through edges and corners; and that nothing but the input decides a bit.
#include <gtest/gtest.h>
#include <raydix/raydix.h>

#include <algorithm>
#include <cmath>
#include <iostream>

#include "primitives/double_sources.h"
#include "support/double_scenes.h"
#include "support/exact.h"
#include "support/sanitized.h"
#include "support/scenes.h"
#include "support/support.h"
#include "trace/triangle_test.h"

namespace raydix::test {
namespace {

constexpr std::uint64_t double_trace_seed = 20130521;
constexpr Builder all_builders[] = {
    Builder::karras, Builder::lauterbach, Builder::garanzha, Builder::apetrei, Builder::ploc,
    Builder::hploc,  Builder::binned,     Builder::sweep,    Builder::split,   Builder::sbvh};

std::uint64_t count_different(std::span<const HitD> a, std::span<const HitD> b) {
    EXPECT_EQ(a.size(), b.size());
    std::uint64_t different = 0;
    for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i) different += !(a[i] == b[i]);
    return different;
}

std::uint64_t count_hits(std::span<const HitD> hits) {
    return static_cast<std::uint64_t>(
        std::ranges::count_if(hits, [](const HitD& h) { return h.hit(); }));
}

/// All triangles that the half-open test accepts, in order.
std::vector<HitD> every_hit(const MeshD& mesh, const RayD& ray) {
    const TriangleSourceD source{mesh.vertices.data(), mesh.triangles.data(), mesh.vertices.size()};
    std::vector<HitD> hits;
    if (!is_valid(ray)) return hits;
    const RayFrameD frame = make_frame(ray);
    for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i) {
        AabbD box;
        BasicTriangleHit<double> hit;
        if (source.box(i, box) &&
            intersect_triangle<EdgeRule::half_open>(frame, source.corners(i), frame.tmax, hit))
            hits.push_back(hit_of_tree(TreeHitD{hit.t * frame.t_scale, i, hit.u, hit.v}));
    }
    std::ranges::sort(hits, {}, [](const HitD& h) { return std::pair(h.t, h.prim); });
    return hits;
}

void expect_any_and_all_agree(const BvhD& bvh, const MeshD& mesh, std::span<const RayD> rays,
                              std::span<const HitD> closest) {
    std::vector<std::uint8_t> occluded(rays.size());
    const TraceCounts counts = trace_any(bvh, rays, occluded);
    EXPECT_EQ(counts.hits, count_hits(closest));
    for (std::size_t i = 0; i < rays.size(); ++i)
        ASSERT_EQ(occluded[i] != 0, closest[i].hit()) << i;
    const std::span<const RayD> some = rays.first(rays.size() / 10);
    const AllHitsD all = trace_all(bvh, some);
    for (std::size_t i = 0; i < some.size(); ++i) {
        const auto own =
            std::span(all.hits).subspan(all.offsets[i], all.offsets[i + 1] - all.offsets[i]);
        ASSERT_TRUE(std::ranges::equal(own, every_hit(mesh, some[i]))) << i;
    }
}

struct Case {
    std::string name;
    MeshD mesh;
};

std::vector<Case> cases() {
    const Mesh lattice = lattice_mesh(600, 6, 7);
    return {{"soup", random_soup_d(700, 1)},
            {"soup of large ones", random_soup_d(300, 2, 1.0)},
            {"soup at a UTM place", in_double(random_soup(700, 3), 100.0, utm_place)},
            {"tiny soup", in_double(random_soup(500, 4), 1e-9)},
            {"tiny soup far off", in_double(random_soup(500, 5), 1e-6, {1e5, -2e5, 3e5})},
            {"huge soup", in_double(random_soup(500, 6), 1.4e12, {-0.7e12, -0.7e12, -0.7e12})},
            {"slivers", slivers_d(700, 9, {})},
            {"slivers at a UTM place", slivers_d(700, 10)},
            {"slivers and a stray triangle", with_stray(slivers_d(700, 10), {})},
            {"lattice", in_double(lattice)},
            {"lattice at a UTM place", in_double(lattice, 0.1, utm_place)}};
}

TEST(DoubleTrace, EveryBuilderLikeEveryTriangle) {
    for (const auto& [name, mesh] : cases()) {
        const std::vector<RayD> rays =
            mixed_rays(mesh, fewer(1000 * thorough, 3), double_trace_seed);
        const std::vector<HitD> wanted = trace_brute_force(mesh, rays);
        std::cout << name << ": " << rays.size() << " rays, " << count_hits(wanted) << " hits\n";
        EXPECT_GT(count_hits(wanted), rays.size() / 4) << name;
        for (const Builder builder : all_builders) {
            const BvhD bvh = build_bvh(mesh, {.builder = builder});
            EXPECT_EQ(count_different(trace(bvh, rays), wanted), 0u)
                << name << ", " << builder_name(builder) << ", seed " << double_trace_seed;
        }
        for (const Builder builder : {Builder::ploc, Builder::split, Builder::sbvh})
            expect_any_and_all_agree(build_bvh(mesh, {.builder = builder}), mesh, rays, wanted);
    }
}

/// What trees of parts stand on: at t, the ray is where the triangle is at (u, v), up to the pads
/// of slab.h, even if the ray lies in the triangle's plane.
TEST(DoubleTrace, TheRayIsAtTheTriangleWhereItHits) {
    using Real = long double;
    std::size_t hits = 0;
    Real worst = 0;
    for (const Vec3d place : {Vec3d{}, utm_place}) {
        const MeshD mesh = slivers_d(1600, 13, place);
        std::vector<RayD> rays = rays_in_planes(mesh, 5'000 * thorough, double_trace_seed);
        const std::vector<RayD> others = mixed_rays(mesh, 500 * thorough, double_trace_seed);
        rays.insert(rays.end(), others.begin(), others.end());
        const std::vector<HitD> found = trace(build_bvh(mesh), rays);
        for (std::size_t i = 0; i < rays.size(); ++i) {
            if (!found[i].hit()) continue;
            ++hits;
            const Triangle& t = mesh.triangles[found[i].prim];
            Real off = 0, far = 0;
            for (std::size_t k = 0; k < 3; ++k) {
                const auto at = [&](Vec3d p) { return Real((&p.x)[k]); };
                const auto from_origin = [&](std::size_t corner) {
                    return at(mesh.vertices[t[corner]]) - at(rays[i].origin);
                };
                const Real a = from_origin(0), b = from_origin(1), c = from_origin(2);
                const Real point = a + Real(found[i].u) * (b - a) + Real(found[i].v) * (c - a);
                off = std::max(off, std::fabs(Real(found[i].t) * at(rays[i].direction) - point));
                for (const Real x : {a, b, c}) far = std::max(far, std::fabs(x));
            }
            ASSERT_LE(off, 64 * 0x1p-53L * 2 * far)
                << "ray " << i << ", seed " << double_trace_seed;
            worst = std::max(worst, off / (0x1p-53L * 2 * far));
        }
    }
    std::cout << hits << " hits, off by up to " << worst << " roundings\n";
    EXPECT_GT(hits, 1000 * thorough);
}

/// Parts of triangles are entered later than the whole. Where nearly no digit of a hit's t is
/// certain, a tree of whole triangles and a tree of parts must still agree.
TEST(DoubleTrace, PartsOfTrianglesChangeNoBit) {
    constexpr std::size_t some = fewer(300, 4);
    std::size_t split_parts = 0, sbvh_parts = 0;
    for (const MeshD& mesh :
         {slivers_d(6000, 11, {}), slivers_d(6000, 11),
          with_stray(slivers_d(6000, 12), utm_place + Vec3d{0.0, -900.0, 0.0})}) {
        std::vector<RayD> rays =
            rays_in_planes(mesh, fewer(4'000 * thorough, 3), double_trace_seed);
        const std::vector<RayD> others =
            mixed_rays(mesh, fewer(1000 * thorough, 3), double_trace_seed);
        rays.insert(rays.end(), others.begin(), others.end());
        const BvhD whole = build_bvh(mesh, {.builder = Builder::sweep});
        const std::vector<HitD> wanted = trace(whole, rays);
        const AllHitsD all = trace_all(whole, rays);
        EXPECT_EQ(count_different(std::span(wanted).last(some),
                                  trace_brute_force(mesh, std::span(rays).last(some))),
                  0u);
        EXPECT_EQ(count_different(std::span(wanted).first(some),
                                  trace_brute_force(mesh, std::span(rays).first(some))),
                  0u);
        for (const Builder builder : {Builder::split, Builder::sbvh}) {
            const BvhD bvh = build_bvh(mesh, {.builder = builder, .max_leaf = 1});
            (builder == Builder::split ? split_parts : sbvh_parts) +=
                bvh.order().size() - mesh.triangles.size();
            EXPECT_EQ(count_different(trace(bvh, rays), wanted), 0u)
                << builder_name(builder) << ", seed " << double_trace_seed;
            const AllHitsD own = trace_all(bvh, rays);
            EXPECT_EQ(own.offsets, all.offsets) << builder_name(builder);
            EXPECT_EQ(own.hits, all.hits) << builder_name(builder);
            std::vector<std::uint8_t> occluded(rays.size());
            EXPECT_EQ(trace_any(bvh, rays, occluded).hits, count_hits(wanted));
        }
    }
    EXPECT_GT(split_parts, 100u);
    EXPECT_GT(sbvh_parts, 1000u);
}

TEST(DoubleTrace, BuiltinScenesLikeEveryTriangle) {
    for (const Model& scene : builtin_triangle_scenes(10'000)) {
        const MeshD mesh = in_double(scene.mesh(), 1.0, utm_place);
        const std::vector<RayD> rays = mixed_rays(mesh, 50 * thorough, double_trace_seed);
        const std::vector<HitD> hits = trace(build_bvh(mesh), rays);
        EXPECT_GT(count_hits(hits), 0u);
        EXPECT_EQ(count_different(hits, trace_brute_force(mesh, rays)), 0u) << scene.name;
    }
}

TEST(DoubleTrace, ThreadsLeavesAndCodesChangeNoBit) {
    const MeshD mesh = in_double(random_soup(3000, 8, 0.2f), 50.0, utm_place);
    const std::vector<RayD> rays = mixed_rays(mesh, 1000 * thorough, double_trace_seed);
    const std::vector<HitD> wanted = trace(build_bvh(mesh), rays, {.threads = 1});
    const AllHitsD all = trace_all(build_bvh(mesh), rays, {.threads = 1});
    for (const int threads : {1, 3})
        for (const int max_leaf : {1, 255})
            for (const int bits : {30, 63}) {
                const BvhD bvh =
                    build_bvh(mesh, {.bits = bits, .max_leaf = max_leaf, .threads = threads});
                EXPECT_EQ(count_different(trace(bvh, rays, {.threads = threads}), wanted), 0u);
                const AllHitsD own = trace_all(bvh, rays, {.threads = threads, .counters = true});
                EXPECT_EQ(own.offsets, all.offsets);
                EXPECT_EQ(own.hits, all.hits);
                EXPECT_GT(own.counts.node_visits, rays.size());
            }
    const BvhD bvh = build_bvh(mesh);
    for (std::size_t i = 0; i < 500; ++i) {
        ASSERT_EQ(closest_hit(bvh, rays[i]), wanted[i]);
        ASSERT_EQ(any_hit(bvh, rays[i]), wanted[i].hit());
    }
}

/// t of the ray on the triangle's plane if it passes inside or through the border; no rounding.
bool exact_hit(const MeshD& mesh, std::uint32_t prim, const RayD& ray, Exact& t, bool& border) {
    const Triangle& corners = mesh.triangles[prim];
    const ExactPoint o = exact(ray.origin), d = exact(ray.direction),
                     a = exact(mesh.vertices[corners[0]]) - o,
                     b = exact(mesh.vertices[corners[1]]) - o,
                     c = exact(mesh.vertices[corners[2]]) - o;
    const Exact u = dot(d, cross(c, b)), v = dot(d, cross(a, c)), w = dot(d, cross(b, a));
    if ((u < 0 || v < 0 || w < 0) && (u > 0 || v > 0 || w > 0)) return false;
    const ExactPoint normal = cross(b - a, c - a);
    const Exact along = dot(normal, d);
    if (along == 0) return false;
    t = dot(normal, a) / along;
    border = u == 0 || v == 0 || w == 0;
    return t >= Exact(ray.tmin);
}

TEST(DoubleTrace, TIsThatOfExactArithmetic) {
    for (const auto& mesh :
         {random_soup_d(60, 11, 0.5), in_double(random_soup(60, 12, 0.5f), 100.0, utm_place)}) {
        const AabbD box = box_of_mesh(mesh);
        RandomD random(double_trace_seed);
        const BvhD bvh = build_bvh(mesh);
        double worst = 0;
        std::size_t hits = 0;
        for (std::size_t i = 0; i < 20 * thorough; ++i) {
            const RayD ray{random.in(box), 0.0, random.direction()};
            const HitD hit = closest_hit(bvh, ray);
            Exact best = -1, t;
            std::uint32_t prim = no_primitive;
            bool border = false;
            for (std::uint32_t k = 0; k < mesh.triangles.size(); ++k)
                if (exact_hit(mesh, k, ray, t, border) && (best < 0 || t < best))
                    best = t, prim = k;
            ASSERT_EQ(hit.prim, prim) << "seed " << double_trace_seed << " ray " << i;
            if (prim == no_primitive) continue;
            ++hits;
            const double error = static_cast<double>(abs(Exact(hit.t) - best) / best);
            worst = std::max(worst, error);
        }
        std::cout << hits << " hits, t off by up to " << worst << " of itself\n";
        EXPECT_GT(hits, 0u);
        EXPECT_LT(worst, 1e-9);
    }
}

/// Corners on a grid of 2^-20, so that moving them by whole metres rounds nothing.
MeshD gridded(const Mesh& mesh, double scale) {
    MeshD out = in_double(mesh, scale);
    const auto snap = [](double x) { return std::round(x * 0x1p20) * 0x1p-20; };
    for (Vec3d& v : out.vertices) v = {snap(v.x), snap(v.y), snap(v.z)};
    return out;
}

TEST(DoubleTrace, MovedSceneGivesTheSameHitsWhereFloatFails) {
    const MeshD home = gridded(load_model("builtin:figure?triangles=20000").mesh(), 1.0);
    MeshD away = home;
    for (Vec3d& v : away.vertices) v = v + utm_place;
    std::vector<RayD> rays = mixed_rays(home, 5000 * thorough, double_trace_seed), moved_rays;
    std::vector<Ray> float_rays;
    for (RayD& ray : rays) {
        ray.origin = {std::round(ray.origin.x * 0x1p20) * 0x1p-20,
                      std::round(ray.origin.y * 0x1p20) * 0x1p-20,
                      std::round(ray.origin.z * 0x1p20) * 0x1p-20};
        RayD moved = ray;
        moved.origin = ray.origin + utm_place;
        moved_rays.push_back(moved);
        const auto rounded = [](Vec3d p) {
            return Vec3{static_cast<float>(p.x), static_cast<float>(p.y), static_cast<float>(p.z)};
        };
        float_rays.push_back({rounded(moved.origin), static_cast<float>(ray.tmin),
                              rounded(ray.direction), static_cast<float>(ray.tmax)});
    }
    const std::vector<HitD> wanted = trace(build_bvh(home), rays);
    const std::vector<HitD> hits = trace(build_bvh(away), moved_rays);
    const std::vector<Hit> in_floats = trace(build_bvh(in_float(away)), float_rays);
    std::size_t wrong = 0, float_wrong = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
        wrong += hits[i].prim != wanted[i].prim ||
                 (hits[i].hit() && !(std::fabs(hits[i].t - wanted[i].t) <= 1e-9 * wanted[i].t));
        float_wrong += in_floats[i].prim != wanted[i].prim;
    }
    std::cout << rays.size() << " rays, " << count_hits(wanted) << " hits, " << wrong
              << " wrong in double, " << float_wrong << " in float\n";
    EXPECT_GT(count_hits(wanted), rays.size() / 10);
    EXPECT_EQ(wrong, 0u);
    EXPECT_GT(float_wrong, rays.size() / 10);
}

TEST(DoubleTrace, DegenerateScenes) {
    const RayD ray{{0.25, 0.25, -1.0}, 0.0, {0.0, 0.0, 2.0}};
    EXPECT_FALSE(closest_hit(BvhD(), ray).hit());
    EXPECT_FALSE(closest_hit(build_bvh(MeshD{}), ray).hit());
    MeshD mesh{"", {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}};
    EXPECT_EQ(closest_hit(build_bvh(mesh), ray), hit_of_tree(TreeHitD{0.5, 0, 0.25, 0.25}));
    mesh.triangles.assign(1000, Triangle{0, 1, 2});
    for (const Builder builder : all_builders) {
        const BvhD bvh = build_bvh(mesh, {.builder = builder});
        EXPECT_EQ(closest_hit(bvh, ray), hit_of_tree(TreeHitD{0.5, 0, 0.25, 0.25}))
            << builder_name(builder);
        EXPECT_EQ(trace_all(bvh, std::span(&ray, 1)).hits.size(), 1000u);
    }
    mesh.triangles = {{0, 0, 1}, {1, 1, 1}, {0, 1, 2}};  // a segment, a point
    EXPECT_EQ(closest_hit(build_bvh(mesh), ray).prim, 2u);
}

TEST(DoubleTrace, InvalidRaysAreCounted) {
    const double nan = std::numeric_limits<double>::quiet_NaN(),
                 inf = std::numeric_limits<double>::infinity();
    const MeshD mesh{"", {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}};
    const RayD good{{0.2, 0.2, -1.0}, 0.0, {0.0, 0.0, 1.0}};
    std::vector<RayD> rays(7, good);
    rays[1].origin.x = nan;
    rays[2].direction = {0.0, -0.0, 0.0};
    rays[3].direction.y = inf;
    rays[4].tmax = nan;
    rays[5].tmin = 3.0, rays[5].tmax = 2.0;
    rays[6].origin.z = -1e300;
    std::vector<HitD> hits(rays.size());
    const TraceCounts counts = trace(build_bvh(mesh), rays, hits);
    EXPECT_EQ(counts.invalid_rays, 5u);
    EXPECT_EQ(counts.hits, 2u);
    EXPECT_TRUE(hits[0].hit());
    EXPECT_EQ(hits[6].t, 1e300);
    EXPECT_THROW(trace(build_bvh(mesh), rays, std::span(hits).first(3)), InputError);
}

}  // namespace
}  // namespace raydix::test
