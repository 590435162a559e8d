// Which order a batch of rays goes in whose neighbours start far apart: as given, or sorted.
#pragma once

#include <cstddef>
#include <span>

#include "exec/path_rates.h"

namespace raydix {

/// With fewer rays than this, to sort them takes longer than it saves, most often.
inline constexpr std::size_t least_rays_to_sort = 16384;

/// Rays 0 to n - 1, least_rays_to_sort or more, by trace(order, begin, end). Batches that are alike
/// try both orders and go on with the faster one; large ones whose rays start anywhere begin with
/// sorted rays. In a trial each order has half of the rays, the sorted ones in the middle: of a
/// smaller part more threads would wait for the last job.
template <class Trace>
void run_in_better_order(OrderRates& rates, const BatchKind& kind, std::size_t n,
                         const Trace& trace) {
    constexpr std::size_t many = 65536;
    const bool sorted_first = n >= many && kind.apart == BatchKind::anywhere;
    constexpr RayOrder orders[] = {RayOrder::given, RayOrder::sorted, RayOrder::given};
    rates.run_halves(std::span(orders).subspan(sorted_first ? 1 : 0, 2), 0, n, trace);
}

}  // namespace raydix
