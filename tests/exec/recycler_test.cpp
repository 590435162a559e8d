// Memory that goes from hand to hand.
#include "exec/recycler.h"

#include <gtest/gtest.h>

#include <memory>
#include <thread>
#include <vector>

namespace raydix {
namespace {

TEST(Recycler, GivesWhatTheLastHolderLeft) {
    Recycler<int> recycler;
    EXPECT_EQ(recycler.take(), nullptr);
    std::shared_ptr<const int> held = recycler.share(std::make_unique<int>(7));
    const std::shared_ptr<const int> other = held;
    held = nullptr;
    EXPECT_EQ(recycler.take(), nullptr);
    EXPECT_EQ(*other, 7);
    held = recycler.share(std::make_unique<int>(8));
    held = nullptr;
    const std::unique_ptr<int> again = recycler.take();
    ASSERT_NE(again, nullptr);
    EXPECT_EQ(*again, 8);
    EXPECT_EQ(recycler.take(), nullptr);
}

TEST(Recycler, HoldersMayOutliveIt) {
    std::shared_ptr<const int> held;
    {
        Recycler<int> recycler;
        held = recycler.share(std::make_unique<int>(3));
    }
    EXPECT_EQ(*held, 3);
}

TEST(Recycler, ManyThreadsMayGiveAndTake) {
    Recycler<std::vector<int>> recycler;
    std::vector<std::thread> threads;
    for (int t = 0; t < 4; ++t)
        threads.emplace_back([recycler, t]() mutable {
            for (int k = 0; k < 200; ++k) {
                auto mine = recycler.take();
                if (mine == nullptr) mine = std::make_unique<std::vector<int>>();
                mine->assign(100, t);
                const auto held = recycler.share(std::move(mine));
                for (const int x : *held) ASSERT_EQ(x, t);
            }
        });
    for (std::thread& thread : threads) thread.join();
    EXPECT_NE(recycler.take(), nullptr);
}

}  // namespace
}  // namespace raydix
