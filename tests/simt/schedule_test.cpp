// Warps on multiprocessors, with times worked out by hand.
#include "simt/schedule.h"

#include <gtest/gtest.h>

#include <utility>
#include <vector>

namespace raydix::test {
namespace {

/// Work of a warp that could issue on every clock.
WarpWork steady(double instructions) { return {instructions, instructions}; }

TEST(Multiprocessors, ShareTheirSlotsEvenly) {
    Multiprocessors machine(1, 1.0);
    machine.add(0, 0, steady(100));
    machine.add(0, 1, steady(300));
    // Both run at half speed; the first is done at 200, then the other has 200 left at full speed.
    EXPECT_EQ(machine.next().warp, 0u);
    EXPECT_DOUBLE_EQ(machine.now(), 200);
    EXPECT_DOUBLE_EQ(machine.work_left(), 200);
    EXPECT_EQ(machine.next().warp, 1u);
    EXPECT_DOUBLE_EQ(machine.now(), 400);
    EXPECT_TRUE(machine.idle());
}

TEST(Multiprocessors, OneWarpCannotUseAllSlots) {
    Multiprocessors machine(2, 4.0);
    const WarpWork slow{100, 200};  // one instruction in two clocks
    machine.add(1, 7, slow);
    const auto done = machine.next();
    EXPECT_EQ(done.place, 1u);
    EXPECT_EQ(done.warp, 7u);
    EXPECT_DOUBLE_EQ(machine.now(), 200);
    for (std::uint32_t w = 0; w < 8; ++w) machine.add(0, w, slow);  // 8 * 0.5 fills the 4 slots
    for (std::uint32_t w = 0; w < 8; ++w) {
        EXPECT_EQ(machine.next().warp, w) << "ties go by number";
        EXPECT_DOUBLE_EQ(machine.now(), 400);
    }
}

TEST(Multiprocessors, NewWorkSlowsTheOthersDownFromThenOn) {
    Multiprocessors machine(1, 1.0);
    machine.add(0, 0, steady(100));
    machine.add(0, 1, steady(400));
    EXPECT_EQ(machine.next().warp, 0u);  // at 200; warp 1 has 300 left
    machine.add(0, 0, steady(100));
    EXPECT_EQ(machine.next().warp, 0u);  // 100 at half speed: at 400; warp 1 has 200 left
    EXPECT_DOUBLE_EQ(machine.now(), 400);
    EXPECT_EQ(machine.next().warp, 1u);
    EXPECT_DOUBLE_EQ(machine.now(), 600);
}

TEST(Multiprocessors, AWarpThatWaitsLeavesItsSlotsToOthers) {
    Multiprocessors machine(1, 1.0);
    machine.add(0, 0, {100, 1000});  // waits nine clocks in ten
    machine.add(0, 1, {450, 500});   // 0.1 + 0.9 fill the slots: nobody slows anybody down
    EXPECT_EQ(machine.next().warp, 1u);
    EXPECT_DOUBLE_EQ(machine.now(), 500);
    EXPECT_NEAR(machine.work_left(), 50, 1e-9);
    machine.add(0, 1, steady(900));  // 1.1 are asked for: all run at 1 / 1.1
    EXPECT_EQ(machine.next().warp, 0u);
    EXPECT_NEAR(machine.now(), 500 + 500 * 1.1, 1e-9);
    EXPECT_EQ(machine.next().warp, 1u);
    EXPECT_NEAR(machine.now(), 500 + 500 * 1.1 + 400, 1e-9);
}

TEST(Multiprocessors, WorkOfNoInstructionsEndsAtOnce) {
    Multiprocessors machine(1, 1.0);
    machine.add(0, 0, steady(10));
    machine.add(0, 1, {0, 0});
    EXPECT_EQ(machine.next().warp, 1u);
    EXPECT_DOUBLE_EQ(machine.now(), 0);
    EXPECT_EQ(machine.next().warp, 0u);
    EXPECT_DOUBLE_EQ(machine.now(), 10);
}

/// The blocks that start now, with their multiprocessors.
std::vector<std::pair<std::size_t, std::uint32_t>> started(BlockPlaces& places) {
    std::vector<std::pair<std::size_t, std::uint32_t>> all;
    for (BlockPlaces::Start start{}; places.take(start);)
        all.emplace_back(start.block, start.place);
    return all;
}

using Starts = std::vector<std::pair<std::size_t, std::uint32_t>>;

TEST(BlockPlaces, GoRoundAllMultiprocessorsFirst) {
    BlockPlaces places(3, 2, 5, BlockRelease::own);
    EXPECT_EQ(started(places), (Starts{{0, 0}, {1, 1}, {2, 2}, {3, 0}, {4, 1}}));
    EXPECT_TRUE(places.all_taken());
}

TEST(BlockPlaces, OfTheirOwnAreFreeWhenTheBlockIsDone) {
    BlockPlaces places(2, 1, 5, BlockRelease::own);
    EXPECT_EQ(started(places), (Starts{{0, 0}, {1, 1}}));
    EXPECT_FALSE(places.all_taken());
    places.finish(1);
    EXPECT_EQ(started(places), (Starts{{2, 1}}));
    places.finish(2);
    EXPECT_EQ(started(places), (Starts{{3, 1}}));
}

TEST(BlockPlaces, InOrderWaitForAllEarlierBlocks) {
    BlockPlaces places(2, 2, 8, BlockRelease::in_order);
    EXPECT_EQ(started(places), (Starts{{0, 0}, {1, 1}, {2, 0}, {3, 1}}));
    places.finish(1);
    places.finish(3);
    EXPECT_TRUE(started(places).empty()) << "block 0 still runs";
    places.finish(0);
    EXPECT_EQ(started(places), (Starts{{4, 0}, {5, 1}})) << "of 0 and 1; 3 waits for 2";
    places.finish(2);
    EXPECT_EQ(started(places), (Starts{{6, 0}, {7, 1}}));
}

TEST(BlockPlaces, TogetherWaitForAllBlocksOnTheMachine) {
    BlockPlaces places(2, 1, 4, BlockRelease::together);
    EXPECT_EQ(started(places).size(), 2u);
    places.finish(0);
    EXPECT_TRUE(started(places).empty());
    places.finish(1);
    EXPECT_EQ(started(places), (Starts{{2, 0}, {3, 1}}));
}

}  // namespace
}  // namespace raydix::test
