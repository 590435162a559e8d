// Prefix sums. values [n] -> values [n], each replaced by the sum of those before it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace raydix {

/// Returns the sum of all. Parallel: sums per block, sums of blocks, then sums within blocks.
std::uint32_t exclusive_scan(std::span<std::uint32_t> values);
std::uint64_t exclusive_scan(std::span<std::uint64_t> values);

namespace detail {

inline constexpr std::size_t scan_block = 1u << 14;

/// Continues a prefix sum over a row of values; returns it behind the last.
template <class Probe, class T>
T scan_row(std::span<T> values, T sum) {
    for (T& value : values) {
        const T own = value;
        value = sum;
        sum += own;
    }
    Probe::bytes(2 * values.size_bytes());
    Probe::steps(values.size());
    return sum;
}

/// The prefix sum by any loop over blocks: loop(pass, n, block, body) calls body(b, begin, end) for
/// each block of [0, n) and tells the probe of its thread what the pass does.
template <class Probe, class T, class Loop>
T scan_blocks(std::span<T> values, const Loop& loop) {
    T total = 0;
    if (values.size() <= scan_block) {
        loop(".row", values.size(), scan_block,
             [&](std::size_t, std::size_t, std::size_t) { total = scan_row<Probe>(values, T{0}); });
        return total;
    }
    std::vector<T> sums((values.size() + scan_block - 1) / scan_block);
    loop(".sums", values.size(), scan_block,
         [&](std::size_t b, std::size_t begin, std::size_t end) {
             T sum = 0;
             for (std::size_t i = begin; i < end; ++i) sum += values[i];
             sums[b] = sum;
             Probe::bytes((end - begin + 1) * sizeof(T));
             Probe::steps(end - begin);
         });
    total = scan_blocks<Probe>(std::span<T>(sums), loop);
    loop(".place", values.size(), scan_block,
         [&](std::size_t b, std::size_t begin, std::size_t end) {
             scan_row<Probe>(values.subspan(begin, end - begin), sums[b]);
         });
    return total;
}

}  // namespace detail
}  // namespace raydix
