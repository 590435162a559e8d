// Results of a size that the data decides are refused before they are allocated.
#pragma once

#include <cstdint>
#include <string>

namespace raydix {

/// Bytes that this process could still get without swapping, as the system and its control group
/// tell it; the greatest number if they do not.
[[nodiscard]] std::uint64_t available_memory();

/// What a result may take: `max_bytes`, or what is available if that is 0. Nobody is asked where
/// the result cannot be larger than `most_bytes` and that is little.
[[nodiscard]] std::uint64_t memory_limit(std::uint64_t max_bytes, std::uint64_t most_bytes);

/// Throws InputError that names `what` if a result of `bytes` is more than the limit.
void check_result_fits(const std::string& what, std::uint64_t bytes, std::uint64_t limit);

/// The greatest number where the product does not fit.
[[nodiscard]] std::uint64_t saturating_product(std::uint64_t a, std::uint64_t b);

}  // namespace raydix
