// The warp policies on lanes that only count: masks, loops, votes, charges.
#include "simt/simulated_warp.h"

#include <gtest/gtest.h>

#include "simt/thread_warp.h"

namespace raydix::test {
namespace {

struct Counter {
    int left = 0, done = 0, inner = 0;
};

template <int Width>
struct Fixture {
    SimulatedWarp<Counter, Width> warp;
    OpCounts tally{};

    Fixture() { warp.tally = &tally; }
    const OpCount& of(Op op) const { return tally[static_cast<std::size_t>(op)]; }
    std::uint64_t issued() const {
        std::uint64_t sum = 0;
        for (const OpCount& count : tally) sum += count.issues;
        return sum;
    }
};

TEST(SimulatedWarp, LoopRunsForTheLanesThatWantIt) {
    Fixture<8> f;
    for (int k = 0; k < 8; ++k) f.warp.lanes[k].left = k;
    f.warp.loop(
        Op::main_loop, [](const Counter& l) { return l.left > 0; },
        [&] { f.warp.step(Op::visit_node, [](Counter& l) { --l.left, ++l.done; }); });
    for (int k = 0; k < 8; ++k) EXPECT_EQ(f.warp.lanes[k].done, k);
    // The longest lane makes 7 turns; 0 + 1 + ... + 7 lanes work in them.
    EXPECT_EQ(f.of(Op::visit_node), (OpCount{7, 28}));
    EXPECT_EQ(f.of(Op::main_loop), (OpCount{7, 28}));
    EXPECT_EQ(f.warp.active(), 0xFFu);
    EXPECT_EQ(f.issued(), 14u);
}

TEST(SimulatedWarp, NestedLoopsRestoreTheMask) {
    Fixture<4> f;
    for (int k = 0; k < 4; ++k) f.warp.lanes[k].left = k + 1;
    f.warp.loop(
        Op::main_loop, [](const Counter& l) { return l.left > 0; },
        [&] {
            const LaneMask outside = f.warp.active();
            f.warp.step(Op::visit_node, [](Counter& l) { l.inner = l.left--; });
            f.warp.loop(
                Op::leaf_loop, [](const Counter& l) { return l.inner > 0; },
                [&] { f.warp.step(Op::test_triangle, [](Counter& l) { --l.inner, ++l.done; }); });
            EXPECT_EQ(f.warp.active(), outside);
        });
    for (int k = 0; k < 4; ++k) EXPECT_EQ(f.warp.lanes[k].done, (k + 1) * (k + 2) / 2);
    EXPECT_EQ(f.of(Op::visit_node), (OpCount{4, 10}));
    // Turn 1 has lanes of 1, 2, 3, 4; turn 2 of 1, 2, 3; turn 3 of 1, 2; turn 4 of 1.
    EXPECT_EQ(f.of(Op::test_triangle).issues, 4u + 3 + 2 + 1);
    EXPECT_EQ(f.of(Op::test_triangle).lanes, 10u + 6 + 3 + 1);
    EXPECT_EQ(f.warp.active(), 0xFu);
}

TEST(SimulatedWarp, NothingIsChargedWithoutLanes) {
    Fixture<4> f;
    const auto never = [](const Counter&) { return false; };
    bool ran = false;
    f.warp.when(never, [&] { ran = true; });
    f.warp.loop(Op::main_loop, never, [&] { ran = true; });
    f.warp.voting_loop(
        Op::main_loop, never, [&] { ran = true; }, [] { return true; });
    f.warp.among(0, [&] { ran = true; });
    EXPECT_FALSE(ran);
    EXPECT_EQ(f.issued(), 0u);
    f.warp.when([](const Counter&) { return true; }, [] {});
    EXPECT_EQ(f.issued(), 0u) << "a condition alone is no charged step";
    EXPECT_EQ(f.warp.active(), 0xFu);
}

TEST(SimulatedWarp, VotesCountTheMembersOnly) {
    Fixture<8> f;
    for (int k = 0; k < 8; ++k) f.warp.lanes[k].left = k;
    const auto odd = [](const Counter& l) { return l.left % 2 == 1; };
    EXPECT_EQ(f.warp.ballot(Op::ballot, odd), 0b10101010u);
    f.warp.among(0b00001111u, [&] {
        EXPECT_EQ(f.warp.ballot(Op::ballot, odd), 0b00001010u);
        EXPECT_FALSE(f.warp.any(Op::vote, [](const Counter& l) { return l.left > 3; }));
        f.warp.when(odd, [&] {
            EXPECT_EQ(f.warp.ballot_indexed(
                          Op::rank, [](const Counter&, std::uint32_t lane) { return lane < 2; }),
                      0b00000010u);
        });
    });
    EXPECT_EQ(f.of(Op::ballot), (OpCount{2, 12}));
    EXPECT_EQ(f.of(Op::vote), (OpCount{1, 4}));
    EXPECT_EQ(f.of(Op::rank), (OpCount{1, 2}));
    EXPECT_EQ(f.warp.active(), 0xFFu);
}

TEST(SimulatedWarp, VotingLoopEndsForAllMembersAtOnce) {
    Fixture<4> f;
    for (int k = 0; k < 4; ++k) f.warp.lanes[k].left = 3 * k;  // 0, 3, 6, 9
    f.warp.voting_loop(
        Op::node_loop, [](const Counter& l) { return l.left > 0; },
        [&] { f.warp.step(Op::visit_node, [](Counter& l) { --l.left, ++l.done; }); },
        [&] { return f.warp.any(Op::vote, [](const Counter& l) { return l.done < 5; }); });
    // Lane 1 leaves by itself after 3 turns; the others are sent out after 5.
    EXPECT_EQ(f.warp.lanes[0].done, 0);
    EXPECT_EQ(f.warp.lanes[1].done, 3);
    EXPECT_EQ(f.warp.lanes[2].done, 5);
    EXPECT_EQ(f.warp.lanes[3].done, 5);
    EXPECT_EQ(f.of(Op::visit_node), (OpCount{5, 3 * 3 + 2 * 2}));
    EXPECT_EQ(f.warp.active(), 0xFu);
}

TEST(SimulatedWarp, SharedStepsAreIssuedOnce) {
    Fixture<32> f;
    std::uint32_t pool = 5;
    EXPECT_EQ(f.warp.take(Op::take_rays, pool, 7), 5u);
    EXPECT_EQ(pool, 12u);
    EXPECT_EQ(f.of(Op::take_rays).issues, 1u);
    EXPECT_EQ(f.of(Op::shuffle).issues, 1u);
    EXPECT_EQ(f.warp.uniform(Op::choose, [] { return 3; }), 3);
    int value = 0;
    f.warp.write_shared(Op::push, [&] { ++value; });
    EXPECT_EQ(value, 1);
}

template <int Width>
std::uint64_t lane_steps() {
    std::uint64_t sum = 0;
    for (int first = 0; first < 64; first += Width) {
        Fixture<Width> f;
        for (int k = 0; k < Width; ++k) f.warp.lanes[k].left = (first + k) * 7 % 13;
        f.warp.loop(
            Op::main_loop, [](const Counter& l) { return l.left > 0; },
            [&] { f.warp.step(Op::visit_node, [](Counter& l) { --l.left; }); });
        sum += f.of(Op::visit_node).lanes;
        if (Width == 1) {
            EXPECT_EQ(f.of(Op::visit_node).lanes, f.of(Op::visit_node).issues);
        }
    }
    return sum;
}

TEST(SimulatedWarp, LaneStepsDoNotDependOnTheWidth) {
    const std::uint64_t one = lane_steps<1>();
    EXPECT_EQ(lane_steps<8>(), one);
    EXPECT_EQ(lane_steps<32>(), one);
    EXPECT_EQ(lane_steps<64>(), one);
}

TEST(ThreadWarp, IsAWarpOfOneLaneOnTheHost) {
    ThreadWarp<Counter> warp;
    warp.lane.left = 5;
    warp.voting_loop(
        Op::main_loop, [](const Counter& l) { return l.left > 0; },
        [&] { warp.step(Op::visit_node, [](Counter& l) { --l.left, ++l.done; }); },
        [&] { return warp.any(Op::vote, [](const Counter& l) { return l.done < 3; }); });
    EXPECT_EQ(warp.lane.done, 3);
    EXPECT_EQ(warp.ballot(Op::ballot, [](const Counter&) { return true; }), 1u);
    bool ran = false;
    warp.among(0, [&] { ran = true; });
    EXPECT_FALSE(ran);
}

}  // namespace
}  // namespace raydix::test
