#include "points/query_order.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "exec/parallel.h"
#include "points/curve.h"
#include "sort/radix_sort.h"

namespace raydix {
namespace {

/// Fewer are over before a sort would pay.
constexpr std::size_t fewest_sorted = 4096;

/// Whether most queries lie beside the one before: looks at some runs of the batch.
template <class T, int Dim>
bool is_coherent(const T* queries, std::size_t n, std::size_t stride, const T* lo, const T* hi) {
    constexpr std::size_t samples = 1024;
    // 2^6 queries are some cells of a grid of n cells; neighbours along a curve rarely part more.
    T longest = 0;
    for (int d = 0; d < Dim; ++d) longest = std::max(longest, hi[d] - lo[d]);
    const T reach = longest * static_cast<T>(std::pow(64.0 / static_cast<double>(n), 1.0 / Dim));
    std::size_t near = 0;
    for (std::size_t s = 0; s < samples; ++s) {
        const std::size_t i = s * (n - 1) / samples;
        const T *a = queries + i * stride, *b = a + stride;
        T farthest = 0;
        for (int d = 0; d < Dim; ++d) farthest = std::max(farthest, std::abs(a[d] - b[d]));
        near += farthest <= reach;
    }
    return near >= samples * 3 / 4;
}

}  // namespace

template <class T, int Dim>
std::vector<std::uint32_t> order_of_queries(const T* queries, std::size_t n, std::size_t stride,
                                            const T* lo, const T* hi, QueryOrder wanted) {
    if (wanted == QueryOrder::as_given || n < 2 || n > std::numeric_limits<std::int32_t>::max())
        return {};
    if (wanted == QueryOrder::automatic &&
        (n < fewest_sorted || is_coherent<T, Dim>(queries, n, stride, lo, hi)))
        return {};
    const CurveGrid<T, Dim> grid(lo, hi);
    std::vector<std::uint32_t> keys(n), order(n);
    for_each_range(n, 4096, [&](std::size_t begin, std::size_t end) {
        grid.codes(queries + begin * stride, end - begin, keys.data() + begin, stride);
    });
    SortScratch<std::uint32_t> scratch;
    sort_keys<std::uint32_t>(keys, order, grid.bits, scratch);
    return order;
}

#define RAYDIX_QUERY_ORDER(T, Dim)                                \
    template std::vector<std::uint32_t> order_of_queries<T, Dim>( \
        const T*, std::size_t, std::size_t, const T*, const T*, QueryOrder);
RAYDIX_QUERY_ORDER(float, 2)
RAYDIX_QUERY_ORDER(float, 3)
RAYDIX_QUERY_ORDER(double, 2)
RAYDIX_QUERY_ORDER(double, 3)
#undef RAYDIX_QUERY_ORDER

}  // namespace raydix
