// Rays in double through geometry of the caller's own: what is asked of the function, what is taken
// from it, and that boxes are entered as early as is promised.
#include <gtest/gtest.h>
#include <raydix/raydix.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <iostream>
#include <limits>

#include "support/double_scenes.h"
#include "support/support.h"

namespace raydix::test {
namespace {

constexpr std::uint64_t seed = 20240229;
constexpr double inf = std::numeric_limits<double>::infinity();
constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr Builder builders[] = {Builder::karras, Builder::ploc, Builder::binned, Builder::sweep};

TEST(UserGeometryDouble, IsWhatTheFunctionSays) {
    // Walls at x = far + prim, seen by a function that knows no boxes; the last two tie.
    constexpr double far = 4.5e6;
    std::vector<AabbD> boxes;
    for (int i = 0; i < 5; ++i) boxes.push_back({{far + i, -1, -1}, {far + i, 1, 1}});
    boxes.push_back(boxes[2]);
    std::atomic<int> calls{0};
    const IntersectPrimitiveD wall = [&](std::uint32_t prim, const RayD& ray, HitD& hit) {
        ++calls;
        if (prim < 2) return false;  // says no, whatever the box
        hit.t = (far + (prim == 5 ? 2 : prim) - ray.origin.x) / ray.direction.x;
        hit.u = 0.25;
        return true;
    };
    const BoxBvhD bvh = build_bvh(boxes, {.max_leaf = 1});
    const RayD ray{{far - 10, 0, 0}, 0, {2, 0, 0}};
    EXPECT_EQ(closest_hit(bvh, wall, ray), hit_of_tree(TreeHitD{6.0, 2, 0.25, 0.0}))
        << "the lower id wins";
    EXPECT_GT(calls.load(), 0);
    const auto limited = [&](double tmin, double tmax) {
        return closest_hit(bvh, wall, {ray.origin, tmin, ray.direction, tmax});
    };
    EXPECT_FALSE(limited(0, 5.5).hit());
    EXPECT_TRUE(limited(0, 6.0).hit()) << "closed";
    EXPECT_EQ(limited(6.0, 9.0).prim, 2u);
    EXPECT_EQ(limited(6.4, inf).prim, 3u);
    EXPECT_EQ(limited(-5.0, inf).prim, 2u);
    EXPECT_FALSE(closest_hit(bvh, wall, {{far - 10, 5, 0}, 0, {2, 0, 0}}).hit())
        << "beside all boxes";
    EXPECT_TRUE(any_hit(bvh, wall, ray));
    // Answers outside the ray, or NaN, are no hits.
    const IntersectPrimitiveD liar = [](std::uint32_t prim, const RayD&, HitD& h) {
        h.t = prim == 0 ? -5.0 : prim == 1 ? nan : inf;
        return true;
    };
    EXPECT_FALSE(any_hit(bvh, liar, {ray.origin, 0, {2, 0, 0}, 100}));
    // What it throws comes out, from whatever thread.
    const IntersectPrimitiveD thrower = [](std::uint32_t, const RayD&, HitD&) -> bool {
        throw InputError("mine");
    };
    const std::vector<RayD> rays(2000, ray);
    std::vector<HitD> hits(rays.size());
    std::vector<std::uint8_t> occluded(rays.size());
    for (const int threads : {1, 2, 7}) {
        EXPECT_THROW(trace(bvh, thrower, rays, hits, {.threads = threads}), InputError);
        EXPECT_THROW(trace_any(bvh, thrower, rays, occluded, {.threads = threads}), InputError);
    }
    EXPECT_THROW(static_cast<void>(closest_hit(bvh, thrower, ray)), InputError);
    EXPECT_THROW(trace(bvh, wall, rays, std::span(hits).first(3)), InputError);
    EXPECT_THROW(trace_any(bvh, wall, rays, std::span(occluded).first(3)), InputError);
    EXPECT_EQ(trace(BoxBvhD(), wall, rays, hits).hits, 0u);
    EXPECT_FALSE(hits[0].hit());
    const std::vector<RayD> bad{{{nan, 0, 0}, 0, {1, 0, 0}}};
    EXPECT_EQ(trace(bvh, wall, bad, std::span(hits).first(1)).invalid_rays, 1u);
    const TraceCounts counts = trace(bvh, wall, rays, hits, {.counters = true});
    EXPECT_EQ(counts.rays, rays.size());
    EXPECT_EQ(counts.hits, rays.size());
    EXPECT_GE(counts.triangle_tests, rays.size());
    EXPECT_EQ(trace(bvh, wall, rays, hits).triangle_tests, 0u);
}

TEST(UserGeometryDouble, FewBoxes) {
    const IntersectPrimitiveD at_one = [](std::uint32_t, const RayD&, HitD& h) {
        h.t = 1.0;
        return true;
    };
    const RayD ray{{5, 5, 4}, 0, {0, 0, 1}};
    for (const Builder builder : builders) {
        EXPECT_FALSE(any_hit(build_bvh(std::vector<AabbD>{}, {.builder = builder}), at_one, ray));
        for (const std::size_t n : {1u, 2u, 50u}) {
            const std::vector<AabbD> equal(n, {{5, 5, 5}, {5, 5, 5}});
            const BoxBvhD bvh = build_bvh(equal, {.builder = builder});
            EXPECT_EQ(closest_hit(bvh, at_one, ray), hit_of_tree(TreeHitD{1.0, 0, 0.0, 0.0}));
        }
    }
}

using Wide = long double;

double magnitude(Vec3d p) { return max_of(max_of(std::fabs(p.x), std::fabs(p.y)), std::fabs(p.z)); }

/// The longest distance along an axis from the origin to the far side.
double far_side(const AabbD& box, Vec3d o) {
    return std::max(magnitude(box.lo - o), magnitude(box.hi - o));
}

/// A function that goes as far as is promised: its hits are where the ray enters or leaves the box
/// made larger, and t is off. Different primitives say different things.
struct Liar {
    std::span<const AabbD> boxes;
    AabbD bounds;

    bool operator()(std::uint32_t prim, const RayD& ray, HitD& hit) const {
        const AabbD& box = boxes[prim];
        const Wide room =
            0.99L * 0x1p-44L *
            (std::max(magnitude(box.lo), magnitude(box.hi)) + Wide(far_side(bounds, ray.origin)));
        Wide enter = 0.0L, leave = std::numeric_limits<Wide>::infinity();
        const auto axis = [&](double lo, double hi, double o, double d) {
            if (d == 0.0) {
                if (lo - room > o || hi + room < o) leave = -1.0L;
                return;
            }
            const Wide a = (lo - room - o) / d, b = (hi + room - o) / d;
            enter = std::max(enter, std::min(a, b));
            leave = std::min(leave, std::max(a, b));
        };
        axis(box.lo.x, box.hi.x, ray.origin.x, ray.direction.x);
        axis(box.lo.y, box.hi.y, ray.origin.y, ray.direction.y);
        axis(box.lo.z, box.hi.z, ray.origin.z, ray.direction.z);
        if (!(enter <= leave)) return false;
        const Wide off = 0.99L * 0x1p-41L;
        hit.t = static_cast<double>(prim % 3 == 0   ? enter * (1 - off)
                                    : prim % 3 == 1 ? leave * (1 + off)
                                                    : enter + (leave - enter) / 2);
        if (hit.t < ray.tmin && prim % 2 == 0) hit.t = static_cast<double>(leave * (1 + off));
        return hit.t >= ray.tmin && hit.t <= ray.tmax;
    }
};

/// Most boxes are points at one place, the tree's center, where floats take nothing away: no node
/// is larger there than it was made.
std::vector<AabbD> boxes_around(Vec3d place, double size, RandomD& random) {
    std::vector<AabbD> boxes(80, {place, place});
    for (int i = 0; i < 39; ++i) {
        const Vec3d lo = place + size * random.in({{-1, -1, -1}, {1, 1, 1}});
        boxes.push_back({lo, lo + 0.1 * size * random.in({{0, 0, 0}, {1, 1, 1}})});
        if (i % 3 == 0) boxes.back().lo.x = place.x, boxes.back().hi.x = place.x + size;
        if (i % 3 == 1) boxes.back().hi.y = place.y, boxes.back().lo.y = place.y - size;
    }
    return boxes;
}

TEST(UserGeometryDouble, NodesAreEnteredAsEarlyAsPromised) {
    RandomD random(seed);
    std::size_t hits = 0;
    for (const auto& [place, size] : {std::pair{Vec3d{0, 0, 0}, 1.0},
                                      {utm_place, 1.0},
                                      {Vec3d{0.4e12, -0.7e12, 0.1e12}, 1e11}}) {
        const std::vector<AabbD> boxes = boxes_around(place, size, random);
        const BoxBvhD any_tree = build_bvh(boxes);
        EXPECT_EQ(any_tree.center(), place);
        const Liar liar{boxes, any_tree.bounds()};
        std::vector<RayD> rays;
        for (std::size_t i = 0; i < 200 * thorough; ++i) {
            const AabbD& box = boxes[random.below(boxes.size())];
            const Vec3d corner{i & 1 ? box.lo.x : box.hi.x, i & 2 ? box.lo.y : box.hi.y,
                               i & 4 ? box.lo.z : box.hi.z};
            const double distance = size * std::ldexp(1.0, static_cast<int>(random.below(20)) - 6);
            Vec3d d = random.direction();
            if (i % 5 == 0) d = {0, 0, 1};
            if (i % 5 == 1) d.x = 0.0;
            // Past the corner by about what is promised.
            const double beside = 0x1p-44 * (magnitude(corner) + distance + size);
            const Vec3d aim = corner + beside * random.in({{-2, -2, -2}, {2, 2, 2}});
            RayD ray{aim - distance * d, 0, d * std::ldexp(1.0, static_cast<int>(i % 7) - 3)};
            // Limits that a hit just meets.
            HitD hit;
            if (i % 3 != 0 && liar(static_cast<std::uint32_t>(random.below(80)), ray, hit))
                (i % 3 == 1 ? ray.tmin : ray.tmax) = hit.t;
            rays.push_back(ray);
        }
        const IntersectPrimitiveD intersect = liar;
        std::vector<HitD> wanted(rays.size());
        for (std::size_t i = 0; i < rays.size(); ++i) {
            for (std::uint32_t prim = 0; prim < boxes.size(); ++prim) {
                HitD hit;
                if (intersect(prim, rays[i], hit) && hit.t < wanted[i].t)
                    wanted[i] = hit_of_tree(TreeHitD{hit.t, prim, hit.u, hit.v});
            }
            hits += wanted[i].hit();
        }
        for (const Builder builder : builders)
            for (const int max_leaf : {1, 3}) {
                const BoxBvhD bvh = build_bvh(boxes, {.builder = builder, .max_leaf = max_leaf});
                std::vector<HitD> found(rays.size());
                trace(bvh, intersect, rays, found);
                std::size_t wrong = 0;
                for (std::size_t i = 0; i < rays.size(); ++i) wrong += found[i] != wanted[i];
                EXPECT_EQ(wrong, 0u) << builder_name(builder) << ' ' << max_leaf << ' ' << place.x
                                     << ", seed " << seed;
            }
    }
    std::cout << hits << " hits\n";
    EXPECT_GT(hits, 50 * thorough);
}

/// Two primitives one behind the other, whose t are off so that the farther one is hit first.
TEST(UserGeometryDouble, TMayBeOff) {
    constexpr double off = 0x1p-41;
    std::vector<AabbD> boxes;
    for (const double z : {10.0 * (1 - 0.9 * off), 10.0}) boxes.push_back({{0, 0, z}, {0, 0, z}});
    const IntersectPrimitiveD intersect = [&](std::uint32_t prim, const RayD&, HitD& hit) {
        hit.t = 10.0 * (1 - (prim == 0 ? 0.9 : 0.99) * off);
        return true;
    };
    for (const Builder builder : builders) {
        const BoxBvhD bvh = build_bvh(boxes, {.builder = builder, .max_leaf = 1});
        EXPECT_EQ(closest_hit(bvh, intersect, {{0, 0, 0}, 0, {0, 0, 1}}).prim, 1u);
    }
}

}  // namespace
}  // namespace raydix::test
