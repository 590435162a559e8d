// Warps on multiprocessors, with times worked out by hand.
#include "simt/schedule.h"

#include <gtest/gtest.h>

#include "simt/memory_model.h"

namespace raydix::test {
namespace {

TEST(Multiprocessors, ShareTheirSlotsEvenly) {
    Multiprocessors machine(1, {1.0, 1.0});
    machine.add(0, 0, 100);
    machine.add(0, 1, 300);
    // Both run at half speed; the first is done at 200, then the other has 200 left at full speed.
    EXPECT_EQ(machine.next().warp, 0u);
    EXPECT_DOUBLE_EQ(machine.now(), 200);
    EXPECT_DOUBLE_EQ(machine.work_left(), 200);
    EXPECT_EQ(machine.next().warp, 1u);
    EXPECT_DOUBLE_EQ(machine.now(), 400);
    EXPECT_TRUE(machine.idle());
}

TEST(Multiprocessors, OneWarpCannotUseAllSlots) {
    Multiprocessors machine(2, {4.0, 0.5});
    machine.add(1, 7, 100);
    const auto done = machine.next();
    EXPECT_EQ(done.place, 1u);
    EXPECT_EQ(done.warp, 7u);
    EXPECT_DOUBLE_EQ(machine.now(), 200);
    for (std::uint32_t w = 0; w < 8; ++w) machine.add(0, w, 100);  // 8 * 0.5 fills the 4 slots
    for (std::uint32_t w = 0; w < 8; ++w) {
        EXPECT_EQ(machine.next().warp, w) << "ties go by number";
        EXPECT_DOUBLE_EQ(machine.now(), 400);
    }
}

TEST(Multiprocessors, NewWorkSlowsTheOthersDownFromThenOn) {
    Multiprocessors machine(1, {1.0, 1.0});
    machine.add(0, 0, 100);
    machine.add(0, 1, 400);
    EXPECT_EQ(machine.next().warp, 0u);  // at 200; warp 1 has 300 left
    machine.add(0, 0, 100);
    EXPECT_EQ(machine.next().warp, 0u);  // 100 at half speed: at 400; warp 1 has 200 left
    EXPECT_DOUBLE_EQ(machine.now(), 400);
    EXPECT_EQ(machine.next().warp, 1u);
    EXPECT_DOUBLE_EQ(machine.now(), 600);
}

TEST(SectorCache, ForgetsTheLeastRecentlyUsed) {
    SectorCache cache(8 * 32);  // one set of 8 ways
    for (std::uint64_t n = 0; n < 8; ++n) EXPECT_FALSE(cache.touch(n));
    for (std::uint64_t n = 0; n < 8; ++n) EXPECT_TRUE(cache.touch(n));
    EXPECT_TRUE(cache.touch(0));   // now 1 is the oldest
    EXPECT_FALSE(cache.touch(8));  // takes its place
    EXPECT_TRUE(cache.touch(0));
    EXPECT_FALSE(cache.touch(1));
}

TEST(MemoryModel, CountsLinesSectorsAndMisses) {
    alignas(128) static std::byte memory[4096];
    const MemoryRange all{memory, sizeof(memory)};
    MemoryModel model(2, 1024, 64 * 1024, std::span(&all, 1));
    const void* same[32];
    for (const void*& address : same) address = memory;
    model.run_on(0);
    model.read(same, 32, 64);  // 64 bytes of one line: 4 transactions, 2 sectors
    EXPECT_EQ(model.l1_transactions(), 4u);
    EXPECT_EQ(model.l2_bytes(), 64u);
    EXPECT_EQ(model.dram_bytes(), 64u);
    model.read(same, 32, 64);  // all in the first cache
    EXPECT_EQ(model.l1_transactions(), 8u);
    EXPECT_EQ(model.l2_bytes(), 64u);
    model.run_on(1);
    model.read(same, 32, 64);  // in the second cache only
    EXPECT_EQ(model.l2_bytes(), 128u);
    EXPECT_EQ(model.dram_bytes(), 64u);
    const void* apart[4];
    for (int k = 0; k < 4; ++k) apart[k] = memory + 1024 + 128 * k;
    model.read(apart, 4, 16);  // four lines, a sector each
    EXPECT_EQ(model.l1_transactions(), 16u);
    EXPECT_EQ(model.dram_bytes(), 64u + 4 * 32);
    const void* elsewhere = &model;
    EXPECT_THROW(model.read(&elsewhere, 1, 4), std::logic_error);
}

}  // namespace
}  // namespace raydix::test
