// The padded box test must never lose a box that a ray meets, judged in long double, nor one that
// holds a triangle which the triangle test accepts.
#include "trace/slab.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <iostream>
#include <random>

#include "support/support.h"
#include "trace/host_slabs.h"
#include "trace/triangle_test.h"

namespace raydix::test {
namespace {

using Random = std::mt19937_64;
using Real = long double;

BvhNode node_of(const Aabb& box) { return {box.lo, 1, box.hi, 1}; }

struct Interval {
    Real entry, exit;
    [[nodiscard]] bool meets() const { return entry <= exit; }
};

/// Axis by axis, with no infinities: a component of 0 asks only whether the origin is in the slab.
Interval exact_interval(const Ray& ray, const Aabb& box) {
    Interval all{std::max(ray.tmin, 0.0f), ray.tmax};
    for (int axis = 0; axis < 3; ++axis) {
        const Real o = component(ray.origin, axis), d = component(ray.direction, axis);
        const Real lo = component(box.lo, axis), hi = component(box.hi, axis);
        if (d == 0) {
            if (o < lo || o > hi) return {1, 0};
            continue;
        }
        const Real a = (lo - o) / d, b = (hi - o) / d;
        all.entry = std::max(all.entry, std::min(a, b));
        all.exit = std::min(all.exit, std::max(a, b));
    }
    return all;
}

struct Cases {
    Random random;
    float scale, offset;

    float unit() { return static_cast<float>(random() >> 40) * 0x1p-24f; }
    /// Many equal values, so that planes coincide.
    float coordinate() {
        const float x = random() % 3 == 0 ? static_cast<float>(random() % 5) * 0.25f : unit();
        return x * scale + offset;
    }
    Vec3 point() { return {coordinate(), coordinate(), coordinate()}; }
    Aabb box() {
        const Vec3 a = point(), b = point();
        Aabb box{min_of(a, b), max_of(a, b)};
        if (random() % 3 == 0) box.hi.x = box.lo.x;
        if (random() % 3 == 0) box.hi.y = box.lo.y;
        if (random() % 3 == 0) box.hi.z = box.lo.z;
        return box;
    }
    /// Toward a corner, an edge, a face or the middle of the box; sometimes along an axis, with
    /// coordinates of the box itself.
    Ray ray_at(const Aabb& box) {
        const auto pick = [&](float lo, float hi) {
            const auto k = random() % 3;
            return k == 0 ? lo : k == 1 ? hi : lo + unit() * (hi - lo);
        };
        const Vec3 target{pick(box.lo.x, box.hi.x), pick(box.lo.y, box.hi.y),
                          pick(box.lo.z, box.hi.z)};
        Ray ray{point(), 0, {}, infinity};
        if (random() % 4 == 0) ray.origin = ray.origin * 1e3f;
        ray.direction = target - ray.origin;
        for (int axis = 0; axis < 3; ++axis) {
            if (random() % 4 != 0) continue;
            (&ray.origin.x)[axis] = component(target, axis);
            (&ray.direction.x)[axis] = random() % 2 ? 0.0f : -0.0f;
        }
        if (random() % 2 == 0) ray.direction = ray.direction * 0.001f;
        return ray;
    }
};

std::vector<Cases> all_cases(std::uint64_t seed) {
    std::cout << "seed " << seed << "\n";
    return {{Random(seed), 1, 0},         {Random(seed + 1), 1, 1e5f},
            {Random(seed + 2), 1e-6f, 0}, {Random(seed + 3), 1e6f, 0},
            {Random(seed + 4), 1e12f, 0}, {Random(seed + 5), 30, 5e6f}};
}

constexpr int rounds = static_cast<int>(20'000 * thorough);

TEST(Slab, NeverLosesABoxThatTheRayMeets) {
    for (Cases& cases : all_cases(71)) {
        int met = 0, missed = 0;
        for (int i = 0; i < rounds; ++i) {
            const Aabb box = cases.box();
            const Aabb root = i % 2 ? box : unite(box, cases.box());
            const Ray ray = cases.ray_at(box);
            if (!is_valid(ray)) continue;
            const RayFrame frame = make_frame(ray);
            const BvhNode node = node_of(box);
            const SlabInterval found =
                intersect_slabs(make_slab_frame(frame, root), &node.lo.x, frame.tmin, frame.tmax);
            const Interval exact = exact_interval(ray, box);
            if (!exact.meets()) {
                ++missed;
                continue;
            }
            ++met;
            ASSERT_LE(found.entry, found.exit) << i << ", scale " << cases.scale;
            ASSERT_LE(Real(found.entry) * Real(frame.t_scale), exact.entry) << i;
            ASSERT_GE(Real(found.exit) * Real(frame.t_scale), exact.exit) << i;
        }
        EXPECT_GT(met, rounds / 10);
        EXPECT_GT(missed, rounds / 100);
    }
}

/// Conservative does not mean always yes.
TEST(Slab, LosesBoxesThatTheRayClearlyMisses) {
    Cases cases{Random(5), 1, 0};
    int missed = 0;
    for (int i = 0; i < rounds; ++i) {
        const Aabb box = cases.box();
        const Ray ray{cases.point(), 0, cases.point() - cases.point(), 1};
        if (!is_valid(ray)) continue;
        constexpr float margin = 1e-5f;
        const Vec3 wide{margin, margin, margin};
        if (exact_interval(ray, {box.lo - wide, box.hi + wide}).meets()) continue;
        ++missed;
        const RayFrame frame = make_frame(ray);
        const BvhNode node = node_of(box);
        const SlabInterval found =
            intersect_slabs(make_slab_frame(frame, box), &node.lo.x, frame.tmin, frame.tmax);
        ASSERT_FALSE(found.entry <= found.exit) << i;
    }
    EXPECT_GT(missed, rounds / 4);
}

LeafTriangle triangle_in(Cases& cases) {
    LeafTriangle t{cases.point(), cases.point(), cases.point()};
    const auto shape = cases.random() % 4;
    if (shape == 1) t.v2 = 0.5f * (t.v0 + t.v1) + (t.v2 - t.v0) * 1e-4f;  // a sliver
    if (shape == 2) t.v2.x = t.v1.x = t.v0.x;                             // in an axis' plane
    if (shape == 3) t.v1 = t.v0 + (t.v1 - t.v0) * 1e-3f;                  // a needle
    return t;
}

/// Through a vertex, an edge or the middle.
Ray ray_at_triangle(Cases& cases, const LeafTriangle& t) {
    const Vec3 corners[] = {t.v0, t.v1, t.v2};
    const Vec3 &a = corners[cases.random() % 3], &b = corners[cases.random() % 3];
    const float along = cases.unit();
    const Vec3 target = a + (b - a) * along;
    Ray ray = cases.ray_at({target, target});
    if (cases.random() % 8 == 0) ray.direction = b - a;  // along the plane
    return ray;
}

/// A box may be skipped only if its entry is greater than the best t.
TEST(Slab, NeverLosesATriangleThatTheTestAccepts) {
    for (Cases& cases : all_cases(113)) {
        int accepted = 0, culled = 0;
        for (int i = 0; i < rounds; ++i) {
            const LeafTriangle t = triangle_in(cases);
            const Ray ray = ray_at_triangle(cases, t);
            if (!is_valid(ray)) continue;
            const RayFrame frame = make_frame(ray);
            TriangleHit hit;
            if (!intersect_triangle<EdgeRule::closed>(frame, t, frame.tmax, hit)) continue;
            ++accepted;
            const Aabb box = box_of(t.v0, t.v1, t.v2);
            const BvhNode node = node_of(box);
            const SlabInterval found =
                intersect_slabs(make_slab_frame(frame, box), &node.lo.x, frame.tmin, hit.t);
            if (found.entry <= found.exit) continue;
            if (++culled <= 5)
                std::cout << "case " << i << ": t " << hit.t << ", entry " << found.entry << "\n";
        }
        std::cout << "scale " << cases.scale << ", offset " << cases.offset << ": " << accepted
                  << " accepted, " << culled << " of them culled\n";
        EXPECT_GT(accepted, rounds / 20);
        EXPECT_EQ(culled, 0);
    }
}

/// The same for needles of any length, far and near, and for limits that are the hit itself: a box
/// around the hit's own point must not be lost, which is what trees of parts have.
TEST(Slab, NeverLosesThePointOfAHitOfANeedle) {
    constexpr std::uint64_t seed = 1515;
    Cases cases{Random(seed), 1.0f, 0.0f};
    int accepted = 0;
    for (int i = 0; i < 4 * rounds; ++i) {
        const auto power = [&](int least, int most) {
            return std::ldexp(
                1.0f + cases.unit(),
                least + static_cast<int>(cases.random() % static_cast<unsigned>(most - least + 1)));
        };
        const auto point = [&](float size) {
            return Vec3{(cases.unit() - 0.5f) * size, (cases.unit() - 0.5f) * size,
                        (cases.unit() - 0.5f) * size};
        };
        const float size = i % 8 == 0 ? power(-140, -30) : power(-10, 10);
        LeafTriangle t;
        t.v0 = point(size);
        t.v1 = t.v0 + point(size * power(0, 24));
        t.v2 = t.v0 + point(size);
        const float u = cases.unit(), v = (1.0f - u) * cases.unit();
        const Vec3 target = t.v0 * (1.0f - u - v) + t.v1 * u + t.v2 * v;
        Ray ray{point(size * power(0, 30)), 0, {}, infinity};
        ray.direction = target - ray.origin;
        if (!is_valid(ray)) continue;
        const RayFrame frame = make_frame(ray);
        TriangleHit hit;
        if (!intersect_triangle<EdgeRule::closed>(frame, t, frame.tmax, hit)) continue;
        ++accepted;
        const Aabb box = box_of(t.v0, t.v1, t.v2);
        const SlabFrame slabs = make_slab_frame(frame, box);
        // Outward, since the point itself is no float.
        const auto around = [&](float a, float b, float c, bool up) {
            const Real exact = a + (Real(b) - a) * hit.u + (Real(c) - a) * hit.v,
                       room = std::ldexp(Real(std::fabs(b - a) + std::fabs(c - a)), -24);
            const auto end = static_cast<float>(up ? exact + room : exact - room);
            return std::nextafter(end, up ? infinity : -infinity);
        };
        const auto corner = [&](bool up) {
            return Vec3{around(t.v0.x, t.v1.x, t.v2.x, up), around(t.v0.y, t.v1.y, t.v2.y, up),
                        around(t.v0.z, t.v1.z, t.v2.z, up)};
        };
        const BvhNode node = node_of({max_of(corner(false), box.lo), min_of(corner(true), box.hi)});
        const SlabInterval found = intersect_slabs(slabs, &node.lo.x, hit.t, hit.t);
        ASSERT_LE(found.entry, found.exit) << "seed " << seed << " case " << i;
    }
    EXPECT_GT(accepted, rounds);
}

TEST(Slab, PairGivesTheBitsOfTheSingleTest) {
    for (Cases& cases : all_cases(211)) {
        for (int i = 0; i < rounds / 10; ++i) {
            alignas(64) const BvhNode pair[2] = {node_of(cases.box()), node_of(cases.box())};
            const Aabb boxes[2] = {{pair[0].lo, pair[0].hi}, {pair[1].lo, pair[1].hi}};
            const Ray ray = cases.ray_at(boxes[i % 2]);
            if (!is_valid(ray)) continue;
            const RayFrame frame = make_frame(ray);
            const SlabFrame slabs = make_slab_frame(frame, unite(boxes[0], boxes[1]));
            const float reach = i % 3 == 0 ? 0.5f : frame.tmax;
            const PairInterval both = HostSlabs(slabs, frame.tmin).intersect(pair, reach);
            const float entries[] = {both.entry_a, both.entry_b};
            for (int k = 0; k < 2; ++k) {
                const SlabInterval one = intersect_slabs(slabs, &pair[k].lo.x, frame.tmin, reach);
                ASSERT_EQ(std::memcmp(&one.entry, &entries[k], sizeof(float)), 0) << i;
                ASSERT_EQ(both.hit >> k & 1, one.entry <= one.exit) << i;
            }
        }
    }
}

/// Pads keep planes away from a ray's start but where they end on it: 0 * Inf.
TEST(Slab, PairDropsPlanesOnWhichAParallelRayLies) {
    alignas(64) const BvhNode pair[2] = {node_of({{1, 2, 3}, {4, 5, 6}}),
                                         node_of({{-3, -2, -1}, {1, 2, 3}})};
    const Aabb bounds = unite({pair[0].lo, pair[0].hi}, {pair[1].lo, pair[1].hi});
    for (int axis = 0; axis < 3; ++axis)
        for (const float place : {component(pair[0].lo, axis), component(pair[0].hi, axis),
                                  component(pair[1].lo, axis)})
            for (const float zero : {0.0f, -0.0f}) {
                Ray ray{{0.5f, 0.5f, 0.5f}, 0, {1, 1, 1}, infinity};
                (&ray.origin.x)[axis] = place;
                (&ray.direction.x)[axis] = zero;
                const RayFrame frame = make_frame(ray);
                SlabFrame slabs = make_slab_frame(frame, bounds);
                (&slabs.near_pad.x)[axis] = 0.0f;
                (&slabs.far_pad.x)[axis] = 0.0f;
                const PairInterval both = HostSlabs(slabs, frame.tmin).intersect(pair, frame.tmax);
                const float entries[] = {both.entry_a, both.entry_b};
                for (int k = 0; k < 2; ++k) {
                    const SlabInterval one =
                        intersect_slabs(slabs, &pair[k].lo.x, frame.tmin, frame.tmax);
                    EXPECT_EQ(one.entry, entries[k]) << axis << " " << place << " " << k;
                    EXPECT_EQ(both.hit >> k & 1, one.entry <= one.exit)
                        << axis << " " << place << " " << k;
                }
            }
}

/// Fault of other libraries: 0 * Inf where a ray lies in a slab's plane.
TEST(Slab, FaultRayInASlabPlaneIsMissed) {
    const Aabb box{{1, 2, 3}, {4, 5, 6}};
    const BvhNode node = node_of(box);
    for (int along = 0; along < 3; ++along)
        for (const float sign : {1.0f, -1.0f})
            for (const float zero : {0.0f, -0.0f})
                for (int planes = 0; planes < 4; ++planes) {
                    Ray ray{{}, 0, {zero, zero, zero}, infinity};
                    (&ray.direction.x)[along] = sign;
                    (&ray.origin.x)[along] = sign > 0 ? -10.0f : 20.0f;
                    const int a = (along + 1) % 3, b = (along + 2) % 3;
                    (&ray.origin.x)[a] = component(planes & 1 ? box.hi : box.lo, a);
                    (&ray.origin.x)[b] = component(planes & 2 ? box.hi : box.lo, b);
                    const RayFrame frame = make_frame(ray);
                    const SlabInterval found = intersect_slabs(make_slab_frame(frame, box),
                                                               &node.lo.x, frame.tmin, frame.tmax);
                    EXPECT_LE(found.entry, found.exit) << along << " " << sign << " " << planes;
                }
}

}  // namespace
}  // namespace raydix::test
