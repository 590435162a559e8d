// The first index is the first one, whichever thread comes upon it.
#include "exec/search.h"

#include <gtest/gtest.h>

#include <vector>

namespace raydix::test {
namespace {

TEST(FirstIndexWhere, NothingToFind) {
    EXPECT_EQ(first_index_where(0, [](std::size_t) { return true; }), 0u);
    EXPECT_EQ(first_index_where(100'000, [](std::size_t) { return false; }), 100'000u);
}

TEST(FirstIndexWhere, TheLowestOfMany) {
    constexpr std::size_t n = 300'000;
    for (const std::size_t first : {std::size_t{0}, std::size_t{1}, std::size_t{16'383},
                                    std::size_t{16'384}, std::size_t{250'001}, n - 1}) {
        for (const int threads : {1, 2, 7}) {
            std::size_t found = n;
            with_threads(threads, [&] {
                found = first_index_where(
                    n, [&](std::size_t i) { return i >= first && (i - first) % 3 == 0; });
            });
            EXPECT_EQ(found, first) << threads;
        }
    }
}

TEST(FirstIndexWhere, LooksAtEachElementOnceAtMost) {
    std::vector<std::atomic<int>> looked(100'000);
    const std::size_t found = first_index_where(looked.size(), [&](std::size_t i) {
        ++looked[i];
        return i == 70'000;
    });
    EXPECT_EQ(found, 70'000u);
    for (std::size_t i = 0; i < looked.size(); ++i) EXPECT_LE(looked[i].load(), 1);
    for (std::size_t i = 0; i <= found; ++i) EXPECT_EQ(looked[i].load(), 1);
}

}  // namespace
}  // namespace raydix::test
