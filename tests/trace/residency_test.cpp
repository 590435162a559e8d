// How many lanes of each kernel the machines hold, worked out by hand, and what follows from it.
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
