// Prefix sums of both widths, for sizes around the blocks that threads take.
#include "exec/scan.h"

#include <gtest/gtest.h>

#include <vector>

#include "exec/parallel.h"

namespace raydix {
namespace {

template <class T>
void expect_sums(T step) {
    for (const std::size_t n : {0u, 1u, 2u, 16383u, 16384u, 16385u, 100'000u})
        for (const int threads : {1, 3}) {
            std::vector<T> values(n);
            for (std::size_t i = 0; i < n; ++i) values[i] = static_cast<T>(i % 7 * step);
            T sum = 0, total = 0;
            std::vector<T> wanted(n);
            for (std::size_t i = 0; i < n; ++i) {
                wanted[i] = sum;
                sum += values[i];
            }
            with_threads(threads, [&] { total = exclusive_scan(std::span<T>(values)); });
            EXPECT_EQ(total, sum) << n;
            EXPECT_TRUE(values == wanted) << n << " values, " << threads << " threads";
        }
}

TEST(Scan, SumsOfTheValuesBefore) {
    expect_sums<std::uint32_t>(3);
    expect_sums<std::uint64_t>(std::uint64_t{1} << 33);
}

}  // namespace
}  // namespace raydix
