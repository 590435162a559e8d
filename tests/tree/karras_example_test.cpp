// The worked example of Karras's talk: eight keys of five bits, every range and level known by
// hand. Then common prefixes of equal keys, and the byte scanners of the fast builder.
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <iostream>
#include <random>
#include <utility>
#include <vector>

#include "tree/byte_scan.h"
#include "tree/radix_tree.h"

namespace raydix::test {
namespace {

/// Five bits at the top of a code, so that prefixes are counted from the first of them.
template <class Key>
std::vector<Key> example_keys() {
    std::vector<Key> keys;
    for (const unsigned key :
         {0b00001u, 0b00010u, 0b00100u, 0b00101u, 0b10011u, 0b11000u, 0b11001u, 0b11110u})
        keys.push_back(Key{key} << (CodeFormat<Key>::bits - 5));
    return keys;
}

template <class Key>
std::vector<RadixRange> all_ranges(const std::vector<Key>& keys) {
    const SortedKeys<Key> sorted{keys.data(), static_cast<std::uint32_t>(keys.size())};
    std::vector<RadixRange> ranges;
    for (std::uint32_t i = 0; i + 1 < keys.size(); ++i) ranges.push_back(find_range(sorted, i));
    return ranges;
}

/// Inner nodes per level below the node with this range: a range of one key is a leaf.
void count_levels(const std::vector<RadixRange>& ranges, std::uint32_t node, std::size_t level,
                  std::vector<int>& counts) {
    counts.resize(std::max(counts.size(), level + 1));
    ++counts[level];
    const RadixRange& range = ranges[node];
    if (range.split > range.first) count_levels(ranges, range.split, level + 1, counts);
    if (range.split + 1 < range.last) count_levels(ranges, range.split + 1, level + 1, counts);
}

template <class Key>
void expect_example() {
    const std::vector<Key> keys = example_keys<Key>();
    const std::vector<RadixRange> ranges = all_ranges(keys);
    const std::pair<unsigned, unsigned> wanted[] = {{0, 7}, {0, 1}, {2, 3}, {0, 3},
                                                    {4, 7}, {5, 7}, {5, 6}};
    const unsigned splits[] = {3, 0, 2, 1, 4, 6, 5};
    const int prefixes[] = {0, 3, 4, 2, 1, 2, 4};
    const SortedKeys<Key> sorted{keys.data(), 8};
    for (std::size_t i = 0; i < 7; ++i) {
        EXPECT_EQ(ranges[i].first, wanted[i].first) << "node " << i;
        EXPECT_EQ(ranges[i].last, wanted[i].second) << "node " << i;
        EXPECT_EQ(ranges[i].split, splits[i]) << "node " << i;
        EXPECT_EQ(sorted.common_prefix(ranges[i].first, ranges[i].last), prefixes[i]) << i;
    }
    std::vector<int> levels;
    count_levels(ranges, 0, 0, levels);
    EXPECT_EQ(levels, (std::vector<int>{1, 2, 3, 1}));
}

TEST(KarrasExample, RangesSplitsAndLevels) {
    expect_example<std::uint32_t>();
    expect_example<std::uint64_t>();
}

TEST(CommonPrefix, CountsFromTheFirstBitOfTheCode) {
    const std::uint32_t keys[] = {0, 1, 0x1FFFFFFF, 0x20000000, 0x3FFFFFFF};
    const SortedKeys<std::uint32_t> sorted{keys, 5};
    EXPECT_EQ(sorted.common_prefix(0, 1), 29);  // only the last of 30 bits differs
    EXPECT_EQ(sorted.common_prefix(0, 2), 1);
    EXPECT_EQ(sorted.common_prefix(0, 3), 0);
    EXPECT_EQ(sorted.common_prefix(3, 4), 1);
    EXPECT_EQ(sorted.common_prefix(4, 3), 1);
    EXPECT_EQ(sorted.common_prefix(0, -1), -1);
    EXPECT_EQ(sorted.common_prefix(4, 5), -1);
}

TEST(CommonPrefix, PositionsDecideBetweenEqualKeys) {
    const std::vector<std::uint64_t> keys(9, 77);
    const SortedKeys<std::uint64_t> sorted{keys.data(), 9};
    EXPECT_EQ(sorted.common_prefix(0, 1), 63 + 31);  // positions 0000 and 0001
    EXPECT_EQ(sorted.common_prefix(0, 2), 63 + 30);
    EXPECT_EQ(sorted.common_prefix(2, 3), 63 + 31);
    EXPECT_EQ(sorted.common_prefix(3, 4), 63 + 29);
    EXPECT_EQ(sorted.common_prefix(7, 8), 63 + 28);
    EXPECT_EQ(sorted.common_prefix(8, 9), -1);
}

TEST(CommonPrefix, EqualKeysMakeABalancedTree) {
    const std::vector<std::uint32_t> keys(8, 5);
    const std::vector<RadixRange> ranges = all_ranges(keys);
    std::vector<int> levels;
    count_levels(ranges, 0, 0, levels);
    EXPECT_EQ(levels, (std::vector<int>{1, 2, 4}));
}

/// Bytes with sixteen to spare on both sides, as the scanners read whole sixteens.
struct Row {
    std::vector<std::uint8_t> bytes;
    [[nodiscard]] const std::uint8_t* at(std::size_t i) const { return bytes.data() + 16 + i; }
};

Row random_row(std::mt19937_64& random, std::size_t n, unsigned values) {
    Row row{std::vector<std::uint8_t>(n + 32)};
    for (std::uint8_t& byte : row.bytes)
        byte = static_cast<std::uint8_t>(random() % 8 == 0 ? 0 : 255 - random() % values);
    return row;
}

TEST(ByteScan, AgreesWithALoop) {
    constexpr std::uint64_t seed = 7;
    std::cout << "seed " << seed << "\n";
    std::mt19937_64 random(seed);
    for (int round = 0; round < 20'000; ++round) {
        constexpr std::uint32_t limit = 64;
        const Row row = random_row(random, 2 * limit, 1 + static_cast<unsigned>(random() % 255));
        const auto threshold = static_cast<std::uint8_t>(random());
        const std::uint8_t* p = row.at(limit);
        std::uint32_t forward = 0, backward = 0;
        while (forward < limit && p[forward] > threshold) ++forward;
        while (backward < limit && p[-1 - static_cast<int>(backward)] > threshold) ++backward;
        ASSERT_EQ(count_above(p, limit, threshold), forward) << "round " << round;
        ASSERT_EQ(count_above_backward(p, limit, threshold), backward) << "round " << round;
        const std::uint8_t value = p[random() % limit];
        const auto place = static_cast<std::uint32_t>(std::find(p, p + limit, value) - p);
        ASSERT_EQ(find_byte(p, value), place) << "round " << round;
    }
}

TEST(ByteScan, StopsAtEachPlaceAndAtTheLimit) {
    for (std::uint32_t place = 0; place <= 48; ++place) {
        std::vector<std::uint8_t> bytes(112, 200);
        const std::uint8_t* middle = bytes.data() + 56;
        bytes[56 + place] = 100;
        bytes[55 - place] = 100;
        const std::uint32_t wanted = std::min(place, 48u);
        for (const int threshold : {100, 150, 199}) {  // equal to it is not above it
            const auto byte = static_cast<std::uint8_t>(threshold);
            EXPECT_EQ(count_above(middle, 48, byte), wanted);
            EXPECT_EQ(count_above_backward(middle, 48, byte), wanted);
        }
        EXPECT_EQ(count_above(middle, 48, 99), 48u);
        EXPECT_EQ(count_above_backward(middle, 48, 200), 0u);
        if (place < 48) {
            EXPECT_EQ(find_byte(middle, 100), place);
        }
    }
}

TEST(ByteScan, MasksAreOfUnsignedBytes) {
    std::uint8_t a[16], b[16];
    std::uint32_t not_above = 0, equal = 0;
    for (unsigned k = 0; k < 16; ++k) {
        a[k] = static_cast<std::uint8_t>(17 * k);
        b[k] = static_cast<std::uint8_t>(k % 3 == 0 ? 17 * k : 255 - 17 * k);
        not_above |= std::uint32_t{a[k] <= b[k]} << k;
        equal |= std::uint32_t{a[k] == b[k]} << k;
    }
    EXPECT_EQ(not_above_mask(Bytes16::load(a), Bytes16::load(b)), not_above);
    EXPECT_EQ(equal_mask(Bytes16::load(a), Bytes16::load(b)), equal);
    const Bytes16 low = min_of(Bytes16::load(a), Bytes16::load(b));
    EXPECT_EQ(not_above_mask(low, Bytes16::load(b)), 0xFFFFu);
    EXPECT_EQ(equal_mask(low, Bytes16::load(a)), not_above);
}

}  // namespace
}  // namespace raydix::test
