// Requests, fetches and traffic of warps' accesses, worked out by hand.
#include "simt/memory_model.h"

#include <gtest/gtest.h>
#include <raydix/error.h>

#include <array>
#include <cstddef>
#include <stdexcept>

namespace raydix::test {
namespace {

constexpr std::uint32_t width = 32;
using Addresses = std::array<const void*, width>;
using Entries = std::array<std::int32_t, width>;

alignas(256) std::byte memory[1 << 16];

MachineModel machine() {
    MachineModel m;
    m.multiprocessors = 2;
    m.resident_lanes = 2 * width;
    m.l1_bytes = 8 * 128;  // one set of lines
    m.l2_bytes = 1 << 16;
    m.l1_clocks = 10, m.texture_clocks = 20, m.l2_clocks = 100, m.dram_clocks = 1000;
    return m;
}

MemoryModel model_of(const MachineModel& m, MemoryRange::Holds holds) {
    const MemoryRange all{memory, sizeof(memory), holds};
    return {m, width, 8, std::span(&all, 1)};
}

Addresses every(std::size_t stride) {
    Addresses addresses;
    for (std::size_t k = 0; k < width; ++k) addresses[k] = memory + k * stride;
    return addresses;
}

void read_as_one_warp(MemoryModel& model, const Addresses& addresses, std::uint32_t bytes) {
    model.access(addresses.data(), width, bytes, Access::read);
    model.hand_over(0);
    model.finish();
}

TEST(SetCache, ForgetsTheLeastRecentlyUsedAndWritesBack) {
    SetCache cache(8 * 32, 32);  // one set of 8 ways
    for (std::uint64_t n = 0; n < 8; ++n) EXPECT_FALSE(cache.touch(n, n == 1).hit);
    for (std::uint64_t n = 0; n < 8; ++n) EXPECT_TRUE(cache.touch(n).hit);
    EXPECT_TRUE(cache.touch(0).hit);  // now 1 is the oldest
    const SetCache::Touch ninth = cache.touch(8);
    EXPECT_FALSE(ninth.hit);
    EXPECT_TRUE(ninth.wrote_back);
    EXPECT_TRUE(cache.touch(0).hit);
    const SetCache::Touch again = cache.touch(1);
    EXPECT_FALSE(again.hit);
    EXPECT_FALSE(again.wrote_back);
}

TEST(MemoryModel, AQuarterOfAWarpAsksForWordsOf16BytesAtOnce) {
    const MachineModel m = machine();
    MemoryModel same = model_of(m, MemoryRange::Holds::nodes);
    read_as_one_warp(same, every(0), 64);
    EXPECT_EQ(same.traffic().l1_requests, 4u * 4);  // four words, four quarters, one line
    EXPECT_EQ(same.traffic().replays, 0u);
    EXPECT_EQ(same.traffic().l2_bytes, 128u);  // the line
    EXPECT_EQ(same.traffic().dram_bytes, 128u);
    EXPECT_EQ(same.traffic().wait_clocks, 1000);
    MemoryModel apart = model_of(m, MemoryRange::Holds::nodes);
    read_as_one_warp(apart, every(128), 64);
    EXPECT_EQ(apart.traffic().l1_requests, 4u * 32);
    EXPECT_EQ(apart.traffic().replays, 4u * (32 - 4));  // a quarter asks for one line without
    EXPECT_EQ(apart.traffic().l2_bytes, 32u * 128);
    MemoryModel words = model_of(m, MemoryRange::Holds::other);
    read_as_one_warp(words, every(4), 4);
    EXPECT_EQ(words.traffic().l1_requests, 1u);
    EXPECT_EQ(words.traffic().texture_fetches, 0u);
}

TEST(MemoryModel, FourSectorsOfAnyLinesAreOneTransaction) {
    MachineModel m = machine();
    m.l1_line_bytes = 32;
    MemoryModel same = model_of(m, MemoryRange::Holds::nodes);
    read_as_one_warp(same, every(0), 64);
    EXPECT_EQ(same.traffic().l1_requests, 4u * 4);
    MemoryModel apart = model_of(m, MemoryRange::Holds::nodes);
    read_as_one_warp(apart, every(128), 64);
    EXPECT_EQ(apart.traffic().l1_requests, 4u * 4 * 2);  // eight sectors of a quarter's word
    EXPECT_EQ(apart.traffic().replays, 4u * 4);
    EXPECT_EQ(apart.traffic().l2_bytes, 32u * 64);
}

TEST(MemoryModel, StacksThatTravelLieWhereTheyAre) {
    const MachineModel m = machine();
    MemoryModel model = model_of(m, MemoryRange::Holds::nodes);
    alignas(256) static std::byte stacks[width * 256];
    model.add_stacks(stacks, sizeof(stacks));
    Addresses tops;
    for (std::size_t k = 0; k < width; ++k) tops[k] = stacks + 256 * k;
    read_as_one_warp(model, tops, 4);
    EXPECT_EQ(model.traffic().l1_requests, 32u);  // a line each, where lanes' own share one
    EXPECT_EQ(model.traffic().dram_bytes, 32u * 128);
    Addresses crossed = tops;  // the same by other lanes: as far as the second cache
    for (std::size_t k = 0; k < width; ++k) crossed[k] = tops[width - 1 - k];
    read_as_one_warp(model, crossed, 4);
    EXPECT_EQ(model.traffic().dram_bytes, 32u * 128);
}

TEST(MemoryModel, WaitsForWhatHoldsTheValue) {
    const MachineModel m = machine();
    MemoryModel model = model_of(m, MemoryRange::Holds::nodes);
    read_as_one_warp(model, every(0), 16);
    read_as_one_warp(model, every(0), 16);
    EXPECT_EQ(model.traffic().wait_clocks, 1000 + 10);
    model.access(every(0).data(), width, 16, Access::read);
    model.hand_over(1);  // has it in the second cache only
    model.finish();
    EXPECT_EQ(model.traffic().wait_clocks, 1000 + 10 + 100);
    EXPECT_EQ(model.traffic().dram_bytes, 128u);
    model.access(every(1024).data(), width, 16, Access::read_beside);
    model.hand_over(1);
    model.finish();
    EXPECT_EQ(model.traffic().wait_clocks, 1000 + 10 + 100);
}

TEST(MemoryModel, TexturesHaveTheirOwnCacheAndFetches) {
    MachineModel m = machine();
    m.texture_bytes = 8 * 32, m.texture_sharers = 2;
    MemoryModel model = model_of(m, MemoryRange::Holds::triangles);
    read_as_one_warp(model, every(0), 48);
    EXPECT_EQ(model.traffic().texture_fetches, 3u * 32);
    EXPECT_EQ(model.traffic().l1_requests, 0u);
    EXPECT_EQ(model.traffic().l2_bytes, 64u);  // two lines of 32
    model.access(every(0).data(), width, 48, Access::read);
    model.hand_over(1);  // of the same cluster
    model.finish();
    EXPECT_EQ(model.traffic().l2_bytes, 64u);
    EXPECT_EQ(model.traffic().wait_clocks, 1000 + 20);
    m.nodes_by_texture = false;
    MemoryModel nodes = model_of(m, MemoryRange::Holds::nodes);
    read_as_one_warp(nodes, every(0), 64);
    EXPECT_EQ(nodes.traffic().texture_fetches, 0u);
    EXPECT_EQ(nodes.traffic().l1_requests, 16u);
}

TEST(MemoryModel, AllMultiprocessorsMayShareATextureCache) {
    MachineModel m = machine();
    m.texture_bytes = 8 * 32, m.texture_sharers = 0xFFFFFFFF;
    MemoryModel model = model_of(m, MemoryRange::Holds::triangles);
    read_as_one_warp(model, every(0), 48);
    model.access(every(0).data(), width, 48, Access::read);
    model.hand_over(1);
    model.finish();
    EXPECT_EQ(model.traffic().l2_bytes, 64u);
}

TEST(MemoryModel, RefusesMoreThanItsAddressesReach) {
    const MachineModel m = machine();
    const MemoryRange all{memory, std::uint64_t{1} << 32, MemoryRange::Holds::other};
    EXPECT_THROW(MemoryModel(m, width, 8, std::span(&all, 1)), InputError);
}

TEST(MemoryModel, StacksLieInterleavedAndAreWrittenBack) {
    MachineModel m = machine();
    MemoryModel model = model_of(m, MemoryRange::Holds::nodes);
    Entries entries;
    entries.fill(3);
    model.stack(entries.data(), width, Access::write);
    model.stack(entries.data(), width, Access::read);
    model.hand_over(0);
    model.finish();
    EXPECT_EQ(model.traffic().l1_requests, 2u);  // one line: lanes at one height
    EXPECT_EQ(model.traffic().l2_bytes, 0u);     // written first, then found
    EXPECT_EQ(model.traffic().wait_clocks, 10);
    for (std::uint32_t k = 0; k < width; ++k) entries[k] = static_cast<std::int32_t>(k % 8) - 1;
    model.stack(entries.data(), width, Access::read);
    model.hand_over(0);
    model.finish();
    EXPECT_EQ(model.traffic().l1_requests, 2u + 7);  // seven heights; -1 takes no part
    // Eight lines of nodes make room: the stack's lines are written back.
    const std::uint64_t before = model.traffic().l2_bytes;
    read_as_one_warp(model, every(128), 16);
    EXPECT_EQ(model.traffic().l2_bytes - before, (32u + 1) * 128);  // 32 read, the one written
    // Without a cache for data each sector goes to memory.
    m.l1_bytes = 0;
    MemoryModel bare = model_of(m, MemoryRange::Holds::other);
    entries.fill(3);
    bare.stack(entries.data(), width, Access::write);
    bare.stack(entries.data(), width, Access::read);
    bare.hand_over(0);
    bare.finish();
    EXPECT_EQ(bare.traffic().dram_bytes, 2u * 128);
    EXPECT_EQ(bare.traffic().l2_bytes, 0u);
    EXPECT_EQ(bare.traffic().wait_clocks, 1000);
}

TEST(MemoryModel, WarpsInFlightShareACache) {
    const MachineModel m = machine();  // room for 8 lines, and two warps
    // Each warp reads 8 lines twice: alone it finds them, beside another it does not.
    const auto warp = [](MemoryModel& model, std::size_t offset) {
        for (int round = 0; round < 2; ++round)
            for (std::size_t line = 0; line < 8; ++line) {
                Addresses addresses{};
                addresses[0] = memory + offset + 128 * line;
                model.access(addresses.data(), width, 16, Access::read);
            }
        model.hand_over(0);
    };
    MemoryModel alone = model_of(m, MemoryRange::Holds::nodes);
    warp(alone, 0);
    alone.finish();
    warp(alone, 4096);
    alone.finish();
    EXPECT_EQ(alone.traffic().l2_bytes, 16u * 128);
    MemoryModel together = model_of(m, MemoryRange::Holds::nodes);
    warp(together, 0);
    warp(together, 4096);
    together.finish();
    EXPECT_EQ(together.traffic().l2_bytes, 32u * 128);
}

TEST(MemoryModel, RefusesAddressesThatItWasNotTold) {
    const MachineModel m = machine();
    MemoryModel model = model_of(m, MemoryRange::Holds::nodes);
    Addresses addresses{};
    addresses[5] = &m;
    EXPECT_THROW(model.access(addresses.data(), width, 4, Access::read), std::logic_error);
}

}  // namespace
}  // namespace raydix::test
