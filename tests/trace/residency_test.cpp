// How many lanes of each kernel the machines hold, worked out by hand, and what follows from it;
// how long a block keeps its place.
#include "trace/warp/residency.h"

#include <gtest/gtest.h>
#include <raydix/bvh.h>

#include <vector>

#include "support/ray_sets.h"
#include "support/scenes.h"
#include "support/support.h"

namespace raydix::test {
namespace {

MachineModel held(const char* machine, WarpKernel kernel, int width = 32) {
    return machine_for({.kernel = kernel, .machine = machine_model(machine), .width = width});
}

TEST(Residency, RegistersAndSharedMemoryByHand) {
    // 116 bytes a lane: 141 lanes of 16 KB are 4 warps, for a block of 192 does not fit; 423 of 48
    // KB are 3 blocks of 128.
    EXPECT_EQ(held("gtx285", WarpKernel::work_queue).resident_lanes, 128u);
    EXPECT_EQ(held("gtx285", WarpKernel::work_queue).block_lanes, 128u);
    EXPECT_EQ(held("gtx480", WarpKernel::work_queue).resident_lanes, 384u);
    EXPECT_EQ(held("gtx680", WarpKernel::work_queue).resident_lanes, 384u);
    // 65,536 registers by 40, 48, 72, 64 and 48 a thread, whole blocks of 128.
    EXPECT_EQ(held("h200", WarpKernel::while_while).resident_lanes, 1536u);
    EXPECT_EQ(held("h200", WarpKernel::persistent_packet).resident_lanes, 1280u);
    EXPECT_EQ(held("h100", WarpKernel::work_queue).resident_lanes, 896u);
    EXPECT_EQ(held("h200", WarpKernel::cwbvh).resident_lanes, 1024u);
    EXPECT_EQ(held("h200", WarpKernel::short_stack).resident_lanes, 1280u);
    for (const WarpKernel kernel : {WarpKernel::packet, WarpKernel::persistent_while_while}) {
        EXPECT_EQ(held("gtx285", kernel).resident_lanes, 768u);
        EXPECT_EQ(held("gtx480", kernel).resident_lanes, 1024u);
        EXPECT_EQ(held("gtx680", kernel).resident_lanes, 2048u);
    }
    // One warp at least, however wide.
    EXPECT_EQ(held("gtx285", WarpKernel::work_queue, 64).resident_lanes, 128u);
    MachineModel small = machine_model("gtx285");
    small.shared_bytes = 100;
    EXPECT_EQ(machine_for({.kernel = WarpKernel::work_queue, .machine = small}).resident_lanes,
              32u);
}

TEST(Residency, WhatBlocksShareIsTakenFromL1) {
    EXPECT_EQ(held("gtx480", WarpKernel::work_queue).l1_bytes, 65'536u - 384 * 116);
    EXPECT_EQ(held("gtx480", WarpKernel::while_while).l1_bytes, 48u * 1024);
    EXPECT_EQ(held("h200", WarpKernel::work_queue).l1_bytes, 262'144u - 896 * 116);
    EXPECT_EQ(held("gtx285", WarpKernel::work_queue).l1_bytes, 0u);
}

TEST(Residency, ABlockKeepsItsPlaceUntilItsLastWarpIsDone) {
    Mesh two_triangles;
    two_triangles.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {10, 0, 0}, {11, 0, 0}, {10, 1, 0}};
    two_triangles.triangles = {{0, 1, 2}, {3, 4, 5}};
    const WarpTree tree(build_bvh(two_triangles, {.max_leaf = 1}));
    SimulateOptions options{.kernel = WarpKernel::while_while, .machine = machine_model("gtx480")};
    options.machine.multiprocessors = 1;
    options.machine.lanes_per_clock = 32;
    options.machine.warp_issue_clocks = 2;  // two warps fill the machine
    options.machine.read_clocks = 0;
    options.machine.block_lanes = options.machine.resident_lanes = 64;
    const auto clocks = [&](const std::vector<Ray>& rays) {
        return simulate(tree, rays, std::span(&options, 1)).front();
    };
    const std::vector<Ray> hitting(32, Ray{{0.25f, 0.25f, 5}, 0, {0, 0, -1}, infinity}),
        missing(32, Ray{{5, 5, 5}, 0, {0, 0, -1}, infinity});
    const double longer = clocks(hitting).scheduled_clocks,
                 shorter = clocks(missing).scheduled_clocks;
    EXPECT_GT(longer, shorter + 10);
    std::vector<Ray> rays;
    for (int block = 0; block < 3; ++block) {
        rays.insert(rays.end(), hitting.begin(), hitting.end());
        rays.insert(rays.end(), missing.begin(), missing.end());
    }
    const Simulation all = clocks(rays);
    EXPECT_NEAR(all.scheduled_clocks, 3 * longer, 1e-6);
    // After the last block went out at 2 * longer, one slot in two is empty once its shorter warp
    // ends.
    EXPECT_NEAR(all.idle_issues, (longer - shorter) / 2, 1e-6);
}

TEST(Residency, WorkQueuesAreScheduledWithTheWarpsThatFit) {
    const Model scene = scene_of(random_soup(2000, 4, 0.1f), "soup");
    const WarpTree tree(build_bvh(scene.mesh()));
    const std::vector<Ray> rays = make_mixed_rays(scene, 1 << 16, 8);
    std::vector<SimulateOptions> runs(
        3, {.kernel = WarpKernel::work_queue, .machine = machine_model("gtx480"), .memory = true});
    runs[1].machine.resident_lanes = 384;
    runs[2].machine.shared_bytes = 0;
    const std::vector<Simulation> all = simulate(tree, rays, runs);
    EXPECT_EQ(all[0].scheduled_clocks, all[1].scheduled_clocks);
    EXPECT_NE(all[0].scheduled_clocks, all[2].scheduled_clocks);
    const auto latency = [&](std::size_t k) {
        for (const auto& limit : simulated_rates(all[k], runs[k]).memory_limits)
            if (limit.name == "latency") return limit.mrays_per_s;
        return 0.0;
    };
    EXPECT_EQ(latency(0), latency(1));
    EXPECT_LT(latency(0), latency(2));
}

}  // namespace
}  // namespace raydix::test
