// Scans and sorts by warps (exec/warp_scan.h, warp_sort.h) with the host's warps against the
// standard library: sizes around those of warps and tiles, counts that lie in memory, and not a
// byte of scratch more than was asked for.
#include "exec/warp_sort.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>
#include <vector>

#include "support/guarded_memory.h"
#include "support/sanitized.h"

namespace raydix::test {
namespace {

constexpr std::uint32_t sizes[] = {0, 1, 2, 31, 32, 33, 255, 256, 257, 1023, 1024, 1025, 40'000};
constexpr std::uint32_t untouched = 0xDDDDDDDDu;

/// Scratch of exactly the size that `Scratch` asks for.
template <class Scratch>
struct ExactScratch {
    GuardedMemory memory;
    Arena arena;
    Scratch scratch;

    explicit ExactScratch(std::uint32_t limit)
        : memory(size_for(limit), std::byte{0xA5}, GuardedMemory::Exact::end),
          arena(memory.data(), memory.size()),
          scratch(arena, limit) {}

private:
    static std::size_t size_for(std::uint32_t limit) {
        Arena sizing;
        static_cast<void>(Scratch(sizing, limit));
        return sizing.bytes();
    }
};

template <class T>
std::vector<T> numbers(std::uint32_t n, T most) {
    std::mt19937_64 random(n);
    std::uniform_int_distribution<std::uint64_t> up_to_most(0, most);
    std::vector<T> values(n);
    for (T& value : values) value = static_cast<T>(up_to_most(random));
    return values;
}

template <class T>
void scan_like_the_standard_library(std::uint32_t n, T most) {
    SCOPED_TRACE(std::to_string(n) + " values, seed " + std::to_string(n));
    const std::vector<T> given = numbers<T>(n, most);
    std::vector<T> expected(n);
    std::exclusive_scan(given.begin(), given.end(), expected.begin(), T{0});
    const T sum = std::accumulate(given.begin(), given.end(), T{0});
    HostLauncher<> launcher;
    ExactScratch<ScanScratch<T>> lent(n);
    std::vector<T> values = given;
    T total = 77;
    launch_scan(launcher, "scan", ScanJob<T>{values.data(), {n, nullptr}, &total}, lent.scratch);
    EXPECT_EQ(values, expected);
    EXPECT_EQ(total, sum);
}

TEST(WarpScan, SumsBeforeEachValueAndOfAll) {
    for (const std::uint32_t n : sizes) {
        scan_like_the_standard_library<std::uint32_t>(n, 5);
        scan_like_the_standard_library<std::uint32_t>(n, 0);
        scan_like_the_standard_library<std::uint32_t>(n, 0xFFFFFFFFu);  // sums wrap around
        scan_like_the_standard_library<std::uint64_t>(n, 1ull << 45);
    }
    scan_like_the_standard_library<std::uint32_t>(1024 * 1024 + 1, 3);  // three levels of tiles
}

TEST(WarpScan, ACountInMemoryEndsItEarlier) {
    for (const std::uint32_t limit : sizes)
        for (const std::uint32_t count : {0u, 1u, limit / 2, limit, limit + 5}) {
            SCOPED_TRACE(std::to_string(count) + " of " + std::to_string(limit));
            const std::uint32_t n = std::min(count, limit);
            std::vector<std::uint32_t> values = numbers<std::uint32_t>(limit, 9);
            values.push_back(untouched);
            std::vector<std::uint32_t> expected = values;
            expected[n] = std::accumulate(values.begin(), values.begin() + n, 0u);
            std::exclusive_scan(values.begin(), values.begin() + n, expected.begin(), 0u);
            HostLauncher<> launcher;
            ExactScratch<ScanScratch<std::uint32_t>> lent(limit);
            launch_scan(launcher, "scan",
                        ScanJob<std::uint32_t>{values.data(), {limit, &count}, nullptr, true},
                        lent.scratch);
            EXPECT_EQ(values, expected);
        }
}

/// Pairs of a key and its place, sorted by the lowest `bits` of the key.
template <class Key>
void sort_like_the_standard_library(const std::vector<Key>& keys, std::uint32_t count, int bits) {
    const auto limit = static_cast<std::uint32_t>(keys.size());
    SCOPED_TRACE(std::to_string(count) + " of " + std::to_string(limit) + " keys, " +
                 std::to_string(bits) + " bits");
    const std::uint32_t n = std::min(count, limit);
    const Key mask = static_cast<Key>(bits == 8 * sizeof(Key) ? ~Key{0} : (Key{1} << bits) - 1);
    std::vector<std::uint32_t> values(limit), expected(n);
    std::iota(values.begin(), values.end(), 0u);
    std::iota(expected.begin(), expected.end(), 0u);
    std::ranges::stable_sort(expected, {}, [&](std::uint32_t i) { return Key(keys[i] & mask); });
    std::vector<Key> lost = keys, sorted_keys(limit);
    std::vector<std::uint32_t> sorted_values(limit, untouched);
    HostLauncher<> launcher;
    ExactScratch<SortScratch> lent(limit);
    launch_sort(
        launcher, "sort",
        SortArrays<Key>{lost.data(), values.data(), sorted_keys.data(), sorted_values.data()},
        {limit, &count}, bits, lent.scratch);
    for (std::uint32_t i = 0; i < n; ++i) {
        ASSERT_EQ(sorted_values[i], expected[i]) << i;
        ASSERT_EQ(sorted_keys[i], keys[expected[i]]) << i;
    }
    EXPECT_TRUE(std::all_of(sorted_values.begin() + n, sorted_values.end(),
                            [](std::uint32_t value) { return value == untouched; }));
}

template <class Key>
void sort_each_kind_of_input(std::uint32_t n, int bits) {
    std::vector<Key> keys = numbers<Key>(n, static_cast<Key>(~Key{0}));
    sort_like_the_standard_library(keys, n, bits);
    sort_like_the_standard_library(keys, n / 3, bits);
    sort_like_the_standard_library(keys, n + 9, bits);
    std::ranges::sort(keys);
    sort_like_the_standard_library(keys, n, bits);
    std::ranges::reverse(keys);
    sort_like_the_standard_library(keys, n, bits);
    sort_like_the_standard_library(std::vector<Key>(n, static_cast<Key>(0x5A)), n, bits);
    sort_like_the_standard_library(numbers<Key>(n, 3), n, bits);
}

TEST(WarpSort, StableAndLikeTheStandardLibrary) {
    for (const std::uint32_t size : sizes) {
        const auto n = static_cast<std::uint32_t>(size > 1025 ? fewer(size, 8) : size);
        sort_each_kind_of_input<std::uint8_t>(n, 6);
        sort_each_kind_of_input<std::uint32_t>(n, 30);
        sort_each_kind_of_input<std::uint32_t>(n, 32);
        sort_each_kind_of_input<std::uint64_t>(n, 63);
    }
    for (const int bits : {1, 4, 5, 6, 10, 11, 64})
        sort_each_kind_of_input<std::uint64_t>(300, bits);
}

}  // namespace
}  // namespace raydix::test
