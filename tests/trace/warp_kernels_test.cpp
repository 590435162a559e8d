// Every warp kernel at every width gives the hits of the scalar reference, bit for bit, and counts
// each ray once.
#include <gtest/gtest.h>

#include <raydix/error.h>
#include <raydix/raydix.h>
#include <raydix/simulate.h>

#include <cstring>
#include <span>
#include <utility>
#include <vector>

#include "support/ray_sets.h"
#include "support/scenes.h"
#include "support/support.h"
#include "trace/warp/simulated_kernels.h"

namespace raydix::test {
namespace {

constexpr int widths[] = {1, 2, 4, 8, 16, 32, 64, 128};

/// A small machine with few warps, so that pools are shared by many fetches.
MachineModel small_machine() {
    MachineModel m = machine_model("gtx480");
    m.multiprocessors = 3;
    m.resident_lanes = 256;
    m.block_lanes = 64;
    return m;
}

std::vector<SimulateOptions> every_run(bool any_hit) {
    std::vector<SimulateOptions> runs;
    for (const WarpKernel kernel : warp_kernels())
        for (const int width : widths)
            runs.push_back(
                {.kernel = kernel, .machine = small_machine(), .width = width, .any_hit = any_hit});
    return runs;
}

void expect_hits_of_the_reference(const Model& scene, std::size_t count, int max_leaf) {
    const std::vector<Ray> rays = make_mixed_rays(scene, count, 7);
    const Bvh bvh = build_bvh(scene.mesh(), {.builder = Builder::ploc, .max_leaf = max_leaf});
    const WarpTree tree(bvh, true);
    for (const bool any_hit : {false, true}) {
        std::vector<TreeHit> expected(rays.size());
        trace_reference(tree, rays, expected, any_hit);
        const std::vector<SimulateOptions> runs = every_run(any_hit);
        std::vector<std::vector<TreeHit>> hits;
        const std::vector<Simulation> figures = simulate(tree, rays, runs, &hits);
        for (std::size_t k = 0; k < runs.size(); ++k) {
            SCOPED_TRACE(std::string(warp_kernel_name(runs[k].kernel)) + " width " +
                         std::to_string(runs[k].width) + (any_hit ? " any" : " closest"));
            std::size_t different = 0;
            for (std::size_t i = 0; i < rays.size(); ++i)
                different += any_hit ? hits[k][i].hit() != expected[i].hit()
                                     : std::memcmp(&hits[k][i], &expected[i], sizeof(TreeHit)) != 0;
            EXPECT_EQ(different, 0u);
            EXPECT_EQ(figures[k].rays, rays.size());
        }
    }
}

TEST(WarpKernels, GiveTheReferencesHits) {
    const Model scene = scene_of(random_soup(3000, 5, 0.1f), "soup");
    for (const int max_leaf : {1, 4, 16}) expect_hits_of_the_reference(scene, 1501, max_leaf);
}

/// Woop's test errs with the size of coordinates, not with the distance of a ray.
TEST(WarpKernels, GiveTheReferencesHitsFarFromTheOrigin) {
    for (const Vec3 place : {Vec3{1e5f, 1e5f, 1e5f}, Vec3{448262.0f, 5411932.0f, 100.0f}}) {
        Mesh mesh = random_soup(1000, 5, 0.1f);
        for (Vec3& v : mesh.vertices) v = 100.0f * v + place;
        expect_hits_of_the_reference(scene_of(std::move(mesh), "far soup"), 4000, 4);
    }
}

TEST(WarpKernels, WideNodesAreThereIfAskedFor) {
    const Bvh bvh = build_bvh(random_soup(10, 5, 0.1f));
    EXPECT_FALSE(WarpTree(bvh).has_wide_nodes());
    EXPECT_TRUE(WarpTree(bvh, true).has_wide_nodes());
    const SimulateOptions run{.kernel = WarpKernel::cwbvh, .machine = small_machine()};
    const std::vector<Ray> rays(3);
    EXPECT_THROW(static_cast<void>(simulate(WarpTree(bvh), rays, std::span(&run, 1))), InputError);
}

}  // namespace
}  // namespace raydix::test
