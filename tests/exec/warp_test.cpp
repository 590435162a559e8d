// The warp of the host: what ballots, shuffles and the search for set bits promise.
#include "exec/warp.h"

#include <gtest/gtest.h>

#include <random>

namespace raydix {
namespace {

TEST(NthSetBit, CountsFromTheLowest) {
    EXPECT_EQ(nth_set_bit(0b1u, 0), 0u);
    EXPECT_EQ(nth_set_bit(0b1011000u, 0), 3u);
    EXPECT_EQ(nth_set_bit(0b1011000u, 1), 4u);
    EXPECT_EQ(nth_set_bit(0b1011000u, 2), 6u);
    EXPECT_EQ(nth_set_bit(0x80000000u, 0), 31u);
    for (std::uint32_t k = 0; k < 32; ++k) EXPECT_EQ(nth_set_bit(0xFFFFFFFFu, k), k);
    constexpr unsigned seed = 3;
    std::mt19937 random(seed);
    for (int i = 0; i < 1000; ++i) {
        const auto mask = static_cast<std::uint32_t>(random());
        std::uint32_t rank = 0;
        for (std::uint32_t place = 0; place < 32; ++place) {
            if ((mask >> place & 1) == 0) continue;
            EXPECT_EQ(nth_set_bit(mask, rank++), place) << mask << ", seed " << seed;
        }
    }
}

TEST(HostWarp, LanesSpeakToEachOther) {
    const HostWarp warp;
    HostWarp::Var<std::uint32_t> value;
    warp.each([&](std::uint32_t lane) { value[lane] = 100 + lane; });
    EXPECT_EQ(warp.ballot([&](std::uint32_t lane) { return value[lane] % 2 == 1; }), 0xAAAAAAAAu);
    EXPECT_EQ(warp.broadcast(value, 7), 107u);
    const auto next = warp.shuffle(value, [](std::uint32_t lane) { return lane + 1; });
    EXPECT_EQ(next[0], 101u);
    EXPECT_EQ(next[31], 100u);  // sources wrap around, as on the device
}

}  // namespace
}  // namespace raydix
