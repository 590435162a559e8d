// Walks through 4- and 8-wide trees find what `scalar` finds, bit for bit, within the stack that
// the depth allows.
#include <gtest/gtest.h>
#include <raydix/raydix.h>
#include <raydix/trace.h>

#include <cstring>

#include "support/ray_sets.h"
#include "support/sanitized.h"
#include "support/scenes.h"
#include "support/support.h"
#include "support/wide_walk.h"
#include "trace/triangle_test.h"

namespace raydix::test {
namespace {

constexpr std::uint64_t wide_walk_seed = 48;

struct CountedVisits {
    std::uint64_t visits = 0;
    void visit() { ++visits; }
};

Hit closest(const Bvh& bvh, const WideTree& tree, const Ray& given, WideStack& stack,
            CountedVisits& steps) {
    if (!is_valid(given)) return {};
    const RayFrame ray = make_frame(given);
    Hit best = hit_of_tree({ray.tmax, no_primitive, 0, 0});
    const auto leaf = [&](const BvhNode& child) {
        for (std::uint32_t k = child.first; k < child.first + child.count; ++k) {
            TriangleHit hit;
            if (intersect_triangle<EdgeRule::closed>(ray, bvh.triangles()[k], best.t, hit) &&
                (hit.t < best.t || bvh.order()[k] < best.prim))
                best = hit_of_tree({hit.t, bvh.order()[k], hit.u, hit.v});
        }
        return false;
    };
    walk_wide(tree, bvh.bounds(), ray, stack, steps, leaf, [&] { return best.t; });
    return best.hit() ? hit_of_tree({best.t * ray.t_scale, best.prim, best.u, best.v}) : Hit{};
}

void expect_like_scalar(const Model& scene, const BuildOptions& options) {
    const Bvh bvh = build_bvh(scene.mesh(), options);
    const auto rays = make_mixed_rays(scene, fewer(2000 * thorough, 4), wide_walk_seed);
    std::vector<Hit> wanted(rays.size());
    const TraceCounts scalar = trace(bvh, rays, wanted, {.counters = true});
    std::uint64_t last = scalar.node_visits;
    for (const int width : {4, 8}) {
        const WideTree tree = collapse_to_wide(bvh, {.width = width, .max_leaf = 4});
        WideStack stack(tree);
        CountedVisits steps;
        std::uint64_t different = 0;
        for (std::size_t i = 0; i < rays.size(); ++i) {
            const Hit hit = closest(bvh, tree, rays[i], stack, steps);
            different += std::memcmp(&hit, &wanted[i], sizeof(hit)) != 0;
        }
        EXPECT_EQ(different, 0u) << scene.name << ", width " << width << ", seed "
                                 << wide_walk_seed;
        EXPECT_LT(steps.visits, last) << scene.name << ", width " << width;
        last = steps.visits;
    }
}

TEST(WideWalk, LikeScalar) {
    for (const int max_leaf : {1, 4}) {
        for (const Model& scene : builtin_triangle_scenes(fewer(5000, 4)))
            expect_like_scalar(scene, {.max_leaf = max_leaf});
        expect_like_scalar(scene_of(lattice_mesh(2000, 12, 5), "lattice"), {.max_leaf = max_leaf});
        expect_like_scalar(scene_of(random_soup(2000, 5, 0.5f), "soup"), {.max_leaf = max_leaf});
    }
}

}  // namespace
}  // namespace raydix::test
