// The sort against std::stable_sort: every size at which the code takes another path, and keys that
// are hard on it.
#include "sort/radix_sort.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <iostream>
#include <numeric>
#include <random>
#include <vector>

#include "exec/parallel.h"
#include "support/sanitized.h"
#include "support/support.h"

namespace raydix::test {
namespace {

using Random = std::mt19937_64;
constexpr std::uint64_t radix_sort_seed = 20261121;
constexpr std::size_t small_sizes[] = {0, 1, 2, 3, 23, 24, 25, 26, 1000};

/// Makes key i of n; `bits` are free to be set.
struct Pattern {
    const char* name;
    std::uint64_t (*key)(Random&, std::size_t i, std::size_t n, int bits);
};

std::uint64_t low_bits(std::uint64_t x, int bits) {
    return bits == 64 ? x : x & ((std::uint64_t{1} << bits) - 1);
}

const Pattern patterns[] = {
    {"random", [](Random& r, std::size_t, std::size_t, int b) { return low_bits(r(), b); }},
    {"equal", [](Random&, std::size_t, std::size_t, int b) { return low_bits(0x5A5A5A5A5A, b); }},
    {"zero", [](Random&, std::size_t, std::size_t, int) { return std::uint64_t{0}; }},
    {"all ones", [](Random&, std::size_t, std::size_t, int b) { return low_bits(~0ull, b); }},
    {"two values",
     [](Random& r, std::size_t, std::size_t, int b) { return low_bits(r() % 2 ? ~0ull : 1, b); }},
    {"sorted", [](Random&, std::size_t i, std::size_t, int) { return std::uint64_t{i}; }},
    {"reversed", [](Random&, std::size_t i, std::size_t n, int) { return std::uint64_t{n - i}; }},
    {"spread and sorted",
     [](Random&, std::size_t i, std::size_t n, int b) { return low_bits(~0ull, b) / n * i; }},
    {"few distinct", [](Random& r, std::size_t, std::size_t,
                        int b) { return low_bits((r() % 17) * 0x9E3779B97F4A7C15ull, b); }},
    {"long common prefix, low bits differ",
     [](Random& r, std::size_t, std::size_t, int b) {
         return low_bits(0x6DB6DB6DB6DB6DB6ull, b) ^ (r() & 7);
     }},
    {"two prefixes, low bits differ",
     [](Random& r, std::size_t, std::size_t, int b) {
         return low_bits(r() % 2 ? 0x1248124812481248ull : ~0ull, b) ^ (r() & 0xFF);
     }},
    {"nearly all in one bucket",
     [](Random& r, std::size_t, std::size_t, int b) {
         return r() % 1000 == 0 ? low_bits(r(), b) : low_bits(r(), b) >> (b / 2);
     }},
    {"geometric clusters",
     [](Random& r, std::size_t, std::size_t, int b) {
         const auto shift = static_cast<int>(r() % static_cast<unsigned>(b));
         return low_bits(r(), b) >> shift;
     }},
    {"nested clusters",
     [](Random& r, std::size_t, std::size_t, int b) {
         const int kept = static_cast<int>(r() % static_cast<unsigned>(b));
         return low_bits(0xB6DB6DB6DB6DB6DBull, b) ^ low_bits(r(), std::max(kept, 1));
     }},
};

template <class Key>
std::vector<Key> make_keys(const Pattern& pattern, std::size_t n, int bits) {
    Random random(radix_sort_seed);
    std::vector<Key> keys(n);
    for (std::size_t i = 0; i < n; ++i)
        keys[i] = static_cast<Key>(low_bits(pattern.key(random, i, n, bits), bits));
    return keys;
}

template <class Key>
struct Sorted {
    std::vector<Key> keys;
    std::vector<std::uint32_t> order;
    bool operator==(const Sorted&) const = default;
};

template <class Key>
Sorted<Key> sort_by_the_library(const std::vector<Key>& keys) {
    Sorted<Key> sorted{keys, std::vector<std::uint32_t>(keys.size())};
    std::iota(sorted.order.begin(), sorted.order.end(), 0u);
    std::ranges::stable_sort(sorted.order, {}, [&](std::uint32_t i) { return keys[i]; });
    for (std::size_t i = 0; i < keys.size(); ++i) sorted.keys[i] = keys[sorted.order[i]];
    return sorted;
}

template <class Key>
Sorted<Key> sort_by_radix(const std::vector<Key>& keys, int bits, int threads,
                          SortScratch<Key>& scratch) {
    // Garbage in `order`: it is output only.
    Sorted<Key> sorted{keys, std::vector<std::uint32_t>(keys.size(), 0xDEADBEEFu)};
    with_threads(threads, [&] {
        sort_keys<Key>(std::span(sorted.keys), std::span(sorted.order), bits, scratch);
    });
    return sorted;
}

template <class Key>
void expect_sorted(const Pattern& pattern, std::size_t n, int bits, SortScratch<Key>& scratch) {
    const std::vector<Key> keys = make_keys<Key>(pattern, n, bits);
    const Sorted<Key> wanted = sort_by_the_library(keys);
    for (const int threads : {1, 2, 7})
        ASSERT_TRUE(sort_by_radix(keys, bits, threads, scratch) == wanted)
            << pattern.name << ", " << n << " keys of " << bits << " bits, " << threads
            << " threads, seed " << radix_sort_seed;
}

template <class Key>
void expect_all_sorted(std::span<const std::size_t> sizes, int bits) {
    for (const Pattern& pattern : patterns) {
        SortScratch<Key> scratch;  // kept from size to size
        for (const std::size_t n : sizes) expect_sorted(pattern, n, bits, scratch);
    }
}

TEST(RadixSort, SmallInputsOf30Bits) { expect_all_sorted<std::uint32_t>(small_sizes, 30); }
TEST(RadixSort, SmallInputsOf32Bits) { expect_all_sorted<std::uint32_t>(small_sizes, 32); }
TEST(RadixSort, SmallInputsOf63Bits) { expect_all_sorted<std::uint64_t>(small_sizes, 63); }
TEST(RadixSort, SmallInputsOf64Bits) { expect_all_sorted<std::uint64_t>(small_sizes, 64); }
TEST(RadixSort, FewBits) {
    for (const int bits : {1, 2, 7, 12}) expect_all_sorted<std::uint64_t>(small_sizes, bits);
}

/// Large enough for several blocks, and for buckets that one thread may not keep to itself.
constexpr std::size_t large_sizes[] = {thorough == 1 ? 70'000 : 100'000, 50'000 * thorough};

TEST(RadixSort, LargeInputsOf30Bits) { expect_all_sorted<std::uint32_t>(large_sizes, 30); }
TEST(RadixSort, LargeInputsOf63Bits) { expect_all_sorted<std::uint64_t>(large_sizes, 63); }
TEST(RadixSort, LargeInputsOf64Bits) { expect_all_sorted<std::uint64_t>(large_sizes, 64); }

TEST(RadixSort, ScratchIsKeptAndMayBeTooSmallOrTooLarge) {
    SortScratch<std::uint64_t> scratch;
    const std::size_t most = thorough == 1 ? fewer(80'000, 2) : 400'000;
    for (const std::size_t n :
         {std::size_t{1000}, most, std::size_t{10}, std::size_t{0}, most / 6, most})
        for (const Pattern& pattern : patterns) {
            const auto keys = make_keys<std::uint64_t>(pattern, n, 63);
            ASSERT_TRUE(sort_by_radix(keys, 63, 2, scratch) == sort_by_the_library(keys))
                << pattern.name << ", " << n;
        }
    const void* records = scratch.records.data();
    const auto keys = make_keys<std::uint64_t>(patterns[0], most / 4 * 3, 63);
    (void)sort_by_radix(keys, 63, 2, scratch);
    EXPECT_EQ(scratch.records.data(), records) << "memory that was large enough was given up";
}

TEST(RadixSort, ManyRandomShapes) {
    Random random(radix_sort_seed);
    std::cout << "seed " << radix_sort_seed << "\n";
    SortScratch<std::uint64_t> scratch;
    for (int round = 0; round < 300; ++round) {
        const auto bits = static_cast<int>(1 + random() % 64);
        const Pattern& pattern = patterns[random() % std::size(patterns)];
        const std::size_t n = random() % 5000;
        const auto keys = make_keys<std::uint64_t>(pattern, n, bits);
        ASSERT_TRUE(sort_by_radix(keys, bits, 2, scratch) == sort_by_the_library(keys))
            << pattern.name << ", " << n << " keys of " << bits << " bits";
    }
}

}  // namespace
}  // namespace raydix::test
