// The order in which a batch of queries is worked off: along a Morton curve, so that neighbours in
// it read the same groups. Answers do not depend on it.
#pragma once

#include <raydix/points.h>

#include <cstddef>
#include <cstdint>
#include <vector>

namespace raydix {

/// queries: n points, each `stride` values after the other. Returns positions in `queries`; empty
/// if they are to be taken as they come. `lo`, `hi`: around the points of the index.
template <class T, int Dim>
[[nodiscard]] std::vector<std::uint32_t> order_of_queries(const T* queries, std::size_t n,
                                                          std::size_t stride, const T* lo,
                                                          const T* hi, QueryOrder wanted);

}  // namespace raydix
