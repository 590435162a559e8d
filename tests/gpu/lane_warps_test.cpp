// Work of warps with a thread for each lane (support/lane_warp.h): the same bits as lanes in a loop
// give, and under the thread sanitizer no access to memory that a sync or an arrive should order.
#include <gtest/gtest.h>

#include <cstddef>
#include <cstring>
#include <numeric>
#include <random>

#include "exec/warp_sort.h"
#include "support/lane_warp.h"
#include "support/sanitized.h"
#include "tree/hploc_launches.h"

namespace raydix::test {
namespace {

TEST(LaneWarp, LanesSpeakToEachOther) {
    LaneLauncher launcher;
    std::vector<std::uint32_t> votes(3 * warp_lanes), next(3 * warp_lanes);
    std::vector<std::uint64_t> seventh(3 * warp_lanes);
    launcher.launch_tiles("test", 3, [&](const LaneWarp& warp, std::uint32_t w) {
        LaneWarp::Var<std::uint64_t> value;
        LaneWarp::Var<std::uint32_t> small;
        warp.each([&](std::uint32_t lane) {
            value[lane] = std::uint64_t{w} << 40 | lane;
            small[lane] = 100 * w + lane;
        });
        const std::uint32_t odd = warp.ballot([](std::uint32_t lane) { return lane % 2 == 1; });
        const std::uint64_t told = warp.broadcast(value, 7);
        const auto behind = warp.shuffle(small, [](std::uint32_t lane) { return lane + 1; });
        warp.each([&](std::uint32_t lane) {
            votes[w * warp_lanes + lane] = odd;
            seventh[w * warp_lanes + lane] = told;
            next[w * warp_lanes + lane] = behind[lane];
        });
    });
    for (std::uint32_t i = 0; i < votes.size(); ++i) {
        const std::uint32_t w = i / warp_lanes, lane = i % warp_lanes;
        EXPECT_EQ(votes[i], 0xAAAAAAAAu);
        EXPECT_EQ(seventh[i], std::uint64_t{w} << 40 | 7);
        EXPECT_EQ(next[i], 100 * w + (lane + 1) % warp_lanes);
    }
}

/// Sorted keys, some of them equal, and boxes that are near where the keys are.
struct HplocInput {
    std::vector<std::uint32_t> keys, ids;
    std::vector<Aabb> boxes;

    explicit HplocInput(std::uint32_t n, unsigned seed) : keys(n), ids(n), boxes(n) {
        std::mt19937 random(seed);
        for (std::uint32_t& key : keys) key = static_cast<std::uint32_t>(random()) >> 12 << 2;
        std::ranges::sort(keys);
        std::iota(ids.begin(), ids.end(), 0u);
        std::ranges::shuffle(ids, random);
        std::uniform_real_distribution<float> around(0.0f, 1e4f);
        for (std::uint32_t i = 0; i < n; ++i) {
            const Vec3 lo{static_cast<float>(keys[i]), around(random), around(random)};
            boxes[i] = {lo, {lo.x + around(random), lo.y + 1, lo.z + around(random)}};
        }
    }
};

struct HplocResult {
    std::vector<ClusterRef> lists;
    std::vector<std::uint32_t> meeting;
    std::vector<ClusterNode> nodes;
    ClusterRef root = 0;

    template <class Launcher>
    HplocResult(Launcher& launcher, const HplocInput& input)
        : lists(input.keys.size()), meeting(input.keys.size()), nodes(input.keys.size()) {
        const auto n = static_cast<std::uint32_t>(input.keys.size());
        if (n != 0) std::memset(static_cast<void*>(nodes.data()), 0xA5, n * sizeof(ClusterNode));
        launch_hploc(launcher,
                     HplocArrays<std::uint32_t, BoxArray>{{input.keys.data(), n},
                                                          input.ids.data(),
                                                          {input.boxes.data()},
                                                          2,
                                                          lists.data(),
                                                          meeting.data(),
                                                          nodes.data(),
                                                          &root},
                     &n, n);
    }
};

TEST(LaneWarp, MergesClustersAsTheHostDoes) {
    // Two warps and four, each of which meets another at once: there the thread sanitizer sees
    // whether lanes lean on what only one of theirs has acquired. It did not with 400.
    for (const std::uint32_t n : {2u, 33u, 64u, 100u, 400u}) {
        if (sanitized && n > 100) continue;
        SCOPED_TRACE(std::to_string(n) + " primitives, seed " + std::to_string(n));
        const HplocInput input(n, n);
        HostLauncher<> host;
        LaneLauncher lanes;
        const HplocResult expected(host, input), result(lanes, input);
        EXPECT_EQ(result.root, expected.root);
        constexpr std::size_t without_padding = offsetof(ClusterNode, sum) + sizeof(ClusterSum);
        for (std::uint32_t i = 0; i < n; ++i)
            EXPECT_EQ(std::memcmp(&result.nodes[i], &expected.nodes[i], without_padding), 0) << i;
    }
}

TEST(LaneWarp, SortsAndScans) {
    for (const std::uint32_t n : {33u, 1025u}) {
        SCOPED_TRACE(std::to_string(n) + " pairs, seed " + std::to_string(n));
        std::mt19937_64 random(n);
        std::vector<std::uint64_t> keys(n), sorted(n);
        std::vector<std::uint32_t> values(n), sorted_values(n), expected(n);
        for (std::uint64_t& key : keys) key = random() & 0x1F;
        std::iota(values.begin(), values.end(), 0u);
        std::iota(expected.begin(), expected.end(), 0u);
        const std::vector<std::uint64_t> given = keys;
        std::ranges::stable_sort(expected, {}, [&](std::uint32_t i) { return given[i]; });
        Arena sizing;
        static_cast<void>(SortScratch(sizing, n));
        std::vector<std::byte> memory(sizing.bytes());
        Arena arena(memory.data(), memory.size());
        LaneLauncher launcher;
        launch_sort(launcher, "sort",
                    SortArrays<std::uint64_t>{keys.data(), values.data(), sorted.data(),
                                              sorted_values.data()},
                    {n, nullptr}, 5, SortScratch(arena, n));
        EXPECT_EQ(sorted_values, expected);
    }
}

}  // namespace
}  // namespace raydix::test
