// ThreadWarp as on a GPU, with 32 threads as the lanes of a warp: nested votes and masks, mistakes
// that must not go unseen, and every kernel's hits against the scalar reference.
#include "simt/thread_warp.h"

#include <gtest/gtest.h>
#include <raydix/simulate.h>

#include <cstring>
#include <memory>
#include <thread>

#include "support/ray_sets.h"
#include "support/scenes.h"
#include "support/support.h"
#include "support/thread_lanes.h"
#include "trace/warp/kernel_list.h"
#include "trace/warp/prepare_rays.h"
#include "trace/warp/warp_scene.h"

namespace raydix::test {
namespace {

using namespace std::chrono_literals;
constexpr LaneMask all_lanes = 0xFFFFFFFFu;

struct Count {
    std::uint32_t left = 0, turns = 0;
};
using CountingWarp = ThreadWarp<Count, ThreadLane>;

/// body(warp) in each lane; the fault, or "".
template <class Body>
std::string fault_of(const Body& body) {
    LaneBoard board(300ms);
    try {
        board.run([&](std::uint32_t lane) {
            ThreadLane::State state{&board, lane, {}};
            CountingWarp warp;
            warp.hardware.state = &state;
            body(warp);
        });
    } catch (const BrokenWarp& fault) {
        return fault.what();
    }
    return "";
}

bool has_left(const Count& c) { return c.left != 0; }

TEST(ThreadWarp, VotesCountTheMembersOfEachLoop) {
    std::array<std::uint32_t, 32> outer_turns{}, inner_turns{};
    const std::string fault = fault_of([&](CountingWarp& warp) {
        const std::uint32_t lane = warp.lane_id();
        warp.lane.left = lane % 4;
        warp.voting_loop(
            Op::main_loop, has_left,
            [&] {
                const LaneMask in = warp.ballot(Op::ballot, has_left);
                for (std::uint32_t k = 0; k < 32; ++k)
                    if ((in >> k & 1) != 0 && k % 4 <= outer_turns[lane]) ADD_FAILURE() << k;
                ++outer_turns[lane];
                std::uint32_t inner = lane % 3;
                warp.voting_loop(
                    Op::node_loop, [&](const Count&) { return inner != 0; },
                    [&] { --inner, ++inner_turns[lane]; },
                    [&] { return warp.any(Op::vote, [&](const Count&) { return inner != 0; }); });
                --warp.lane.left;
            },
            [] { return true; });
        EXPECT_EQ(warp.ballot(Op::ballot, [](const Count&) { return true; }), all_lanes);
    });
    EXPECT_EQ(fault, "");
    for (std::uint32_t lane = 0; lane < 32; ++lane) {
        EXPECT_EQ(outer_turns[lane], lane % 4) << lane;
        EXPECT_EQ(inner_turns[lane], lane % 4 * (lane % 3)) << lane;
    }
}

TEST(ThreadWarp, AmongAndSharedMemory) {
    std::array<std::uint32_t, 32> shared{};
    std::uint32_t counter = 5, told = 0;
    const std::string fault = fault_of([&](CountingWarp& warp) {
        const std::uint32_t lane = warp.lane_id();
        warp.among(0x0000FF00u, [&] {
            EXPECT_EQ(warp.ballot(Op::ballot, [](const Count&) { return true; }), 0x0000FF00u);
            shared[lane - 8] = lane;
            // The first member takes for the others.
            EXPECT_EQ(warp.take(Op::take_rays, counter, 8), 5u);
        });
        EXPECT_EQ(shared[lane % 8], lane % 8 + 8);
        EXPECT_EQ(warp.take(Op::take_rays, counter, 32), 13u);
        warp.write_shared(Op::push, [&] { told = lane + 100; });
        EXPECT_EQ(told, 100u);
        warp.write_shared(Op::push, [&] { told = lane + 200; });
        EXPECT_EQ(told, 200u);
    });
    EXPECT_EQ(fault, "");
    EXPECT_EQ(counter, 45u);
}

TEST(ThreadWarp, AVoteThatNotAllMembersComeToIsSeen) {
    // The others go on to a meeting of all: nobody can come on.
    const std::string hang = fault_of([](CountingWarp& warp) {
        const auto odd = [&](const Count&) { return warp.lane_id() % 2 == 1; };
        warp.when(odd, [&] { static_cast<void>(warp.any(Op::vote, has_left)); });
        warp.meet();
    });
    EXPECT_NE(hang.find("lane"), std::string::npos) << hang;
    // The others end.
    const std::string end = fault_of([](CountingWarp& warp) {
        const auto odd = [&](const Count&) { return warp.lane_id() % 2 == 1; };
        warp.when(odd, [&] { static_cast<void>(warp.any(Op::vote, has_left)); });
    });
    EXPECT_NE(end.find("ended"), std::string::npos) << end;
    // Some wait with one set of members, some with another.
    const std::string other = fault_of([](CountingWarp& warp) {
        if (warp.lane_id() < 16)
            warp.hardware.meet(all_lanes);
        else
            warp.hardware.meet(0xFFFF8000u);
        warp.hardware.meet(all_lanes);
    });
    EXPECT_NE(other.find("no lane has come on"), std::string::npos) << other;
}

TEST(ThreadWarp, WrongMembersAreSeen) {
    const std::string stranger = fault_of(
        [](CountingWarp& warp) { static_cast<void>(warp.hardware.ballot(0x7FFFFFFFu, true)); });
    EXPECT_NE(stranger.find("no member of its own"), std::string::npos) << stranger;
    const std::string mixed = fault_of([](CountingWarp& warp) {
        if (warp.lane_id() == 7)
            warp.hardware.meet(all_lanes);
        else
            static_cast<void>(warp.hardware.ballot(all_lanes, true));
    });
    EXPECT_NE(mixed.find("lane 7"), std::string::npos) << mixed;
    const std::string asked = fault_of(
        [](CountingWarp& warp) { static_cast<void>(warp.hardware.broadcast(0xFFFFFF00u, 1, 3)); });
    EXPECT_NE(asked.find("asks lane 3"), std::string::npos) << asked;
}

/// One warp's lanes, with the memory that a block would give it.
template <class Kernel, bool any_hit>
void run_lanes(const WarpJob& job, std::uint32_t warp_index, std::uint32_t stack_entries) {
    using OneLane = typename LaneOf<Kernel>::Type;
    struct Spares {
        std::array<OneLane, thread_lanes> lanes{};
        std::array<std::uint32_t, thread_lanes> slots{};
    };
    Spares spares;
    std::vector<std::int32_t> packets(stack_entries);
    std::vector<std::int32_t> stacks(std::size_t{2} * thread_lanes * stack_entries);
    LaneBoard board(60s);
    board.run([&](std::uint32_t lane) {
        ThreadLane::State state{&board, lane, {}};
        ThreadWarp<OneLane, ThreadLane> warp;
        warp.hardware.state = &state;
        warp.memory = {spares.lanes.data(), spares.slots.data(), packets.data()};
        warp.lane.stack = stacks.data() + std::size_t{2} * lane * stack_entries;
        spares.lanes[lane].stack = warp.lane.stack + stack_entries;
        Kernel kernel;
        while (kernel.template turn<any_hit>(warp, job, warp_index)) {
        }
    });
}

/// Warps at the same time, as many as a launch has.
template <class Kernel, bool any_hit>
void run_launch(const WarpJob& job, std::uint32_t stack_entries) {
    const std::uint32_t warps = Kernel::persistent ? 2 : (job.launch.count + 31) / 32;
    std::vector<std::thread> threads;
    std::vector<std::string> faults(warps);
    for (std::uint32_t w = 0; w < warps; ++w)
        threads.emplace_back([&, w] {
            try {
                run_lanes<Kernel, any_hit>(job, w, stack_entries);
            } catch (const BrokenWarp& fault) {
                faults[w] = fault.what();
            }
        });
    for (std::thread& thread : threads) thread.join();
    for (const std::string& fault : faults) EXPECT_EQ(fault, "");
}

void compare_with_reference(const WarpTree& tree, std::span<const Ray> rays, WarpKernel kernel,
                            bool any_hit) {
    SCOPED_TRACE(std::string(warp_kernel_name(kernel)) + (any_hit ? ", any" : ", closest"));
    std::vector<TreeHit> expected(rays.size()), hits(rays.size(), TreeHit{-1.0f, 7, 7.0f, 7.0f});
    trace_reference(tree, rays, expected, any_hit);
    const PreparedRays prepared(rays);
    std::uint32_t next = 0;
    const WarpJob job{
        scene_of(tree),
        {prepared.rays().data(), hits.data(), static_cast<std::uint32_t>(rays.size()), &next}};
    const std::uint32_t entries = tree.arrays().stack_entries(kernel);
    with_kernel(kernel, [&]<class Kernel>() {
        if (any_hit)
            run_launch<Kernel, true>(job, entries);
        else
            run_launch<Kernel, false>(job, entries);
    });
    prepared.rescale(hits);
    for (std::size_t i = 0; i < rays.size(); ++i) {
        if (any_hit)
            ASSERT_EQ(hits[i].hit(), expected[i].hit()) << "ray " << i;
        else
            ASSERT_EQ(std::memcmp(&hits[i], &expected[i], sizeof(TreeHit)), 0) << "ray " << i;
    }
}

class KernelOnThreads : public ::testing::TestWithParam<WarpKernel> {};

TEST_P(KernelOnThreads, GivesTheReferencesHits) {
    const Model scene = scene_of(random_soup(120, 11, 0.3f), "soup");
    const WarpTree tree(build_bvh(scene.mesh(), {.max_leaf = 3}), true);
    for (const std::size_t count : {std::size_t{1}, 28 + 4 * thorough}) {
        const std::vector<Ray> rays = make_mixed_rays(scene, count, 3);
        for (const bool any_hit : {false, true})
            compare_with_reference(tree, rays, GetParam(), any_hit);
    }
}

INSTANTIATE_TEST_SUITE_P(All, KernelOnThreads, ::testing::ValuesIn(warp_kernels()),
                         [](const auto& of) { return std::string(warp_kernel_name(of.param)); });

}  // namespace
}  // namespace raydix::test
