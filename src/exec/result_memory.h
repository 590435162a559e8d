// How much memory is left to this process.
#pragma once

#include <cstdint>
#include <filesystem>

namespace raydix {

/// What was found nowhere.
inline constexpr std::uint64_t unknown_memory = ~std::uint64_t{0};

/// Bytes that the system still has without swapping, by a file as /proc/meminfo is.
[[nodiscard]] std::uint64_t system_memory_left(const std::filesystem::path& meminfo);

/// Bytes that the memory control groups of this process leave, the least of all levels. `cgroup`: a
/// file as /proc/self/cgroup; `mount`: as /sys/fs/cgroup, of version 1, 2 or both.
[[nodiscard]] std::uint64_t group_memory_left(const std::filesystem::path& cgroup,
                                              const std::filesystem::path& mount);

/// The lesser of both; the physical memory where neither is known.
[[nodiscard]] std::uint64_t available_memory();

/// The greatest number where the product does not fit.
[[nodiscard]] inline std::uint64_t saturating_product(std::uint64_t a, std::uint64_t b) {
    return b != 0 && a > unknown_memory / b ? unknown_memory : a * b;
}

[[nodiscard]] inline std::uint64_t saturating_sum(std::uint64_t a, std::uint64_t b) {
    return a > unknown_memory - b ? unknown_memory : a + b;
}

}  // namespace raydix
