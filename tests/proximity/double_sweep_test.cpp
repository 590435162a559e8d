// Moving balls in double: against every triangle, against a search in long double and exact
// distances at a place where float has steps of half a metre, and bad input.
#include <gtest/gtest.h>
#include <raydix/raydix.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <limits>

#include "primitives/double_sources.h"
#include "proximity/sweep_walk.h"
#include "support/double_scenes.h"
#include "support/exact_distance.h"
#include "support/mesh_triangles.h"
#include "support/scenes.h"
#include "support/support.h"

namespace raydix::test {
namespace {

constexpr std::uint64_t double_sweep_seed = 20130219;
constexpr double inf = std::numeric_limits<double>::infinity();
constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr Builder sweep_builders[] = {
    Builder::karras, Builder::lauterbach, Builder::garanzha, Builder::apetrei, Builder::ploc,
    Builder::hploc,  Builder::binned,     Builder::sweep,    Builder::split,   Builder::sbvh};

bool same_sweep(const SweepHitD& a, const SweepHitD& b) {
    return a.t == b.t && a.prim == b.prim && a.position == b.position && a.u == b.u && a.v == b.v;
}

/// By every triangle. The tree serves as a frame only.
SweepHitD first_of_all(const MeshD& mesh, const BvhD& bvh, const SphereSweepD& sweep) {
    const SweepFrameD frame(PaddedTreeD(bvh), sweep);
    double best = inf;
    SweepHitD hit;
    for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i) {
        const double t = frame.contact(corners(mesh, i));
        if (!(t < best)) continue;
        best = t;
        const TrianglePointD at = closest_on_triangle(corners(mesh, i), frame.center(t));
        hit = {frame.in_units_of_caller(t), i, at.position, at.u, at.v};
    }
    return hit;
}

/// The rays of every kind that rays are tried with, with balls from tiny to a fifth of the scene.
std::vector<SphereSweepD> sweeps_for(const MeshD& mesh, std::size_t count) {
    RandomD random(double_sweep_seed);
    const AabbD box = box_of_mesh(mesh);
    const double size = max_of(box.hi.x - box.lo.x, box.hi.y - box.lo.y);
    std::vector<SphereSweepD> sweeps;
    for (const RayD& ray : mixed_rays(mesh, count, double_sweep_seed)) {
        const double part = std::ldexp(0.2, -static_cast<int>(random.below(25)));
        sweeps.push_back({ray, part * size * (0.5 + 0.5 * random.unit())});
    }
    return sweeps;
}

TEST(DoubleSweeps, LikeEveryTriangle) {
    std::size_t hits = 0, all = 0;
    for (const MeshD& mesh :
         {random_soup_d(300, 1), in_double(random_soup(300, 2), 100.0, utm_place),
          in_double(random_soup(300, 3), 1.4e12, {-0.7e12, -0.7e12, -0.7e12}),
          in_double(random_soup(300, 4), 1e-9), slivers_d(300, 5),
          with_stray(slivers_d(300, 5), {}), slivers_d(300, 6, {}),
          in_double(lattice_mesh(300, 5, double_sweep_seed))}) {
        const std::vector<SphereSweepD> sweeps = sweeps_for(mesh, 80 * thorough);
        const BvhD any_tree = build_bvh(mesh);
        std::vector<SweepHitD> wanted;
        for (const SphereSweepD& sweep : sweeps)
            wanted.push_back(first_of_all(mesh, any_tree, sweep));
        const auto found_in = [&](const BvhD& bvh, int threads) {
            std::vector<SweepHitD> hits_of_batch(sweeps.size());
            const QueryCounts counts =
                sweep_spheres(bvh, sweeps, hits_of_batch, {.threads = threads});
            EXPECT_EQ(counts.queries, sweeps.size());
            EXPECT_EQ(counts.found, static_cast<std::uint64_t>(std::ranges::count_if(
                                        wanted, [](const SweepHitD& h) { return h.hit(); })));
            return hits_of_batch;
        };
        for (const Builder builder : sweep_builders)
            for (const int threads : {1, 3})
                EXPECT_TRUE(std::ranges::equal(
                    found_in(build_bvh(mesh, {.builder = builder}), threads), wanted, same_sweep))
                    << builder_name(builder) << " of a mesh around " << any_tree.center().x;
        EXPECT_TRUE(same_sweep(sweep_sphere(any_tree, sweeps[3]), wanted[3]));
        for (const SweepHitD& hit : wanted) hits += hit.hit();
        all += wanted.size();
    }
    std::cout << all << " sweeps, " << hits << " hits\n";
    EXPECT_GT(hits, all / 4);
    EXPECT_LT(hits, all);
}

using Real = long double;
struct P {
    Real x, y, z;
};
P operator-(P a, P b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
P operator+(P a, P b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
P operator*(Real s, P a) { return {s * a.x, s * a.y, s * a.z}; }
Real dot(P a, P b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
P load(Vec3d v) { return {v.x, v.y, v.z}; }

Real square_to_segment(P a, P b, P q) {
    const Real along = dot(b - a, b - a);
    const Real s = along > 0 ? std::clamp(dot(q - a, b - a) / along, Real(0), Real(1)) : Real(0);
    const P off = q - (a + s * (b - a));
    return dot(off, off);
}

/// Square of the distance to a triangle, by edges and plane.
Real square_to_triangle(const LeafTriangleD& t, P q) {
    const P a = load(t.v0), b = load(t.v1), c = load(t.v2), ab = b - a, ac = c - a;
    const P n{ab.y * ac.z - ab.z * ac.y, ab.z * ac.x - ab.x * ac.z, ab.x * ac.y - ab.y * ac.x};
    const Real n2 = dot(n, n), height = dot(n, q - a);
    const P foot = (q - a) - (height / n2) * n;
    const auto weight = [&](P u, P v) {
        const P w{u.y * v.z - u.z * v.y, u.z * v.x - u.x * v.z, u.x * v.y - u.y * v.x};
        return dot(w, n) / n2;
    };
    const Real v = weight(foot, ac), w = weight(ab, foot);
    if (n2 > 0 && v >= 0 && w >= 0 && v + w <= 1) return height * height / n2;
    return std::min(
        {square_to_segment(a, b, q), square_to_segment(b, c, q), square_to_segment(c, a, q)});
}

/// The distance along a line is convex: its least place by thirds, then the radius by halves.
struct Search {
    LeafTriangleD triangle;
    SphereSweepD sweep;

    [[nodiscard]] Real square(Real t) const {
        return square_to_triangle(triangle,
                                  load(sweep.path.origin) + t * load(sweep.path.direction));
    }
    /// The first contact in [0, end], or -1; `clearance`: how far the ball's way is from grazing.
    [[nodiscard]] Real run(Real end, Real& clearance) const {
        Real lo = 0, hi = end;
        for (int k = 0; k < 300; ++k) {
            const Real a = lo + (hi - lo) / 3, b = hi - (hi - lo) / 3;
            (square(a) <= square(b) ? hi : lo) = square(a) <= square(b) ? b : a;
        }
        clearance = std::fabs(std::sqrt(square(lo)) - Real(sweep.radius));
        const Real r2 = Real(sweep.radius) * sweep.radius;
        if (square(lo) > r2) return -1;
        Real out = 0, in = lo;
        if (square(0) <= r2) return 0;
        for (int k = 0; k < 200; ++k) (square((out + in) / 2) <= r2 ? in : out) = (out + in) / 2;
        return in;
    }
};

/// A triangle of 10 m, every third one a sliver of down to a nanometre, and a ball of 2 m to 4 nm
/// that comes near it; every eighth one touches from the start.
struct FarCase {
    MeshD mesh;
    SphereSweepD sweep;

    FarCase(RandomD& random, std::size_t i) {
        const Vec3d a = utm_place + 100.0 * random.direction(), along = 10.0 * random.direction();
        const double thin = i % 3 == 0 ? std::ldexp(1.0, -static_cast<int>(random.below(34))) : 1.0;
        mesh = {"", {a, a + along, a + 0.4 * along + thin * 5.0 * random.direction()}, {{0, 1, 2}}};
        const Vec3d start = a + 20.0 * random.direction();
        const Vec3d aim = a + random.unit() * along + 2.0 * random.direction();
        const double small = std::ldexp(1.0, 1 - static_cast<int>(random.below(30)));
        sweep = {{start, 0.0, aim - start}, i % 8 == 0 ? 30.0 : small};
    }
};

struct SweepTally {
    double worst_distance = 0, worst_place = 0;
    std::size_t contacts = 0, inside = 0, misses = 0, grazing = 0;
};

/// `wanted`: the time of the search; `clearance`: how far the ball is from grazing.
void check_contact(const FarCase& far, const SweepHitD& hit, Real wanted, Real clearance,
                   SweepTally& tally) {
    const LeafTriangleD t = corners(far.mesh, 0);
    const SphereSweepD& sweep = far.sweep;
    ++tally.contacts;
    const double distance = exact_distance(t, sweep.path, hit.t);
    if (hit.t == 0.0) {
        ++tally.inside;
        ASSERT_LE(distance, sweep.radius + 1e-12);
    } else {
        ASSERT_NEAR(distance, sweep.radius, 1e-12);
        tally.worst_distance = std::max(tally.worst_distance, std::fabs(distance - sweep.radius));
    }
    // A steep approach tells t as exactly as lengths; a flat one less.
    const P direction = load(sweep.path.direction);
    const auto off =
        static_cast<double>(std::fabs(wanted - hit.t) * std::sqrt(dot(direction, direction)));
    const double flat = std::sqrt(sweep.radius / static_cast<double>(clearance));
    ASSERT_LT(off, 1e-10 * std::max(1.0, flat));
    tally.worst_place = std::max(tally.worst_place, off);
    // The point of contact is rounded to where doubles are: steps of 9e-10.
    const Vec3d reach = hit.position - (sweep.path.origin + hit.t * sweep.path.direction);
    ASSERT_NEAR(std::sqrt(reach.x * reach.x + reach.y * reach.y + reach.z * reach.z), distance,
                4e-9);
    const Vec3d weighed = (hit.u * (t.v1 - t.v0) + hit.v * (t.v2 - t.v0)) + (t.v0 - hit.position);
    ASSERT_LT(std::fabs(weighed.x) + std::fabs(weighed.y) + std::fabs(weighed.z), 8e-9);
}

/// Where a step of float is half a metre and one of double a nanometre. Balls that graze are told
/// apart, no other case is.
TEST(DoubleSweeps, AreRightFarFromTheOrigin) {
    RandomD random(double_sweep_seed);
    SweepTally tally;
    for (std::size_t i = 0; i < 100 * thorough; ++i) {
        const FarCase far(random, i);
        if (has_zero_area(corners(far.mesh, 0))) continue;
        const SweepHitD hit = sweep_sphere(build_bvh(far.mesh), far.sweep);
        Real clearance;
        const Real wanted = Search{corners(far.mesh, 0), far.sweep}.run(8, clearance);
        if (clearance < 1e-8L) {
            ++tally.grazing;
            continue;
        }
        ASSERT_EQ(hit.hit(), wanted >= 0) << "case " << i;
        tally.misses += !hit.hit();
        if (hit.hit()) check_contact(far, hit, wanted, clearance, tally);
        ASSERT_FALSE(HasFatalFailure()) << "case " << i;
    }
    std::cout << tally.contacts << " contacts (" << tally.inside << " from the start), "
              << tally.misses << " misses, " << tally.grazing
              << " that graze; distances off by up to " << tally.worst_distance
              << ", places by up to " << tally.worst_place << "\n";
    EXPECT_GT(tally.contacts, 10 * thorough);
    EXPECT_GT(tally.inside, thorough);
    EXPECT_GT(tally.misses, thorough);
    EXPECT_LT(tally.grazing, 3 + thorough);
}

TEST(DoubleSweeps, TheFirstOfManyFarFromTheOrigin) {
    const MeshD mesh = in_double(random_soup(60, 5, 0.3f), 10.0, utm_place);
    const BvhD bvh = build_bvh(mesh);
    std::size_t contacts = 0;
    for (SphereSweepD sweep : sweeps_for(mesh, 10 * thorough)) {
        sweep.radius = std::max(sweep.radius, 1e-3);
        sweep.path.tmin = 0.0;
        sweep.path.tmax = 2.0;
        const Vec3d d = sweep.path.direction;
        if (max_of(max_of(std::fabs(d.x), std::fabs(d.y)), std::fabs(d.z)) > 1e3) continue;
        const SweepHitD hit = sweep_sphere(bvh, sweep);
        Real first = -1;
        bool clear = true;
        for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
            Real clearance;
            const Real t = Search{corners(mesh, i), sweep}.run(2, clearance);
            clear = clear && clearance > 1e-6L;
            if (t >= 0 && (first < 0 || t < first)) first = t;
        }
        if (!clear) continue;
        ASSERT_EQ(hit.hit(), first >= 0);
        contacts += hit.hit();
        if (hit.hit()) {
            ASSERT_NEAR(hit.t, static_cast<double>(first), 1e-6);
        }
    }
    EXPECT_GT(contacts, thorough);
}

TEST(DoubleSweeps, WithoutARadiusAreRays) {
    const MeshD mesh = in_double(random_soup(500, 6), 100.0, utm_place);
    const BvhD bvh = build_bvh(mesh);
    std::size_t hits = 0;
    for (const RayD& ray : mixed_rays(mesh, 100 * thorough, double_sweep_seed)) {
        const HitD wanted = closest_hit(bvh, ray);
        const SweepHitD hit = sweep_sphere(bvh, {ray, 0.0});
        ASSERT_EQ(hit.t, wanted.t);
        ASSERT_EQ(hit.prim, wanted.prim);
        hits += hit.hit();
    }
    EXPECT_GT(hits, thorough);
}

/// In whole numbers at the place, so that the answers are known to the last digit.
TEST(DoubleSweeps, KnownAnswers) {
    const Vec3d at = utm_place;
    const auto moved = [&](double x, double y, double z) { return at + Vec3d{x, y, z}; };
    const MeshD mesh{"", {moved(0, 0, 0), moved(1, 0, 0), moved(0, 1, 0)}, {{0, 1, 2}}};
    const BvhD bvh = build_bvh(mesh);
    const SweepHitD face = sweep_sphere(bvh, {{moved(0.25, 0.25, 3), 0, {0, 0, -1}}, 1});
    EXPECT_EQ(face.t, 2.0);
    EXPECT_TRUE(face.position == moved(0.25, 0.25, 0));
    EXPECT_EQ(face.u, 0.25);
    EXPECT_EQ(sweep_sphere(bvh, {{moved(0.25, 0.25, 3), 0, {0, 0, -0x1p-700}}, 1}).t, 0x1p701);
    EXPECT_EQ(sweep_sphere(bvh, {{moved(0.25, 0.25, 3), 0, {0, 0, -0x1p700}}, 1}).t, 0x1p-699);
    EXPECT_EQ(sweep_sphere(bvh, {{moved(0.25, 0.25, 0.5), 0.25, {0, 0, -1}}, 1}).t, 0.25);
    EXPECT_EQ(sweep_sphere(bvh, {{moved(-3, 0, 0), 0, {1, 0, 0}}, 0.5}).t, 2.5) << "a corner";
    EXPECT_EQ(sweep_sphere(bvh, {{moved(0.5, -3, 0), 0, {0, 2, 0}}, 0.5}).t, 1.25) << "an edge";
    EXPECT_FALSE(sweep_sphere(bvh, {{moved(0.25, 0.25, 3), 0, {0, 0, 1}}, 1}).hit());
    EXPECT_FALSE(sweep_sphere(bvh, {{moved(0.25, 0.25, 3), 0, {0, 0, -1}, 1.999}, 1}).hit());
    // A ball of a kilometre from a thousand kilometres away, and one of a micrometre.
    EXPECT_NEAR(sweep_sphere(bvh, {{moved(0.25, 0.25, 1e6), 0, {0, 0, -1}}, 1e3}).t, 999e3, 1e-9);
    EXPECT_NEAR(sweep_sphere(bvh, {{moved(0.25, 0.25, 3), 0, {0, 0, -1}}, 1e-6}).t, 3 - 1e-6,
                1e-15);
}

/// Triangles that are a segment or a point are met as such.
TEST(DoubleSweeps, TrianglesWithoutArea) {
    const Vec3d a = utm_place, b = utm_place + Vec3d{2, 0, 0};
    const BvhD segment = build_bvh(MeshD{"", {a, b, 0.5 * (a + b)}, {{0, 1, 2}}});
    const BvhD point = build_bvh(MeshD{"", {a, a, a}, {{0, 1, 2}}});
    const SphereSweepD sweep{{a + Vec3d{1.5, 5, 0}, 0, {0, -1, 0}}, 1};
    EXPECT_EQ(sweep_sphere(segment, sweep).t, 4.0);
    EXPECT_FALSE(sweep_sphere(point, sweep).hit());
    EXPECT_EQ(sweep_sphere(point, {{a + Vec3d{0, 5, 0}, 0, {0, -1, 0}}, 1}).t, 4.0);
    EXPECT_FALSE(sweep_sphere(segment, {sweep.path, 0.0}).hit()) << "rays go through";
}

TEST(DoubleSweeps, BadInput) {
    const MeshD mesh = random_soup_d(50, 10);
    const BvhD bvh = build_bvh(mesh), empty;
    const RayD good{{0, 0, 0}, 0, {0, 0, 1}};
    const std::vector<SphereSweepD> bad{{{{0, 0, 0}, 0, {0, 0, 0}}, 1},
                                        {{{nan, 0, 0}, 0, {0, 0, 1}}, 1},
                                        {{{0, 0, 0}, 0, {0, inf, 1}}, 1},
                                        {{{0, 0, 0}, 2, {0, 0, 1}, 1}, 1},
                                        {{{0, 0, 0}, 0, {0, 0, 1}, nan}, 1},
                                        {{{0, -2e150, 0}, 0, {0, 0, 1}}, 1},
                                        {good, -1},
                                        {good, nan},
                                        {good, inf},
                                        {good, 2e150}};
    std::vector<SweepHitD> hits(bad.size());
    const QueryCounts counts = sweep_spheres(bvh, bad, hits);
    EXPECT_EQ(counts.invalid_queries, bad.size());
    EXPECT_EQ(counts.found, 0u);
    for (const SweepHitD& hit : hits) EXPECT_FALSE(hit.hit());
    for (const SphereSweepD& sweep : bad) EXPECT_FALSE(sweep_sphere(bvh, sweep).hit());
    EXPECT_THROW(sweep_spheres(bvh, bad, std::span(hits).first(1)), InputError);
    EXPECT_FALSE(sweep_sphere(empty, {good, 1}).hit());
    EXPECT_TRUE(sweep_spheres(bvh, std::span<const SphereSweepD>{}).empty());
    // As large as may be: everything is touched from the start, or lies far behind.
    EXPECT_EQ(sweep_sphere(bvh, {{{1e149, 0, 0}, 0, {1, 0, 0}}, 1e150}).t, 0.0);
    EXPECT_FALSE(sweep_sphere(bvh, {{{1e150, 0, 0}, 0, {1, 0, 0}}, 1e100}).hit());
}

}  // namespace
}  // namespace raydix::test
