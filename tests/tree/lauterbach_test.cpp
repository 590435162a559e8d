// Split lists: the talk's example level by level, ranges against a recursion, bands, and the memory
// they take.
#include "tree/lauterbach.h"

#include <gtest/gtest.h>
#include <raydix/error.h>

#include "support/launched_tree.h"

namespace raydix::test {
namespace {

template <class Key>
void run_with_bands(LaunchedTree<Key>& tree, std::uint32_t width) {
    HostLauncher<> launcher;
    launch_lauterbach(
        launcher, tree.in,
        tree.template scratch<LauterbachScratch>(tree.in.count, tree.level_limit, width),
        tree.links(), tree.levels());
}

const auto run = [](auto& tree) {
    run_with_bands(tree, lauterbach_band_width(tree.in.count, tree.level_limit,
                                               lauterbach_memory_limit(tree.in.count)));
};

template <class Key>
void expect_talk(std::uint32_t width) {
    const std::vector<Key> keys = talk_keys<Key>();
    LaunchedTree<Key> tree(keys, 1);
    run_with_bands(tree, width);
    EXPECT_EQ(tree.ranges(), talk_ranges());
    // Nodes by the bit that divides them: prefixes of 0; 1; 2, 2; 3; 4, 4 bits.
    std::vector<std::uint32_t> per_bit(tree.level_count.begin(), tree.level_count.begin() + 6);
    EXPECT_EQ(per_bit, (std::vector<std::uint32_t>{1, 1, 2, 1, 2, 0}));
    // Within a level nodes stand in the order of their keys: (0, 3) before (5, 7), (2, 3) before
    // (5, 6).
    EXPECT_EQ(tree.nodes[pair_slot(0)].first, pair_slot(2));
    EXPECT_EQ(tree.nodes[pair_slot(1) + 1].first, pair_slot(3));
    EXPECT_EQ(tree.nodes[pair_slot(2)].first, pair_slot(4));
    EXPECT_EQ(tree.nodes[pair_slot(2) + 1].first, pair_slot(5));
    EXPECT_EQ(tree.nodes[pair_slot(3)].first, pair_slot(6));
}

TEST(Lauterbach, WorkedExample) {
    for (const std::uint32_t width : {1u, 2u, 3u, 5u, 16u}) {
        SCOPED_TRACE("bands of " + std::to_string(width));
        expect_talk<std::uint32_t>(width);
        expect_talk<std::uint64_t>(width);
    }
}

TEST(Lauterbach, SplitsBelowTheCommonPrefix) {
    const std::uint32_t keys[] = {0, 1, 1, 0x20000000};
    const ExtendedKeys<std::uint32_t, NoProbe> extended{{keys, 4}, 2};
    EXPECT_EQ(extended.split_level(0), 30u);      // the last bit of the code
    EXPECT_EQ(extended.split_level(1), 30u + 1);  // positions 01 and 10
    EXPECT_EQ(extended.split_level(2), 1u);
    const LevelBand band{29, 2};  // levels 30 and 31 of 32
    EXPECT_EQ(band.split_count(30), 2u);
    EXPECT_EQ(band.split_count(31), 1u);
    EXPECT_EQ(band.split_count(32), 0u);
    EXPECT_EQ(band.split_count(1), 2u);
    EXPECT_EQ(band.first_level(1), 30u);
    EXPECT_EQ(band.first_level(31), 31u);
}

TEST(Lauterbach, RangesAreThoseOfTheRecursion) {
    expect_reference_ranges<std::uint32_t>(run);
    expect_reference_ranges<std::uint64_t>(run);
}

TEST(Lauterbach, TheTreeDoesNotDependOnTheBands) {
    std::mt19937_64 random(9);
    const auto keys = random_keys<std::uint32_t>(random, 3000, 1u << 10);
    LaunchedTree<std::uint32_t> wide(keys, 2);
    run_with_bands(wide, 16);
    for (const std::uint32_t width : {1u, 3u, 5u}) {
        LaunchedTree<std::uint32_t> tree(keys, 2);
        run_with_bands(tree, width);
        ASSERT_EQ(tree.inner_count, wide.inner_count);
        EXPECT_EQ(tree.level_count, wide.level_count);
        for (std::size_t slot = 0; slot < 2 * std::size_t{tree.inner_count} + 2; ++slot) {
            ASSERT_EQ(tree.nodes[slot].first, wide.nodes[slot].first) << "slot " << slot;
            ASSERT_EQ(tree.nodes[slot].count, wide.nodes[slot].count) << "slot " << slot;
        }
    }
}

TEST(Lauterbach, ScratchStaysBelow64BytesAPrimitive) {
    for (const std::uint32_t n : {100'000u, 2'000'000u, 10'000'000u, 1u << 30, (1u << 31) - 1}) {
        for (const int bits : {30, 63}) {
            const std::uint32_t levels = lbvh_depth_bound(bits, n);
            const std::uint32_t width =
                lauterbach_band_width(n, levels, lauterbach_memory_limit(n));
            EXPECT_GE(width, 1u);
            EXPECT_LE(scratch_bytes<LauterbachScratch>(n, levels, width),
                      std::uint64_t{64} * n + 16384);
            EXPECT_LT(std::uint64_t{n} * width, std::uint64_t{1} << 32);
        }
    }
    EXPECT_EQ(lauterbach_band_width(10'000'000, 54, lauterbach_memory_limit(10'000'000)), 5u);
}

TEST(Lauterbach, RefusesWhatDoesNotFitAndNamesTheBytes) {
    const std::uint32_t n = 1'000'000, levels = lbvh_depth_bound(63, n);
    const std::size_t least = scratch_bytes<LauterbachScratch>(n, levels, 1u);
    EXPECT_EQ(lauterbach_band_width(n, levels, least), 1u);
    try {
        static_cast<void>(lauterbach_band_width(n, levels, least - 1));
        FAIL() << "no error";
    } catch (const InputError& error) {
        EXPECT_NE(std::string(error.what()).find(std::to_string(least) + " bytes"),
                  std::string::npos)
            << error.what();
        EXPECT_NE(std::string(error.what()).find(std::to_string(n) + " primitives"),
                  std::string::npos);
    }
}

}  // namespace
}  // namespace raydix::test
