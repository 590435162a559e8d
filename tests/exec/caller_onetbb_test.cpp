// Callers that use oneTBB themselves: what becomes of their tasks does not touch a loop of the
// library.
#if !defined(__SANITIZE_THREAD__) && !defined(RAYDIX_NO_TBB)  // else see parallel_std.cpp

#include <gtest/gtest.h>
#include <tbb/task_group.h>

#include <atomic>
#include <cstddef>

#include "exec/parallel.h"

namespace raydix {
namespace {

TEST(CallersTasks, LoopsGoOnInAGroupThatIsCancelled) {
    constexpr std::size_t items = 100'000;
    std::atomic<std::size_t> done = 0;
    tbb::task_group group;
    const auto ended = group.run_and_wait([&] {
        group.cancel();
        for_each_index(
            items, [&](std::size_t) { ++done; }, 16);
    });
    EXPECT_EQ(ended, tbb::canceled);
    EXPECT_EQ(done, items);
}

TEST(CallersTasks, AGroupIsCancelledWhileALoopOfItRuns) {
    constexpr std::size_t items = 100'000;
    std::atomic<std::size_t> done = 0;
    tbb::task_group group;
    group.run_and_wait([&] {
        for_each_index(
            items,
            [&](std::size_t) {
                if (++done == items / 2) group.cancel();
            },
            16);
    });
    EXPECT_EQ(done, items);
}

}  // namespace
}  // namespace raydix

#endif
