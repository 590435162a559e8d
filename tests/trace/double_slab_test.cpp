// Boxes against rays in double: the host's two at once as one by one, bit for bit; and no box that
// holds a point of the ray is missed, whatever rounding the way to the tree's center took.
#include <gtest/gtest.h>

#include <bit>
#include <cmath>

#include "support/double_scenes.h"
#include "trace/double_tree.h"
#include "trace/host_slabs.h"
#include "tree/around_center.h"

namespace raydix::test {
namespace {

constexpr std::uint64_t double_slab_seed = 20130613;

std::uint64_t bits(double x) { return std::bit_cast<std::uint64_t>(x); }

/// Two nodes in a row, as trees have them.
struct alignas(64) NodePair {
    BvhNode a, b;
};

BvhNode node_of(const Aabb& box) { return {box.lo, 7u, box.hi, 3u}; }

Aabb random_box(RandomD& random) {
    const auto number = [&] { return static_cast<float>(random.between(-3, 3)); };
    const Vec3 p{number(), number(), number()}, q{number(), number(), number()};
    return {min_of(p, q), max_of(p, q)};
}

RayD random_ray(RandomD& random) {
    RayD ray{random.in({{-4, -4, -4}, {4, 4, 4}}), 0.0, random.direction()};
    if (random.below(3) == 0) ray.direction.x = random.below(2) != 0 ? 0.0 : -0.0;
    if (random.below(3) == 0) ray.direction.y = random.below(2) != 0 ? 0.0 : -0.0;
    if (random.below(4) == 0) ray.tmin = random.unit();
    if (random.below(4) == 0) ray.tmax = 3.0 * random.unit() + ray.tmin;
    return ray;
}

TEST(DoubleSlabs, TwoAtOnceAsOneByOne) {
    RandomD random(double_slab_seed);
    std::size_t met = 0;
    for (int i = 0; i < 100'000; ++i) {
        const NodePair pair{node_of(random_box(random)), node_of(random_box(random))};
        RayD given = random_ray(random);
        if (i % 5 == 0) given.origin.x = pair.a.lo.x;  // in a plane: 0 * Inf if parallel to it
        if (i % 7 == 0) given.origin.y = pair.b.hi.y;
        const RayFrameD ray = make_frame(given);
        const SlabFrameD slabs =
            make_slab_frame(ray, unite({pair.a.lo, pair.a.hi}, {pair.b.lo, pair.b.hi}));
        const PairIntervalD both = HostSlabsD(slabs, ray.tmin).intersect(&pair.a, ray.tmax);
        const auto a = intersect_slabs(slabs, &pair.a.lo.x, ray.tmin, ray.tmax);
        const auto b = intersect_slabs(slabs, &pair.b.lo.x, ray.tmin, ray.tmax);
        ASSERT_EQ(both.hit, (a.entry <= a.exit ? 1 : 0) | (b.entry <= b.exit ? 2 : 0)) << i;
        ASSERT_EQ(bits(both.entry_a), bits(a.entry)) << i;
        ASSERT_EQ(bits(both.entry_b), bits(b.entry)) << i;
        met += static_cast<std::size_t>(std::popcount(static_cast<unsigned>(both.hit)));
    }
    EXPECT_GT(met, 10'000u);
}

/// A box of one point, at which a ray is aimed from far away: it must be entered, and not after the
/// ray is there.
TEST(DoubleSlabs, NoPointIsMissedOnTheWayToTheCenter) {
    RandomD random(double_slab_seed);
    for (int i = 0; i < 100'000; ++i) {
        const Vec3d center = 1e6 * random.direction();
        const double scale = i % 2 != 0 ? 0.5 : 1.0;
        const Vec3d p =
            center + std::ldexp(1.0, static_cast<int>(random.below(20))) * random.direction();
        const Vec3d from = i % 3 == 0 ? p + 1e9 * random.direction()
                                      : p + 10.0 * random.unit() * random.direction();
        const RayD given{from, 0.0, p - from};
        const RayFrameD ray = make_frame(given);
        RayFrameD local = ray;  // as TriangleTreeD::local has it
        local.origin = TreeSpace{center, scale}.local(ray.origin);
        local.inverse = ray.inverse * (1.0 / scale);
        const BvhNode node = node_of(box_around_center({p, p}, center, scale));
        const auto interval = intersect_slabs(make_slab_frame(local, {node.lo, node.hi}),
                                              &node.lo.x, ray.tmin, ray.tmax);
        ASSERT_LE(interval.entry, interval.exit) << "seed " << double_slab_seed << " case " << i;
        ASSERT_LE(interval.entry * ray.t_scale, 1.0) << i;
    }
}

}  // namespace
}  // namespace raydix::test
