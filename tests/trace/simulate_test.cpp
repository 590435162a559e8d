// The simulator's figures: counts worked out by hand, costs that move only what uses them, the same
// figures for every thread count, pools under random delays.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <raydix/raydix.h>
#include <raydix/simulate.h>

#include <atomic>
#include <cstring>
#include <thread>

#include "simt/op.h"
#include "support/ray_sets.h"
#include "support/sanitized.h"
#include "support/scenes.h"
#include "support/support.h"
#include "trace/warp/prepare_rays.h"
#include "trace/warp/simulated_kernels.h"
#include "trace/warp/warp_scene.h"

namespace raydix::test {
namespace {

OperationFigure figure(const Simulation& s, Op op) {
    return s.operations[static_cast<std::size_t>(op)];
}

void expect_count(const Simulation& s, Op op, std::uint64_t issues, std::uint64_t lanes) {
    EXPECT_EQ(figure(s, op).issues, issues) << op_name(op);
    EXPECT_EQ(figure(s, op).lanes, lanes) << op_name(op);
}

/// Two triangles far apart along x, each a leaf.
Mesh two_triangles() {
    Mesh mesh;
    mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {10, 0, 0}, {11, 0, 0}, {10, 1, 0}};
    mesh.triangles = {{0, 1, 2}, {3, 4, 5}};
    return mesh;
}

Ray down(float x, float y) { return {{x, y, 5}, 0, {0, 0, -1}, infinity}; }

SimulateOptions options_for(WarpKernel kernel) {
    return {.kernel = kernel, .machine = machine_model("gtx480")};
}

TEST(Simulate, CountsOfWhileWhileByPencil) {
    const WarpTree tree(build_bvh(two_triangles(), {.max_leaf = 1}));
    // 8 rays hit triangle 0, 8 pass beside it within its box, 16 miss everything.
    std::vector<Ray> rays;
    for (int k = 0; k < 8; ++k) rays.push_back(down(0.25f, 0.25f));
    for (int k = 0; k < 8; ++k) rays.push_back(down(0.9f, 0.9f));
    for (int k = 0; k < 16; ++k) rays.push_back(down(5, 5));
    const std::vector<SimulateOptions> runs{options_for(WarpKernel::while_while)};
    std::vector<std::vector<TreeHit>> hits;
    const Simulation s = simulate(tree, rays, runs, &hits).front();
    EXPECT_EQ(s.hits, 8u);
    expect_count(s, Op::start_ray, 1, 32);
    expect_count(s, Op::main_loop, 1, 32);
    expect_count(s, Op::node_loop, 1, 32);
    expect_count(s, Op::visit_node, 1, 32);
    expect_count(s, Op::push, 0, 0);
    expect_count(s, Op::leaf_loop, 1, 16);
    expect_count(s, Op::test_triangle, 1, 16);
    expect_count(s, Op::test_edges, 1, 16);
    expect_count(s, Op::accept_hit, 1, 8);
    expect_count(s, Op::next_triangle, 1, 16);
    expect_count(s, Op::pop, 2, 32);  // the misses after the node, the others after the leaf
    expect_count(s, Op::store_hit, 1, 32);
    expect_count(s, Op::take_rays, 0, 0);
    std::uint64_t instructions = 0, lanes = 0;
    for (const OperationFigure& op : s.operations) {
        instructions += op.issues * op.instructions;
        lanes += op.lanes * op.instructions;
    }
    EXPECT_EQ(s.instructions, instructions);
    EXPECT_EQ(s.lane_instructions, lanes);
    const SimulatedRates rates = simulated_rates(s, runs.front());
    // 15 multiprocessors issue one instruction a clock at 1.401 GHz.
    EXPECT_NEAR(rates.bound, 32 / (double(instructions) / (15 * 1401.0)), 1e-9);
    EXPECT_NEAR(rates.simd_efficiency, double(lanes) / (double(instructions) * 32), 1e-12);
    // One warp alone issues every 22 clocks and waits for its ray, a node and a triangle twice.
    EXPECT_NEAR(s.scheduled_clocks, double(instructions) * 22 + 4 * 300, 1e-6);
}

TEST(Simulate, BothChildrenMeanOnePush) {
    const WarpTree tree(build_bvh(two_triangles(), {.max_leaf = 1}));
    const std::vector<Ray> rays(5, Ray{{-1, 0.25f, 0.0f}, 0, {1, 0, 0}, infinity});
    const std::vector<SimulateOptions> runs{options_for(WarpKernel::while_while),
                                            options_for(WarpKernel::packet)};
    const auto all = simulate(tree, rays, runs);
    expect_count(all[0], Op::push, 1, 5);
    expect_count(all[0], Op::visit_node, 1, 5);
    expect_count(all[0], Op::test_triangle, 2, 10);
    expect_count(all[0], Op::pop, 2, 10);
    expect_count(all[1], Op::visit_node, 1, 32);  // lanes without a ray go along
    expect_count(all[1], Op::test_triangle, 2, 64);
    expect_count(all[1], Op::pop, 1, 32);  // the packet's own stack, by all lanes
}

// Who fetches a ray depends on when its warp comes to the pool, and so on costs. Where one warp is
// resident, it fetches all.
TEST(Simulate, ADoubledCostMovesWhatUsesItOnly) {
    const Model scene = scene_of(random_soup(500, 3, 0.1f), "soup");
    const WarpTree tree(build_bvh(scene.mesh()), true);
    const std::vector<Ray> rays = make_mixed_rays(scene, 640, 3);
    std::vector<SimulateOptions> runs;
    for (const WarpKernel kernel : warp_kernels()) {
        runs.push_back(options_for(kernel));
        runs.back().machine.multiprocessors = 1;
        runs.back().machine.resident_lanes = runs.back().machine.block_lanes = 32;
    }
    const auto before = simulate(tree, rays, runs);
    for (std::size_t op = 0; op < op_count; ++op) {
        auto changed = runs;
        for (SimulateOptions& run : changed)
            for (OperationCost& cost : run.machine.costs)
                if (cost.operation == op_names[op]) cost.instructions *= 2, cost.most = 0;
        const auto after = simulate(tree, rays, changed);
        for (std::size_t k = 0; k < runs.size(); ++k) {
            const std::uint64_t extra =
                before[k].operations[op].issues * before[k].operations[op].instructions;
            EXPECT_EQ(after[k].instructions, before[k].instructions + extra) << op_names[op];
            for (std::size_t other = 0; other < op_count; ++other) {
                EXPECT_EQ(after[k].operations[other].issues, before[k].operations[other].issues);
                EXPECT_EQ(after[k].operations[other].lanes, before[k].operations[other].lanes);
            }
        }
    }
}

// With many warps in flight costs move who fetches which ray in the kernels that replace single
// rays, and so how full their warps are, but by little. In all others a batch is traced alike by
// whichever warp.
TEST(Simulate, ADoubledCostMovesNothingElseWhereManyWarpsFetch) {
    const Model scene = scene_of(random_soup(2000, 3, 0.1f), "soup");
    const WarpTree tree(build_bvh(scene.mesh()), true);
    const std::vector<Ray> rays = make_mixed_rays(scene, fewer(60000, 20), 3);
    std::vector<SimulateOptions> runs;
    for (const WarpKernel kernel : warp_kernels()) {
        runs.push_back(options_for(kernel));
        runs.back().machine.multiprocessors = 2;
    }
    const auto before = simulate(tree, rays, runs);
    for (SimulateOptions& run : runs)
        for (OperationCost& cost : run.machine.costs)
            if (cost.operation == op_names[std::size_t(Op::visit_node)])
                cost.instructions *= 2, cost.most = 0;
    const auto after = simulate(tree, rays, runs);
    bool moved = false;
    for (std::size_t k = 0; k < runs.size(); ++k) {
        const WarpKernel kernel = runs[k].kernel;
        const bool replaces = kernel == WarpKernel::ray_replacement ||
                              kernel == WarpKernel::work_queue ||
                              kernel == WarpKernel::dynamic_fetch;
        for (std::size_t op = 0; op < op_count; ++op) {
            const auto a = double(before[k].operations[op].issues),
                       b = double(after[k].operations[op].issues);
            EXPECT_NEAR(b, a, replaces ? 0.01 * a + 10 : 0.0)
                << warp_kernel_name(kernel) << ", " << op_names[op];
            moved |= a != b;
        }
    }
    EXPECT_TRUE(moved);
}

TEST(Simulate, OneLaneHasFullEfficiencyAndWidthsAgree) {
    const Model scene = scene_of(random_soup(2000, 9, 0.1f), "soup");
    const WarpTree tree(build_bvh(scene.mesh()));
    const std::vector<Ray> rays = make_mixed_rays(scene, 64 * 20, 3);
    for (const WarpKernel kernel : {WarpKernel::while_while, WarpKernel::if_if}) {
        std::vector<SimulateOptions> runs;
        for (const int width : {1, 2, 4, 8, 16, 32, 64, 128}) {
            runs.push_back(options_for(kernel));
            runs.back().width = width;
        }
        const auto all = simulate(tree, rays, runs);
        EXPECT_DOUBLE_EQ(simulated_rates(all.front(), runs.front()).simd_efficiency, 1.0);
        // What a ray does is its own affair: sums over lanes do not depend on the width.
        for (std::size_t k = 1; k < all.size(); ++k) {
            for (const Op op : {Op::visit_node, Op::push, Op::test_triangle, Op::test_edges,
                                Op::accept_hit, Op::next_triangle, Op::pop})
                EXPECT_EQ(figure(all[k], op).lanes, figure(all.front(), op).lanes) << op_name(op);
            EXPECT_LE(all[k].instructions, all[k - 1].instructions);
            EXPECT_LE(simulated_rates(all[k], runs[k]).simd_efficiency,
                      simulated_rates(all[k - 1], runs[k - 1]).simd_efficiency);
        }
    }
}

/// Instructions of one warp in which all rays hit, or all miss.
double warp_instructions(const WarpTree& tree, SimulateOptions options, Ray ray) {
    const std::vector<Ray> rays(32, ray);
    return static_cast<double>(simulate(tree, rays, std::span(&options, 1)).front().instructions);
}

TEST(Simulate, StepsFromBoundToScheduledByPencil) {
    const WarpTree tree(build_bvh(two_triangles(), {.max_leaf = 1}));
    SimulateOptions options = options_for(WarpKernel::while_while);
    options.machine.multiprocessors = 1;
    options.machine.lanes_per_clock = 64;  // two slots a clock: no warp slows another down
    options.machine.warp_issue_clocks = 1;
    options.machine.read_clocks = 0;
    options.machine.resident_lanes = 64;
    options.machine.block_lanes = 32;
    for (OperationCost& cost : options.machine.costs)
        if (cost.operation == "test_triangle") cost.instructions = 500, cost.most = 0;
    const Ray hitting = down(0.25f, 0.25f), missing = down(5, 5);
    const double longer = warp_instructions(tree, options, hitting),
                 shorter = warp_instructions(tree, options, missing);
    ASSERT_LT(3 * shorter, longer);
    std::vector<Ray> rays(32, hitting);
    for (int warp = 0; warp < 3; ++warp) rays.insert(rays.end(), 32, missing);
    const auto clocks = [&](BlockRelease release) {
        options.machine.block_release = release;
        return simulate(tree, rays, std::span(&options, 1)).front();
    };
    // The short ones follow each other beside the long one, if that is allowed.
    const Simulation own = clocks(BlockRelease::own);
    EXPECT_DOUBLE_EQ(own.scheduled_clocks, longer);
    EXPECT_DOUBLE_EQ(own.free_block_clocks, own.scheduled_clocks);
    // Else two of them start when the long one, the first, is done.
    for (const BlockRelease release : {BlockRelease::in_order, BlockRelease::together}) {
        const Simulation s = clocks(release);
        EXPECT_DOUBLE_EQ(s.scheduled_clocks, longer + shorter);
        EXPECT_DOUBLE_EQ(s.free_block_clocks, own.scheduled_clocks);
        EXPECT_DOUBLE_EQ(s.single_warp_clocks, own.scheduled_clocks);
        EXPECT_EQ(s.instructions, own.instructions);
    }
    // Blocks of two: the long one keeps the place of the short one beside it.
    options.machine.block_lanes = 64;
    const Simulation blocks = clocks(BlockRelease::own);
    EXPECT_DOUBLE_EQ(blocks.scheduled_clocks, longer + shorter);
    EXPECT_DOUBLE_EQ(blocks.single_warp_clocks, longer);
    // Persistent warps fetch at their own time, so that no release holds them up.
    options.kernel = WarpKernel::persistent_while_while;
    const Simulation persistent = clocks(BlockRelease::together);
    EXPECT_DOUBLE_EQ(persistent.scheduled_clocks, clocks(BlockRelease::own).scheduled_clocks);
    EXPECT_DOUBLE_EQ(persistent.single_warp_clocks, persistent.scheduled_clocks);
}

TEST(Simulate, StacksInLocalMemoryDelayKernelsThatHaveThem) {
    const WarpTree tree(build_bvh(two_triangles(), {.max_leaf = 1}));
    const std::vector<Ray> rays(5, Ray{{-1, 0.25f, 0.0f}, 0, {1, 0, 0}, infinity});
    std::vector<SimulateOptions> runs{options_for(WarpKernel::while_while),
                                      options_for(WarpKernel::packet)};
    const auto before = simulate(tree, rays, runs);
    for (SimulateOptions& run : runs) run.machine.stack_read_clocks = 1000;
    const auto after = simulate(tree, rays, runs);
    EXPECT_NEAR(after[0].scheduled_clocks, before[0].scheduled_clocks + 2 * 1000, 1e-6);
    EXPECT_NEAR(after[1].scheduled_clocks, before[1].scheduled_clocks, 1e-6);
}

bool same(const Simulation& a, const Simulation& b) {
    bool equal = a.instructions == b.instructions && a.lane_instructions == b.lane_instructions &&
                 a.scheduled_clocks == b.scheduled_clocks && a.idle_issues == b.idle_issues &&
                 a.warp_times == b.warp_times && a.l1_transactions == b.l1_transactions &&
                 a.l2_bytes == b.l2_bytes && a.dram_bytes == b.dram_bytes &&
                 a.replays == b.replays && a.texture_fetches == b.texture_fetches &&
                 a.memory_wait_clocks == b.memory_wait_clocks && a.hits == b.hits;
    for (std::size_t k = 0; k < a.operations.size(); ++k)
        equal = equal && a.operations[k].issues == b.operations[k].issues &&
                a.operations[k].lanes == b.operations[k].lanes;
    return equal;
}

/// Runs that trace the same batches share them; with the memory model each run traces its own.
TEST(Simulate, SharedBatchesCostWhatTheyCostAlone) {
    const Model scene = scene_of(random_soup(2000, 4, 0.1f), "soup");
    const WarpTree tree(build_bvh(scene.mesh()), true);
    const std::vector<Ray> rays = make_mixed_rays(scene, fewer(1500, 6), 8);
    std::vector<SimulateOptions> runs;
    for (const char* machine : {"gtx285", "h200"})
        for (const WarpKernel kernel : warp_kernels())
            for (const int width : {8, 32})
                for (const bool any : {false, true})
                    runs.push_back({.kernel = kernel,
                                    .machine = machine_model(machine),
                                    .width = width,
                                    .any_hit = any});
    std::vector<std::vector<TreeHit>> hits, own_hits;
    const std::vector<Simulation> together = simulate(tree, rays, runs, &hits);
    for (std::size_t k = 0; k < runs.size(); ++k) {
        const std::string name = std::string(warp_kernel_name(runs[k].kernel)) + " on " +
                                 runs[k].machine.name + ", run " + std::to_string(k);
        const Simulation alone = simulate(tree, rays, std::span(&runs[k], 1)).front();
        EXPECT_TRUE(same(alone, together[k])) << name;
        SimulateOptions watched = runs[k];
        watched.memory = true;
        const Simulation own = simulate(tree, rays, std::span(&watched, 1), &own_hits).front();
        EXPECT_EQ(own.instructions, together[k].instructions) << name;
        EXPECT_EQ(own.lane_instructions, together[k].lane_instructions) << name;
        EXPECT_EQ(own.scheduled_clocks, together[k].scheduled_clocks) << name;
        EXPECT_EQ(own.warp_times, together[k].warp_times) << name;
        for (std::size_t i = 0; i < rays.size(); ++i) {
            ASSERT_EQ(own_hits[0][i].hit(), hits[k][i].hit()) << name << ", ray " << i;
            if (runs[k].any_hit) continue;
            ASSERT_EQ(std::memcmp(&own_hits[0][i], &hits[k][i], sizeof(TreeHit)), 0)
                << name << ", ray " << i;
        }
    }
}

TEST(Simulate, FiguresDoNotDependOnThreads) {
    const Model scene = scene_of(random_soup(3000, 4, 0.1f), "soup");
    const WarpTree tree(build_bvh(scene.mesh()), true);
    const std::vector<Ray> rays = make_mixed_rays(scene, 1000 * thorough, 8);
    std::vector<SimulateOptions> runs;
    for (const WarpKernel kernel : warp_kernels())
        for (const bool any_hit : {false, true}) {
            runs.push_back(options_for(kernel));
            runs.back().any_hit = any_hit;
            runs.back().memory = kernel == WarpKernel::while_while;
        }
    const auto one = simulate(tree, rays, runs, nullptr, 1);
    for (const int threads : {2, 7}) {
        const auto many = simulate(tree, rays, runs, nullptr, threads);
        for (std::size_t k = 0; k < runs.size(); ++k)
            EXPECT_TRUE(same(one[k], many[k])) << warp_kernel_name(runs[k].kernel);
    }
}

TEST(Simulate, WhatHalfOfTheLanesExecuteTakesTwice) {
    const Model scene = scene_of(random_soup(500, 4, 0.1f), "soup");
    const WarpTree tree(build_bvh(scene.mesh()));
    const std::vector<Ray> rays = make_mixed_rays(scene, 4096, 8);
    SimulateOptions run = options_for(WarpKernel::while_while);
    run.memory = true;
    const auto limit = [&] {
        const Simulation s = simulate(tree, rays, std::span(&run, 1)).front();
        const SimulatedRates rates = simulated_rates(s, run);
        for (const SimulatedRates::Limit& l : rates.memory_limits)
            if (l.name == "half_rate") return l.mrays_per_s / rates.bound;
        return 0.0;
    };
    EXPECT_EQ(limit(), 0.0);  // a machine that has none
    for (OperationCost& cost : run.machine.costs) cost.most = 0, cost.half_rate = cost.instructions;
    EXPECT_NEAR(limit(), 0.5, 1e-12);
    for (OperationCost& cost : run.machine.costs) cost.instructions = 4, cost.half_rate = 1;
    EXPECT_NEAR(limit(), 2.0, 1e-12);
}

TEST(Simulate, PersistentFormsDifferByTheirFetchesOnly) {
    const Model scene = scene_of(random_soup(2000, 4, 0.1f), "soup");
    const WarpTree tree(build_bvh(scene.mesh()));
    const std::vector<Ray> rays = make_mixed_rays(scene, 64 * 32, 8);
    std::vector<SimulateOptions> runs{options_for(WarpKernel::while_while),
                                      options_for(WarpKernel::persistent_while_while)};
    // On a machine with room for far more warps than there are batches, too.
    runs[1].machine.resident_lanes = 1u << 15;
    for (const double part : {1.0, 0.001}) {
        runs[1].part_of_launch = part;
        const auto all = simulate(tree, rays, runs);
        for (std::size_t op = 0; op < op_count; ++op) {
            if (Op(op) == Op::take_rays || Op(op) == Op::shuffle) continue;
            EXPECT_EQ(all[0].operations[op].issues, all[1].operations[op].issues) << op_names[op];
            EXPECT_EQ(all[0].operations[op].lanes, all[1].operations[op].lanes) << op_names[op];
        }
        // 64 batches, and each warp comes once in vain.
        EXPECT_LE(figure(all[1], Op::take_rays).issues, 64u + 64);
    }
}

/// A sum over all that a memory model is told.
struct ToldAccesses final : MemoryObserver {
    std::uint64_t sum = 0;

    void add(std::uint64_t value) { sum = sum * 0x9E3779B97F4A7C15u + value; }
    void access(const void* const* addresses, std::uint32_t lanes, std::uint32_t bytes,
                Access how) override {
        for (std::uint32_t l = 0; l < lanes; ++l)
            add(reinterpret_cast<std::uintptr_t>(addresses[l]));
        add(bytes), add(static_cast<std::uint64_t>(how));
    }
    void stack(const std::int32_t* entries, std::uint32_t lanes, Access how) override {
        for (std::uint32_t l = 0; l < lanes; ++l) add(static_cast<std::uint64_t>(entries[l]));
        add(static_cast<std::uint64_t>(how));
    }
};

TEST(Simulate, BothVersionsOfTheCodeGiveTheSameBits) {
    if (simulated_kernel(WarpKernel::packet, false, 32, SimulatorIsa::v3) == nullptr)
        GTEST_SKIP() << "no AVX2 and FMA here";
    const Model scene = scene_of(random_soup(1000, 4, 0.1f), "soup");
    const WarpTree tree(build_bvh(scene.mesh()), true);
    const PreparedRays rays(make_mixed_rays(scene, 640, 8));
    std::vector<TreeHit> hits(640);
    const auto compare = [&](WarpKernel name, bool any_hit, int width) {
        SCOPED_TRACE(fmt::format("{}, {}, {} lanes", warp_kernel_name(name),
                                 any_hit ? "any hit" : "closest hit", width));
        std::vector<TreeHit> first;
        std::vector<OpCounts> counts;
        std::vector<std::uint64_t> told;
        const std::uint32_t entries = tree.arrays().stack_entries(name);
        // The same memory, too: the observer is told of stacks that travel.
        Buffer<std::byte> memory(
            simulated_kernel(name, any_hit, width, SimulatorIsa::base)->warp_bytes(entries));
        for (const SimulatorIsa isa : {SimulatorIsa::base, SimulatorIsa::v3}) {
            const SimulatedKernel& kernel = *simulated_kernel(name, any_hit, width, isa);
            OpCounts tally{};
            ToldAccesses observer;
            std::uint32_t next = 0;
            hits.assign(640, {});  // the same array, of which the observer is told
            const WarpJob job{scene_of(tree), {rays.rays().data(), hits.data(), 640, &next}};
            kernel.start_warp(memory.data(), {&tally, &observer, entries});
            for (int warp = 0; warp < 640 / width; ++warp) {
                KernelState state;
                kernel.start_kernel(state);
                while (kernel.turn(memory.data(), state, job, static_cast<std::uint32_t>(warp))) {
                }
            }
            counts.push_back(tally);
            told.push_back(observer.sum);
            if (first.empty()) first = hits;
        }
        EXPECT_EQ(counts[0], counts[1]);
        EXPECT_EQ(told[0], told[1]);
        EXPECT_EQ(std::memcmp(first.data(), hits.data(), 640 * sizeof(TreeHit)), 0);
    };
    for (const WarpKernel name : warp_kernels())
        for (const bool any_hit : {false, true}) compare(name, any_hit, 32);
    for (const int width : {8, 16, 64, 128})
        for (const bool any_hit : {false, true}) compare(WarpKernel::packet, any_hit, width);
}

/// Warps on real threads that wait at random between turns, on one pool.
TEST(Simulate, PoolsLoseAndRepeatNoRayWhateverTheDelays) {
    const Model scene = scene_of(random_soup(1000, 4, 0.1f), "soup");
    const WarpTree tree(build_bvh(scene.mesh()));
    std::vector<Ray> some = make_mixed_rays(scene, 977, 8);
    for (std::size_t i = 0; i < some.size(); i += 3) some[i].tmax = 0.0f;  // very short lives
    const PreparedRays rays(some);
    const auto count = static_cast<std::uint32_t>(some.size());
    std::vector<TreeHit> expected(count);
    trace_reference(tree, some, expected);
    const std::vector<SimulateOptions> reference_run{options_for(WarpKernel::while_while)};
    const std::uint64_t visits =
        figure(simulate(tree, some, reference_run).front(), Op::visit_node).lanes;
    for (const WarpKernel name :
         {WarpKernel::persistent_while_while, WarpKernel::ray_replacement, WarpKernel::work_queue,
          WarpKernel::dynamic_fetch, WarpKernel::persistent_packet}) {
        SCOPED_TRACE(warp_kernel_name(name));
        const SimulatedKernel& kernel = *simulated_kernel(name, false, 8);
        constexpr int warps = 6;
        std::vector<OpCounts> tallies(warps);
        std::vector<TreeHit> hits(count, TreeHit{-5.0f, 7u, 0, 0});
        std::uint32_t next = 0;
        const WarpJob job{scene_of(tree), {rays.rays().data(), hits.data(), count, &next}};
        std::vector<std::thread> threads;
        for (int w = 0; w < warps; ++w)
            threads.emplace_back([&, w] {
                std::mt19937 random(static_cast<unsigned>(w) + 100u);
                Buffer<std::byte> memory(kernel.warp_bytes(tree.max_depth() + 1));
                kernel.start_warp(memory.data(), {&tallies[w], nullptr, tree.max_depth() + 1});
                KernelState state;
                kernel.start_kernel(state);
                while (kernel.turn(memory.data(), state, job, static_cast<std::uint32_t>(w)))
                    if (random() % 4 == 0)
                        std::this_thread::sleep_for(std::chrono::microseconds(random() % 200));
            });
        for (std::thread& thread : threads) thread.join();
        rays.rescale(hits);
        std::uint64_t visited = 0;
        for (const OpCounts& tally : tallies)
            visited += tally[static_cast<std::size_t>(Op::visit_node)].lanes;
        if (name != WarpKernel::dynamic_fetch && name != WarpKernel::persistent_packet) {
            EXPECT_EQ(visited, visits) << "a ray was lost or traced twice";
        }
        for (std::uint32_t i = 0; i < count; ++i)
            ASSERT_EQ(std::memcmp(&hits[i], &expected[i], sizeof(TreeHit)), 0) << i;
    }
}

TEST(Simulate, EmptyTreesAndNoRays) {
    const WarpTree nothing(build_bvh(Mesh{}));
    std::vector<SimulateOptions> runs;
    for (const WarpKernel kernel : warp_kernels()) runs.push_back(options_for(kernel));
    const std::vector<Ray> rays(3, down(0, 0));
    std::vector<std::vector<TreeHit>> hits;
    for (const Simulation& s : simulate(nothing, rays, runs, &hits)) {
        EXPECT_EQ(s.rays, 3u);
        EXPECT_EQ(s.hits, 0u);
    }
    for (const auto& row : hits)
        for (const TreeHit& hit : row) EXPECT_FALSE(hit.hit());
    const WarpTree tree(build_bvh(two_triangles()), true);
    for (const Simulation& s : simulate(tree, {}, runs)) EXPECT_EQ(s.rays, 0u);
}

TEST(Simulate, SumsBeginAnywhereAndTakeNothing) {
    const WarpTree tree(build_bvh(two_triangles()));
    const SimulateOptions options = options_for(WarpKernel::while_while);
    const std::vector<Ray> rays(3, down(0, 0));
    const Simulation one = simulate(tree, rays, std::span(&options, 1)).front();
    Simulation sum;
    sum.add(Simulation{});
    sum.add(one);
    sum.add(Simulation{});
    sum.add(one);
    EXPECT_EQ(sum.rays, 2 * one.rays);
    EXPECT_EQ(sum.instructions, 2 * one.instructions);
    EXPECT_EQ(sum.operations.size(), one.operations.size());
}

TEST(Simulate, RefusesWhatItCannotRun) {
    const WarpTree tree(build_bvh(two_triangles()));
    const auto refuse = [&](const char* word, auto change) {
        SimulateOptions options = options_for(WarpKernel::packet);
        change(options);
        try {
            static_cast<void>(simulate(tree, {}, std::span(&options, 1)));
            FAIL() << word;
        } catch (const InputError& error) {
            EXPECT_NE(std::string(error.what()).find(word), std::string::npos) << error.what();
        }
    };
    refuse("width", [](SimulateOptions& o) { o.width = 3; });
    refuse("width", [](SimulateOptions& o) { o.width = 256; });
    refuse("part_of_launch", [](SimulateOptions& o) { o.part_of_launch = 0; });
    refuse("part_of_launch", [](SimulateOptions& o) { o.part_of_launch = 1.5; });
    refuse("clock_ghz", [](SimulateOptions& o) { o.machine.clock_ghz = 0; });
    refuse("multiprocessors", [](SimulateOptions& o) { o.machine.multiprocessors = 0; });
    refuse("read_clocks", [](SimulateOptions& o) { o.machine.read_clocks = -1; });
    refuse("block_release", [](SimulateOptions& o) { o.machine.block_release = BlockRelease(7); });
    refuse("in flight", [](SimulateOptions& o) { o.machine.resident_lanes = 1u << 30; });
    refuse("most of 'push' is 3; it must be at least its instructions, 9", [](SimulateOptions& o) {
        for (OperationCost& cost : o.machine.costs)
            if (cost.operation == "push") cost.instructions = 9, cost.most = 3;
    });
    refuse("half_rate of 'push' is 10; it must be at most its instructions, 9",
           [](SimulateOptions& o) {
               for (OperationCost& cost : o.machine.costs)
                   if (cost.operation == "push") cost.instructions = 9, cost.half_rate = 10;
           });
    refuse("block_lanes is 4096; it must be at most resident_lanes, 1024",
           [](SimulateOptions& o) { o.machine.block_lanes = 4096; });
    refuse("resident_lanes is 16; it must be a multiple of the warp's width, 32",
           [](SimulateOptions& o) { o.machine.resident_lanes = o.machine.block_lanes = 16; });
    refuse("resident_lanes is 200; it must be a multiple of the warp's width, 16",
           [](SimulateOptions& o) { o.machine.resident_lanes = 200, o.width = 16; });
    refuse("has no cost", [](SimulateOptions& o) {
        std::erase_if(o.machine.costs,
                      [](const OperationCost& cost) { return cost.operation == "visit_node"; });
    });
    const auto refuse_memory = [&](const char* word, auto change) {
        refuse(word, [&](SimulateOptions& o) {
            o.memory = true;
            change(o.machine);
        });
    };
    refuse_memory("l1_line_bytes is 8192; it must be a multiple of 32 and at most 4096",
                  [](MachineModel& m) { m.l1_line_bytes = 8192; });
    refuse_memory("l1_line_bytes is 100", [](MachineModel& m) { m.l1_line_bytes = 100; });
    refuse_memory("dram_clocks", [](MachineModel& m) { m.dram_clocks = -1; });
    refuse_memory("texture_clocks", [](MachineModel& m) { m.texture_clocks = std::nan(""); });
    refuse_memory("l1_clocks", [](MachineModel& m) { m.l1_clocks = 1e10; });
    refuse_memory("l2_clocks", [](MachineModel& m) { m.l2_clocks = -infinity; });
    refuse_memory("texture_fetches_per_clock",
                  [](MachineModel& m) { m.texture_fetches_per_clock = -1; });
    refuse_memory("texture_fetches_per_clock is 0; it must be from 1e-6", [](MachineModel& m) {
        m.texture_bytes = 4096;
        m.texture_fetches_per_clock = 0;
    });
    refuse("clock_ghz is 1e-308; it must be from 1e-6 to 1e15",
           [](SimulateOptions& o) { o.machine.clock_ghz = 1e-308; });
    refuse("multiprocessors is 0; it must be above 0",
           [](SimulateOptions& o) { o.machine.multiprocessors = 0; });
    refuse("two costs", [](SimulateOptions& o) { o.machine.costs.push_back(o.machine.costs[0]); });
    refuse("no operation", [](SimulateOptions& o) { o.machine.costs[0].operation = "jump"; });
    EXPECT_THROW(static_cast<void>(machine_model("gtx1")), InputError);
    EXPECT_THROW(static_cast<void>(warp_kernel_from_name("while")), InputError);
    EXPECT_THROW(WarpTree(build_bvh(std::vector<Vec3>{{0, 0, 0}})), InputError);
}

}  // namespace
}  // namespace raydix::test
