// How subtrees are shared among two children: the least cost of all ways, whatever computes it.
#include "layout/subtree_shares.h"

#include <gtest/gtest.h>

#include <array>
#include <cstring>
#include <random>

namespace raydix::test {
namespace {

constexpr int width = 8;
using Costs = std::array<float, width>;

/// Costs as plans have them: no more subtrees cost more than fewer. The last float is something
/// else.
Costs random_costs(std::mt19937& random, bool with_ties) {
    Costs costs;
    float cost = 100.0f;
    for (float& c : costs) {
        c = cost;
        cost -= with_ties ? static_cast<float>(random() % 3)
                          : std::uniform_real_distribution<float>(0, 9)(random);
    }
    const std::uint32_t choices = static_cast<std::uint32_t>(random());
    std::memcpy(&costs[width - 1], &choices, sizeof(choices));
    return costs;
}

TEST(Divisions, AreTheCheapestAndAmongEqualOnesTheMostEven) {
    std::mt19937 random(7);
    for (int round = 0; round < 500; ++round) {
        const Costs a = random_costs(random, round % 2 == 0),
                    b = random_costs(random, round % 2 == 0);
        const SubtreeShares<width> found = cheapest_shares<width>(a.data(), b.data());
        for (std::size_t i = 2; i <= width; ++i) {
            const auto at = [&](std::size_t left) { return a[left - 1] + b[i - left - 1]; };
            float least = at(1);
            for (std::size_t left = 1; left < i; ++left) least = std::min(least, at(left));
            const auto left = static_cast<std::size_t>(found.left[i - 1]);
            ASSERT_TRUE(left >= 1 && left < i);
            EXPECT_EQ(found.cost[i - 1], least);
            EXPECT_EQ(at(left), least);
            const auto unevenness = [&](std::size_t k) {
                return k > i - k ? 2 * k - i : i - 2 * k;
            };
            for (std::size_t other = 1; other < i; ++other) {
                if (at(other) != least) continue;
                EXPECT_LE(unevenness(left), unevenness(other));
            }
        }
    }
}

TEST(Divisions, TakeSubtreesTheSameWayInVectors) {
#if defined(RAYDIX_X86_INTRINSICS)
    if (!__builtin_cpu_supports("avx2")) GTEST_SKIP() << "the processor has no AVX2";
    std::mt19937 random(8);
    for (int round = 0; round < 5000; ++round) {
        const Costs a = random_costs(random, round % 2 == 0),
                    b = random_costs(random, round % 2 == 0);
        const SubtreeShares<width> one = cheapest_shares<width>(a.data(), b.data()),
                                   all = cheapest_shares_avx2(a.data(), b.data());
        for (std::size_t i = 2; i <= width; ++i) {
            EXPECT_EQ(all.cost[i - 1], one.cost[i - 1]);
            EXPECT_EQ(all.left[i - 1], one.left[i - 1]) << i << " subtrees";
        }
    }
#else
    GTEST_SKIP() << "there is one way only";
#endif
}

}  // namespace
}  // namespace raydix::test
