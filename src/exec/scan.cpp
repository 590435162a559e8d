#include "exec/scan.h"

#include <vector>

#include "exec/parallel.h"

namespace raydix {
namespace {

constexpr std::size_t block = 1u << 14;

std::uint32_t scan_serially(std::span<std::uint32_t> values, std::uint32_t sum) {
    for (std::uint32_t& value : values) {
        const std::uint32_t own = value;
        value = sum;
        sum += own;
    }
    return sum;
}

}  // namespace

std::uint32_t exclusive_scan(std::span<std::uint32_t> values) {
    if (values.size() <= block) return scan_serially(values, 0);
    std::vector<std::uint32_t> sums((values.size() + block - 1) / block);
    for_each_block(values.size(), block, [&](std::size_t b, std::size_t begin, std::size_t end) {
        std::uint32_t sum = 0;
        for (std::size_t i = begin; i < end; ++i) sum += values[i];
        sums[b] = sum;
    });
    const std::uint32_t total = exclusive_scan(sums);
    for_each_block(values.size(), block, [&](std::size_t b, std::size_t begin, std::size_t end) {
        scan_serially(values.subspan(begin, end - begin), sums[b]);
    });
    return total;
}

}  // namespace raydix
