// What a listener hears of nested stages and loops.
#include "exec/progress.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <stdexcept>
#include <vector>

#include "exec/parallel.h"

namespace raydix {
namespace {

TEST(Progress, StagesWithinStagesAscendToOne) {
    std::vector<double> parts;
    const std::function<void(double)> tell = [&](double part) { parts.push_back(part); };
    ProgressListener listener(tell);
    {
        const ProgressStage whole({&listener, 0, 1});
        progress_at(0.25);
        {
            const ProgressStage half(0.25, 0.75);
            progress_at(0.5);
            const ProgressStage rest(0.5, 1);
            progress_at(0.5);
            progress_at(0.1);  // less than before
            with_threads(2, [] { progress_at(1); });
        }
        progress_at(1);  // the listener's own matter
    }
    listener.finish();
    EXPECT_EQ(parts, (std::vector<double>{0.25, 0.5, 0.625, 0.75, 1}));
    EXPECT_EQ(progress_span().listener, nullptr);
}

TEST(Progress, LoopsTellSmallStepsOnAllThreads) {
    for (const int threads : {1, 4}) {
        std::vector<double> parts;
        const std::function<void(double)> tell = [&](double part) {
            EXPECT_EQ(progress_span().listener, nullptr) << "what is called tells nothing itself";
            parts.push_back(part);
        };
        ProgressListener listener(tell);
        const ProgressStage whole({&listener, 0, 1});
        with_threads(threads, [&] {
            const ProgressCounter counter(100000, 0.5, 1);
            for_each_index(
                100000, [&](std::size_t) { counter.add(1); }, 100);
        });
        listener.finish();
        EXPECT_GT(parts.size(), 50u);
        EXPECT_LE(parts.size(), 130u);
        EXPECT_TRUE(std::ranges::is_sorted(parts));
        EXPECT_GE(parts.front(), 0.5);
        EXPECT_EQ(parts.back(), 1.0);
    }
}

TEST(Progress, WhatThrowsIsNotCalledAgain) {
    int calls = 0;
    const std::function<void(double)> tell = [&](double) {
        if (++calls == 3) throw std::runtime_error("enough");
    };
    ProgressListener listener(tell);
    const ProgressStage whole({&listener, 0, 1});
    EXPECT_THROW(with_threads(4,
                              [&] {
                                  const ProgressCounter counter(1000);
                                  for_each_index(
                                      1000, [&](std::size_t) { counter.add(1); }, 1);
                              }),
                 std::runtime_error);
    progress_at(0.999);
    listener.finish();
    EXPECT_EQ(calls, 3);
}

TEST(Progress, NobodyListens) {
    const ProgressStage stage(0.25, 0.75);
    progress_at(0.5);
    const ProgressCounter counter(0);
    counter.add(7);
    const std::function<void(double)> none;
    ProgressListener listener(none);
    const ProgressStage whole({&listener, 0, 1});
    progress_at(0.5);
    listener.finish();
}

}  // namespace
}  // namespace raydix
