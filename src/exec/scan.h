// Prefix sums. values [n] -> values [n], each replaced by the sum of those before it.
#pragma once

#include <cstdint>
#include <span>

namespace raydix {

/// Returns the sum of all. Parallel: sums per block, sums of blocks, then sums within blocks.
std::uint32_t exclusive_scan(std::span<std::uint32_t> values);
std::uint64_t exclusive_scan(std::span<std::uint64_t> values);

}  // namespace raydix
