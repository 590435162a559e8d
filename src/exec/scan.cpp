#include "exec/scan.h"

#include <vector>

#include "exec/parallel.h"

namespace raydix {
namespace {

constexpr std::size_t block = 1u << 14;

template <class T>
T scan_serially(std::span<T> values, T sum) {
    for (T& value : values) {
        const T own = value;
        value = sum;
        sum += own;
    }
    return sum;
}

template <class T>
T scan(std::span<T> values) {
    if (values.size() <= block) return scan_serially<T>(values, 0);
    std::vector<T> sums((values.size() + block - 1) / block);
    for_each_block(values.size(), block, [&](std::size_t b, std::size_t begin, std::size_t end) {
        T sum = 0;
        for (std::size_t i = begin; i < end; ++i) sum += values[i];
        sums[b] = sum;
    });
    const T total = scan<T>(sums);
    for_each_block(values.size(), block, [&](std::size_t b, std::size_t begin, std::size_t end) {
        scan_serially(values.subspan(begin, end - begin), sums[b]);
    });
    return total;
}

}  // namespace

std::uint32_t exclusive_scan(std::span<std::uint32_t> values) { return scan(values); }
std::uint64_t exclusive_scan(std::span<std::uint64_t> values) { return scan(values); }

}  // namespace raydix
