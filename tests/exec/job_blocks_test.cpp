// Blocks that threads take from one counter: what they cover, how large they are, who runs them.
#include "exec/job_blocks.h"

#include <gtest/gtest.h>

#include <atomic>
#include <cstdint>
#include <mutex>
#include <set>
#include <stdexcept>
#include <thread>
#include <vector>

namespace raydix {
namespace {

struct Block {
    std::size_t begin, end;
};

/// By their number; each must come once.
std::vector<Block> ran(const JobBlocks& blocks) {
    std::vector<Block> all(blocks.count());
    std::vector<std::atomic<int>> times(blocks.count());
    blocks.run([&](std::size_t b, std::size_t begin, std::size_t end) {
        all[b] = {begin, end};
        ++times[b];
    });
    for (const auto& count : times) EXPECT_EQ(count, 1);
    return all;
}

void expect_cover(const std::vector<Block>& blocks, std::size_t n) {
    std::size_t at = 0;
    for (const auto [begin, end] : blocks) {
        EXPECT_EQ(begin, at);
        EXPECT_LT(begin, end);
        at = end;
    }
    EXPECT_EQ(at, n);
}

TEST(JobBlocks, CoverAllOnceOnAnyThreads) {
    for (const int threads : {1, 2, 7})
        with_threads(threads, [] {
            for (const std::size_t n : {0, 1, 511, 512, 513, 1024, 5000, 196608}) {
                SCOPED_TRACE(n);
                expect_cover(ran(JobBlocks::fixed(n, 512)), n);
                for (const std::size_t made_for : {1, 2, 16, 1024})
                    expect_cover(ran(JobBlocks::guided(n, 512, 4096, made_for)), n);
            }
        });
}

TEST(JobBlocks, GuidedOnesShrinkToTheUnit) {
    constexpr std::size_t n = 196608, unit = 512, largest = 16384, threads = 16;
    const auto blocks = ran(JobBlocks::guided(n, unit, largest, threads));
    std::size_t before = largest;
    for (std::size_t b = 0; b < blocks.size(); ++b) {
        const std::size_t size = blocks[b].end - blocks[b].begin;
        EXPECT_LE(size, before) << b;
        EXPECT_TRUE(size % unit == 0 || b + 1 == blocks.size()) << b;
        before = size;
    }
    EXPECT_EQ(blocks.front().end, n / (2 * threads));  // half of a thread's even share
    EXPECT_EQ(before, unit);
    // A thread that begins the last block when all others have ended makes them wait for so much.
    EXPECT_GT(blocks.size(), 4 * threads);
}

TEST(JobBlocks, OneThreadHasTheLargest) {
    const auto blocks = ran(JobBlocks::guided(10000, 512, 4096, 1));
    ASSERT_EQ(blocks.size(), 3u);
    EXPECT_EQ(blocks[0].end, 4096u);
    EXPECT_EQ(blocks[1].end, 8192u);
}

TEST(JobBlocks, FewThreadsStillDoAll) {
    // Made for more threads than there are.
    with_threads(1, [] {
        std::set<std::thread::id> who;
        JobBlocks::guided(50000, 512, 4096, 64).run([&](std::size_t, std::size_t, std::size_t) {
            who.insert(std::this_thread::get_id());
        });
        EXPECT_EQ(who, std::set{std::this_thread::get_id()});
    });
}

TEST(JobBlocks, WhatABlockThrowsComesOut) {
    for (const int threads : {1, 2})
        with_threads(threads, [] {
            EXPECT_THROW(
                JobBlocks::fixed(5000, 512).run([](std::size_t b, std::size_t, std::size_t) {
                    if (b == 3) throw std::runtime_error("block 3");
                }),
                std::runtime_error);
        });
}

TEST(JobBlocks, MayRunInsideOfEachOther) {
    std::atomic<std::uint64_t> sum{0};
    JobBlocks::fixed(8, 1).run([&](std::size_t, std::size_t, std::size_t) {
        JobBlocks::guided(3000, 100, 500, 4)
            .run([&](std::size_t, std::size_t begin, std::size_t end) { sum += end - begin; });
    });
    EXPECT_EQ(sum, 8u * 3000u);
}

}  // namespace
}  // namespace raydix
