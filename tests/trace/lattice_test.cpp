// Thousands of tiny scenes on a lattice of small integers, where everything happens at once: equal
// distances, coplanar and overlapping triangles, shared edges, zero areas, rays in planes and
// through vertices. The tree must agree with every triangle tested by itself.
#include <gtest/gtest.h>
#include <raydix/raydix.h>
#include <raydix/trace.h>

#include <algorithm>
#include <iostream>
#include <random>

#include "primitives/sources.h"
#include "support/bits.h"
#include "support/scenes.h"
#include "support/support.h"
#include "trace/triangle_test.h"

namespace raydix::test {
namespace {

using Random = std::mt19937_64;

/// Integer origins and directions; some between lattice points, some with limits that are hit
/// exactly.
Ray lattice_ray(Random& random, int side) {
    const auto whole = [&](int lo, int hi) {
        return static_cast<float>(lo +
                                  static_cast<int>(random() % static_cast<unsigned>(hi - lo + 1)));
    };
    const float step = random() % 4 == 0 ? 0.5f : 1.0f;
    const auto place = [&] { return step * whole(-2, 2 * side); };
    Ray ray{{place(), place(), place()}, 0, {whole(-2, 2), whole(-2, 2), whole(-2, 2)}, infinity};
    if (random() % 8 == 0) ray.tmax = whole(0, side);
    if (random() % 8 == 0) ray.tmin = whole(-1, 2);
    return ray;
}

std::vector<Hit> all_by_hand(const Mesh& mesh, const Ray& ray) {
    std::vector<Hit> hits;
    if (!is_valid(ray)) return hits;
    const RayFrame frame = make_frame(ray);
    const TriangleSource source{mesh.vertices.data(), mesh.triangles.data(), mesh.vertices.size()};
    for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i) {
        TriangleHit hit;
        const LeafTriangle triangle{source.corner(i, 0), source.corner(i, 1), source.corner(i, 2)};
        if (intersect_triangle<EdgeRule::half_open>(frame, triangle, frame.tmax, hit))
            hits.push_back(hit_of_tree({hit.t * frame.t_scale, i, hit.u, hit.v}));
    }
    std::ranges::stable_sort(hits, {}, &Hit::t);  // ids ascend already
    return hits;
}

struct Totals {
    std::uint64_t rays = 0, hits = 0, crossings = 0, ties = 0, invalid = 0;
};

void try_scene(Random& random, int round, Totals& totals) {
    const int side = 1 + static_cast<int>(random() % 4);
    const Mesh mesh = lattice_mesh(1 + random() % 20, side, random());
    std::vector<Ray> rays;
    for (int i = 0; i < 64; ++i) rays.push_back(lattice_ray(random, side));
    const int leaves[] = {1, 2, 4, 255};
    const Bvh bvh = build_bvh(
        mesh, {.bits = round % 2 ? 30 : 63, .max_leaf = leaves[random() % 4], .threads = 1});
    std::vector<Hit> ours(rays.size());
    const TraceCounts counts = trace(bvh, rays, ours, {.threads = 1});
    const std::vector<Hit> wanted = trace_brute_force(mesh, rays, 1);
    const AllHits all = trace_all(bvh, rays, {.threads = 1});
    for (std::size_t i = 0; i < rays.size(); ++i) {
        ASSERT_TRUE(same_bits(ours[i], wanted[i]))
            << "round " << round << ", ray " << i << ": " << ours[i].prim << " at " << ours[i].t
            << ", wanted " << wanted[i].prim << " at " << wanted[i].t;
        const auto by_hand = all_by_hand(mesh, rays[i]);
        const std::span<const Hit> found(all.hits.data() + all.offsets[i],
                                         all.offsets[i + 1] - all.offsets[i]);
        ASSERT_TRUE(std::ranges::equal(found, by_hand, same_bits))
            << "round " << round << ", ray " << i << ": " << found.size() << " crossings, wanted "
            << by_hand.size();
        totals.hits += ours[i].hit();
        totals.crossings += found.size();
        for (std::size_t k = 1; k < found.size(); ++k) totals.ties += found[k].t == found[k - 1].t;
    }
    totals.rays += rays.size();
    totals.invalid += counts.invalid_rays;
}

TEST(Lattice, TinyScenesLikeBruteForce) {
    constexpr std::uint64_t seed = 99;
    constexpr int rounds = static_cast<int>(500 * thorough);
    Random random(seed);
    Totals totals;
    for (int round = 0; round < rounds && !testing::Test::HasFatalFailure(); ++round)
        try_scene(random, round, totals);
    std::cout << rounds << " lattice scenes: " << totals.rays << " rays, " << totals.hits
              << " hits, " << totals.crossings << " crossings, " << totals.ties << " ties, "
              << totals.invalid << " invalid, 0 wrong (seed " << seed << ")\n";
    EXPECT_GT(totals.hits, totals.rays / 20);
    EXPECT_GT(totals.ties, totals.rays / 100);
    EXPECT_GT(totals.invalid, 0u);
}

}  // namespace
}  // namespace raydix::test
